"""What an event costs in a network run part by part, for few and for many agents.

``PYTHONPATH=tests python -m benchmarks.network_cost`` prints the table. The networks are rings of agents with constant
weights and a static trigger; their starts are drawn from one distribution, so each agent has about as many events in a
large ring as in a small one. Times are CPU time of the run without the set-up, in turns, and the median of the ratios.
"""

import argparse
import statistics
import time

import numpy as np

import hybrid_model as hm
from hybrid_model import consensus

SMALL = 10


def ring(agents, seed):
    """A ring of agents with the paper's static trigger."""
    entries = {
        "name": f"ring of {agents}",
        "stop_time": 1.0,
        "network": {
            "agents": agents,
            "edges": [[k, k % agents + 1] for k in range(1, agents + 1)],
            "initial": list(np.random.default_rng(seed).uniform(-1.0, 1.0, agents)),
        },
        "weights": {"kind": "constant", "value": 1.0},
        "trigger": {"kind": "static", "threshold": 0.1},
    }
    return consensus.closed_loop(consensus.read_scenario(entries))


def cost(network, t_end):
    """CPU time for each event, in s, and the number of events."""
    began = time.process_time()
    run = hm.simulate_network(network, t_end)
    spent = time.process_time() - began
    return spent / len(run.jumps), len(run.jumps)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="*", default=[100, 1000])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--t-end", type=float, default=1.0)
    options = parser.parse_args()
    print("| agents | events | CPU time per event in ms | ratio to 10 agents |\n| --- | --- | --- | --- |")
    # As many small rings as make up a thousand agents would be: the mean of several keeps chance small.
    small = [ring(SMALL, seed) for seed in range(10)]
    for agents in options.agents:
        large = ring(agents, 0)
        ratios, costs, events = [], [], 0
        for _ in range(options.rounds):
            base = statistics.mean(cost(network, options.t_end)[0] for network in small)
            spent, events = cost(large, options.t_end)
            costs.append(spent)
            ratios.append(spent / base)
        print(f"| {agents} | {events} | {1e3 * statistics.median(costs):.2f} | {statistics.median(ratios):.2f} |")


if __name__ == "__main__":
    main()

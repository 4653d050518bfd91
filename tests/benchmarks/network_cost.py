"""What an event costs in networks run part by part, from a hundred agents on, and what memory they take.

``PYTHONPATH=tests python -m benchmarks.network_cost`` prints the table. Agents have gated-sine weights and a dynamic
trigger; their starts are drawn from one distribution, so each has about as many events in a large ring as in a small
one. Each row is a process of its own: CPU time of the run without the set-up, least of some rounds for small networks,
and the largest memory of the process. The rival is a loop around `scipy.integrate.solve_ivp` with one guard, the
largest error beyond its threshold, which is restarted at each event and at each edge of the gates; another one is
CasADi's `erk` with events, at the loosest decade of tolerance with each agent's last event within 1e-8 s of ours.
Rows of FMUs are their times in a driver in C in event mode, least of three rounds, and the memory of the driver with
two instances.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import hybrid_model as hm
from benchmarks.step_cost import compile_driver, contender, run
from fmu.export import export_fmu
from hybrid_model.consensus.graphs.generators import graph_of_kind
from hybrid_model.consensus.laws.agents import Integrator, agent
from hybrid_model.consensus.laws.threshold_triggers import DynamicTrigger
from hybrid_model.consensus.weights.gated_sine import GatedSine
from hybrid_model.consensus.weights.kinds import weights_block

END, THRESHOLD, DECAY = 30.0, 0.05, 0.06
WAVE = GatedSine(4.0, 5.0, 20.0)
ROUNDS = {100: 5, 1000: 3}


def links_of(graph, agents):
    """Receivers and senders; the ring without a graph in memory."""
    if graph == "ring":
        k = np.arange(agents)
        return np.concatenate([k, k]), np.concatenate([(k - 1) % agents, (k + 1) % agents])
    # Sparse graphs of random places are hardly ever connected at this degree; each component is a network of its own.
    edges = np.array(graph_of_kind(graph, agents, 16.0 if graph == "geometric" else 4.0).edges) - 1
    return edges.ravel(), edges[:, ::-1].ravel()


def starts(agents):
    return np.random.default_rng(0).uniform(-1.0, 1.0, agents)


def network(graph, agents):
    """The agents, as arrays."""

    def part(degree):
        weights = weights_block([WAVE] * degree)
        return agent("agent", Integrator(degree=degree), weights, DynamicTrigger(threshold=THRESHOLD, decay=DECAY))

    values = {"x": starts(agents)}
    signals = {"neighbours": "broadcast"}
    return hm.Network(f"{graph} of {agents}", part, links_of(graph, agents), signals, values=values, count=agents)


def measured(graph, agents):
    """One row: events, CPU time of the run in s, drift of the mean, memory in MB."""
    from hybrid_model.schedule import native_network

    made, spent = network(graph, agents), []
    run_table = native_network.run_table

    def timed(*given):
        began = time.process_time()
        found = run_table(*given)
        spent.append(time.process_time() - began)
        return found

    native_network.run_table = timed
    for _ in range(ROUNDS.get(agents, 1)):
        run = hm.simulate_network(made, END, engine="native")
    drift = abs(float(np.mean(run.final("x")) - np.mean(starts(agents))))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return {"events": len(run.events), "seconds": min(spent), "drift": drift, "memory": memory}


def with_scipy(agents):
    """The ring in a loop around SciPy's DOP853: events, and CPU time in s."""
    began = time.process_time()
    x, t, events = starts(agents), 0.0, 0
    sent = x.copy()
    edges = [*WAVE.breakpoints(0.0, END), END]

    def rates(t, x):
        return -weight(t) * (2.0 * sent - np.roll(sent, 1) - np.roll(sent, -1))

    def guard(t, x):
        return np.max(np.abs(x - sent)) - THRESHOLD * math.exp(-DECAY * t)

    guard.terminal, guard.direction = True, 1.0
    for edge in edges:
        is_open = float(WAVE.amplitude(0.5 * (t + edge)))

        def weight(t, is_open=is_open):
            return is_open * 4.0 * math.sin(5.0 * t) ** 2

        while t < edge:
            piece = solve_ivp(rates, (t, edge), x, method="DOP853", rtol=1e-10, atol=1e-12, events=guard)
            t, x = float(piece.t[-1]), piece.y[:, -1]
            if piece.status == 1:
                errors = np.abs(x - sent)
                fires = errors >= errors.max() * (1.0 - 1e-12)
                events += int(fires.sum())
                sent[fires] = x[fires]
    return {"events": events, "seconds": time.process_time() - began, "memory": 0.0, "drift": 0.0}


def with_casadi(agents):
    """The ring in CasADi's `erk` with events, the gates as controls: events, and CPU time of the one call in s."""
    x, sent, count, t, gate = (ca.SX.sym(*of) for of in (("x", agents), ("sent", agents), ("n",), ("t",), ("gate",)))
    state, none, index = ca.vertcat(x, sent, count), ca.SX.sym("none", 0), ca.SX.sym("index")
    neighbours = ca.vertcat(sent[-1], sent[:-1]) + ca.vertcat(sent[1:], sent[0])
    rates = -gate * 4.0 * ca.sin(5.0 * t) ** 2 * (2.0 * sent - neighbours)
    fires = index == ca.DM(range(agents))
    after = ca.vertcat(x, ca.if_else(fires, x, sent), count + 1)
    model = {
        **{"t": t, "x": state, "u": gate, "ode": ca.vertcat(rates, ca.SX.zeros(agents + 1))},
        "zero": THRESHOLD * ca.exp(-DECAY * t) - ca.fabs(x - sent),
    }
    transition = [index, t, state, none, none, gate], [after, none], ca.event_in(), ca.event_out()
    options = {"reltol": 1e-14, "abstol": 1e-16, "event_tol": 1e-12, "max_events": 10**7}
    edges = [*map(float, WAVE.breakpoints(0.0, END)), END]
    run = ca.integrator(
        "ring", "erk", model, 0.0, edges, {**options, "transition": ca.Function("transition", *transition)}
    )
    gates = ca.DM([float(WAVE.amplitude(0.5 * (a + b))) for a, b in pairwise([0.0, *edges])]).T
    begin, spent = [*starts(agents), *starts(agents), 0.0], []
    for _ in range(3):
        began = time.process_time()
        end = np.array(run(x0=begin, u=gates)["xf"])[:, -1]
        spent.append(time.process_time() - began)
    drift = abs(float(np.mean(end[:agents]) - np.mean(starts(agents))))
    return {"events": int(end[2 * agents]), "seconds": min(spent), "memory": 0.0, "drift": drift}


def as_fmu(agents, points=300):
    """The ring as one FMU, all events handled at the times that it announces, in the driver in C of `step_cost`."""
    with tempfile.TemporaryDirectory() as folder:
        path = export_fmu(network("ring", agents), Path(folder) / "ring.fmu", sources=False)
        ring = contender("ring", path, folder, read=("time",))
        times = run(compile_driver(folder), [ring], rounds=3, step=END / points, stop=END)["ring"]
    _, events = times.counts["events announced"]
    seconds = 1e-9 * min(times.times["events announced"]) * points
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    return {"events": events, "seconds": seconds, "memory": memory}


def in_a_process(what, graph, agents):
    call = [sys.executable, "-m", "benchmarks.network_cost", "--row", what, graph, str(agents)]
    return json.loads(subprocess.run(call, check=True, capture_output=True, text=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="*", default=[100, 1000, 10_000, 100_000])
    parser.add_argument("--graphs", nargs="*", default=["ring", "geometric", "star"])
    parser.add_argument("--fmus", type=int, nargs="*", default=[100, 1000], help="sizes of rings run as FMUs")
    parser.add_argument("--row", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        what, graph, agents = options.row[0], options.row[1], int(options.row[2])
        row = {
            "scipy": lambda: with_scipy(agents),
            "casadi": lambda: with_casadi(agents),
            "fmu": lambda: as_fmu(agents),
        }
        print(json.dumps(row.get(what, lambda: measured(graph, agents))()))
        return
    print("| graph | agents | events | CPU time in s | per event in us | drift of the mean | memory in MB |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for graph in options.graphs:
        for agents in options.agents:
            # Each broadcast of a hub is heard by all others, and there are more of them in large stars.
            if graph == "star" and agents > 10_000:
                continue
            row = in_a_process("native", graph, agents)
            print(
                f"| {graph} | {agents} | {row['events']} | {row['seconds']:.3g} | "
                f"{1e6 * row['seconds'] / row['events']:.1f} | {row['drift']:.0e} | {row['memory']:.0f} |",
                flush=True,
            )
    for agents in options.fmus:
        row = in_a_process("fmu", "ring", agents)
        per_event = 1e6 * row["seconds"] / row["events"]
        print(
            f"| ring, one FMU | {agents} | {row['events']} | {row['seconds']:.3g} | {per_event:.1f} | | "
            f"{row['memory']:.0f} |",
            flush=True,
        )
    for what, told in (("scipy", "SciPy with one guard"), ("casadi", "CasADi erk with events")):
        row = in_a_process(what, "ring", 100)
        per_event = 1e6 * row["seconds"] / row["events"]
        print(f"| ring, {told} | 100 | {row['events']} | {row['seconds']:.3g} | {per_event:.0f} | | |")


if __name__ == "__main__":
    main()

"""Random networks, weights and switching for the certificates: what one seeded generator draws."""

import math

import numpy as np

from hybrid_model.consensus.certificates.components import connected_components, union_time
from hybrid_model.consensus.graphs.generators import (
    complete_graph,
    erdos_renyi_graph,
    geometric_graph,
    path_graph,
    regular_graph,
    ring_graph,
    small_world_graph,
    star_graph,
)
from hybrid_model.consensus.scenario.files import read_scenario

WEIGHTS = ("constant", "gated-sine", "sine", "square", "piecewise", "sampled")
GRAPHS = ("path", "ring", "star", "complete", "regular", "erdos-renyi", "geometric", "small-world")
SWITCHING = ("none", "periodic", "sequence", "random-dwell", "markov", "jointly-connected")
BASE = 2.0
"""Length [s] of what repeats in a network; all periods are simple fractions or multiples of it."""

LONGEST_RUN = 100.0
"""Time [s] that what does not repeat is given for."""


def drawn_scenario(random, most_agents, *, weights=None, switching=None, stop_time=8.0):
    """A network whose edges join all agents over its cycle; kinds are drawn unless given."""
    while True:
        scenario = read_scenario(drawn_entries(random, most_agents, weights, switching, stop_time))
        if len(connected_components(scenario, union_time(scenario))) == 1:
            return scenario


def drawn_entries(random, most_agents, weights, switching, stop_time):
    graph = drawn_graph(random, most_agents)
    order = random.permutation(graph.agents) + 1
    edges = [sorted((int(order[i - 1]), int(order[j - 1]))) for i, j in graph.edges]
    random.shuffle(edges)
    repeats = bool(random.random() < 0.8)
    entries = {
        "name": "drawn",
        "stop_time": stop_time,
        "network": {
            "agents": graph.agents,
            "edges": edges,
            "initial": [0.0] * graph.agents,
            "gain": float(random.uniform(0.3, 2)),
            "underlying": ["listed", "complete"][int(random.integers(2))],
        },
        "weights": drawn_weights(random, weights or str(random.choice(WEIGHTS)), len(edges), repeats),
        "trigger": {"kind": "static", "threshold": 1.0},
    }
    switching = switching or str(random.choice(SWITCHING, p=[0.4, 0.2, 0.1, 0.1, 0.1, 0.1]))
    if switching != "none":
        entries["switching"] = drawn_switching(random, switching, len(edges), repeats)
    return entries


def drawn_graph(random, most):
    kind, n, seed = str(random.choice(GRAPHS)), int(random.integers(2, most + 1)), int(random.integers(2**31))
    if kind == "path":
        return path_graph(n)
    if kind == "star":
        return star_graph(n)
    if kind == "complete":
        return complete_graph(n)
    if kind == "ring":
        return ring_graph(max(n, 3))
    if kind == "regular":
        return regular_graph(max(n, 3), 2 if n % 2 or n < 4 else 3, seed)
    if kind == "erdos-renyi":
        return erdos_renyi_graph(n, float(random.uniform(0.5, 0.9)), seed)
    if kind == "geometric":
        return geometric_graph(n, float(random.uniform(0.6, 1.2)), seed)
    return small_world_graph(max(n, 3), 2, float(random.uniform(0, 0.5)), seed)


def drawn_weights(random, kind, m, repeats):
    rate, row = 2 * np.pi / BASE, lambda low, high: random.uniform(low, high, m).tolist()
    if kind == "constant":
        return {"kind": kind, "value": row(0.2, 3)}
    alike = random.random() < 0.6
    shared = float(random.choice([1, 2, 3]))
    rates = [rate * (shared if alike else float(random.choice([1, 2, 3]))) for _ in range(m)]
    if kind == "gated-sine":
        gate = {"gate_rate": rate * float(random.choice([1, 2])), "duty_percent": row(15, 100), "phase": row(0, 6)}
        return {"kind": kind, "map": str(random.choice(["square", "abs"])), "sine_rate": rates, **gate}
    if kind == "sine":
        depth = 1.0 if random.random() < 0.3 else row(0, 1)
        return {"kind": kind, "mean": row(0.1, 2), "depth": depth, "rate": rates, "phase": row(0, 6)}
    if kind == "square":
        low = 0.0 if random.random() < 0.5 else row(0, 0.3)
        return {
            **{"kind": kind, "high": row(0.3, 3), "low": low},
            **{"gate_rate": rates, "duty_percent": row(15, 90), "phase": row(0, 6)},
        }
    levels = random.uniform(0, 2, (m, 4)) * (random.random((m, 4)) < 0.7)
    levels[:, 0] += 0.3
    times = [0.0, *np.sort(random.uniform(0.2, 1.8, 3)).tolist()]
    if kind == "piecewise":
        cycle = {"cycle": BASE} if repeats else {}
        return {"kind": kind, "starts": times, "values": levels.tolist(), **cycle}
    # Samples that do not repeat must cover the run.
    times = [*times, BASE] if repeats else [0.0, 2.0, 4.0, 6.0, 100.0]
    return {"kind": kind, "times": times, "values": np.hstack((levels, levels[:, :1])).tolist(), "repeat": repeats}


def drawn_switching(random, kind, m, repeats):
    active = [[] for _ in range(int(random.integers(2, 4)))]
    for edge in range(1, m + 1):
        active[int(random.integers(len(active)))].append(edge)
        for graph in active:
            if random.random() < 0.3 and edge not in graph:
                graph.append(edge)
    seed = {"seed": int(random.integers(2**31)), "repeat": repeats}
    # A sequence that repeats lasts a multiple of the base, or weights and switching would have no common period.
    steady = {"shortest": BASE / 4, "longest": BASE / 4, "duration": 2 * BASE if repeats else 100.0, **seed}
    if kind == "periodic":
        return {"kind": kind, "dwell": BASE * float(random.choice([0.25, 0.5, 1.0])), "active": active}
    if kind == "sequence":
        dwells = (random.integers(1, 4, len(active)) * BASE / 4).tolist()
        # A sequence that does not repeat must cover the run.
        rounds = 1 if repeats else math.ceil(LONGEST_RUN / sum(dwells))
        return {"kind": kind, "dwell": dwells * rounds, "active": active * rounds, "repeat": repeats}
    if kind == "random-dwell":
        if not repeats:
            steady["longest"] = BASE
        return {"kind": kind, "active": active, **steady}
    if kind == "markov":
        chances = random.dirichlet(np.ones(len(active)), len(active)).tolist()
        return {"kind": kind, "active": active, "transition": chances, **steady}
    window = {"window": BASE, "graphs": int(random.integers(1, 4)), "spare": 0.2, "duration": steady["duration"]}
    return {"kind": kind, **window, **seed}

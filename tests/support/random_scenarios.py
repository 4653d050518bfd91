"""Random scenarios of the consensus library: one a seed, without ties between agents."""

import numpy as np

from hybrid_model.consensus.scenario.files import read_scenario

TRIGGERS = {
    "static": lambda rng: {"threshold": rng.uniform(0.05, 0.4)},
    "dynamic": lambda rng: {"threshold": rng.uniform(0.05, 0.4), "decay": rng.uniform(0.0, 0.5)},
    "mixed": lambda rng: {
        "offset": rng.uniform(0.03, 0.2),
        "threshold": rng.uniform(0.05, 0.4),
        "decay": rng.uniform(0.1, 1.0),
    },
    "relative": lambda rng: {"sigma": rng.uniform(0.1, 0.9), "floor": 10 ** rng.uniform(-4, -2)},
    "girard": lambda rng: {
        "sigma": rng.uniform(0.1, 0.9),
        "theta": rng.uniform(0.3, 2.0),
        "leak": rng.uniform(0.05, 0.5),
        "reserve": rng.uniform(0.02, 0.3),
    },
    "self-triggered": lambda rng: {"threshold": rng.uniform(0.05, 0.4), "decay": rng.uniform(0.0, 0.5)},
    "sampled": lambda rng: {
        "threshold": rng.uniform(0.02, 0.2),
        "decay": rng.uniform(0.0, 0.3),
        "period": rng.uniform(0.02, 0.2),
    },
    "periodic": lambda rng: {"period": rng.uniform(0.1, 0.7)},
    "continuous": lambda rng: {},
}
"""Kind of trigger -> its numbers."""


def random_scenario(seed, trigger, *, channel=None, weights=None, stop_time=4.0):
    """Draw network, weights, switching, and the numbers of the trigger.

    Parameters
    ----------
    seed : int
        Fixes everything.
    trigger : str
        Kind of trigger.
    channel : dict, optional
        Table of the channel.
    weights : str, optional
        "constant", "gated-sine", or one of `FURTHER`; default: one of the first two is drawn.
    stop_time : float
        In s.
    """
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(2, 5))
    pairs = [[i, j] for i in range(1, agents + 1) for j in range(i + 1, agents + 1)]
    count = int(rng.integers(1, len(pairs) + 1))
    edges = [pairs[k] for k in rng.permutation(len(pairs))[:count]]
    kind = weights or rng.choice(["constant", "gated-sine"])
    entries = {
        "name": f"random {seed}",
        "stop_time": stop_time,
        "network": {
            "agents": agents,
            "edges": edges,
            "initial": rng.uniform(-1.0, 1.0, agents).tolist(),
            "gain": rng.uniform(0.5, 1.5),
        },
        "weights": {"constant": constant, "gated-sine": gated, **FURTHER}[kind](rng, count),
        "trigger": {"kind": trigger, **TRIGGERS[trigger](rng)},
    }
    if rng.random() < 0.5:
        phases = int(rng.integers(1, 4))
        active = [(1 + np.flatnonzero(rng.random(count) < 0.7)).tolist() for _ in range(phases)]
        entries["switching"] = {"dwell": rng.uniform(0.3, 1.5), "active": active}
    if channel:
        entries["channel"] = channel
    return read_scenario(entries)


def constant(rng, count):
    """The table of constant weights."""
    return {"kind": "constant", "value": rng.uniform(0.1, 1.5, count).tolist()}


def sine(rng, count):
    """The table of weights that swing."""
    numbers = {"mean": (0.2, 1.2), "depth": (0.0, 1.0), "rate": (0.5, 6.0), "phase": (-3.0, 3.0)}
    return {"kind": "sine", **{key: rng.uniform(*ends, count).tolist() for key, ends in numbers.items()}}


def square(rng, count):
    """The table of weights that alternate."""
    numbers = {"high": (0.5, 1.5), "low": (0.0, 0.5), "gate_rate": (1.0, 6.0), "duty_percent": (20.0, 90.0)}
    return {"kind": "square", **{key: rng.uniform(*ends, count).tolist() for key, ends in numbers.items()}}


def piecewise(rng, count):
    """The table of weights that step together and, once in two, repeat."""
    rows = int(rng.integers(1, 6))
    starts = np.cumsum(rng.uniform(0.1, 0.6, rows)).tolist()
    cycle = {"cycle": starts[-1] - starts[0] + rng.uniform(0.1, 0.6)} if rng.random() < 0.5 else {}
    return {"kind": "piecewise", "starts": starts, "values": rng.uniform(0.0, 1.5, (count, rows)).tolist(), **cycle}


def sampled(rng, count):
    """The table of weights that run straight between samples and, once in two, repeat."""
    rows, repeats = int(rng.integers(2, 7)), bool(rng.random() < 0.5)
    times, values = [0.0, *np.cumsum(rng.uniform(0.1, 0.6, rows - 1)).tolist()], rng.uniform(0.0, 1.5, (count, rows))
    if repeats:
        values[:, -1] = values[:, 0]
    else:
        times[-1] = 99.0  # They must cover the run.
    return {"kind": "sampled", "times": times, "values": values.tolist(), "repeat": repeats}


FURTHER = {"sine": sine, "square": square, "piecewise": piecewise, "sampled": sampled}
"""Kind of weight -> its table."""
KNOWN_AHEAD = ("constant", "gated-sine", "sine")
"""Weights that self-triggered agents can compute ahead."""


def gated(rng, count):
    """The table of gated sine weights for `count` edges."""
    return {
        "kind": "gated-sine",
        "map": str(rng.choice(["square", "abs"])),
        "gate_rate": rng.uniform(1.0, 6.0, count).tolist(),
        "sine_rate": rng.uniform(1.0, 6.0, count).tolist(),
        "duty_percent": rng.uniform(20.0, 90.0, count).tolist(),
        "phase": rng.uniform(-3.0, 3.0, count).tolist(),
    }

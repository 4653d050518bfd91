"""An automaton whose parameters are tuned in its run, and that run in closed form.

A sawtooth, a timer and a ball side by side, so that a change meets a guard, a known time and a flow. Each change of
`CHANGES` is at a time of its own, but for two at 1.9 s.
"""

import math

import numpy as np

import hybrid_model as hm

CHANGES = {
    # The ramp stands at 0.5 when its limit falls to 0.4: it starts anew at that instant.
    "limit": ((0.5, 0.4), (1.9, 1.0)),
    "slope": ((1.5, 2.0),),
    # At 1.35 s the timer becomes due at 1.17 s, which is over: it ticks at 1.35 s.
    "period": ((0.7, 0.3), (1.35, 0.02), (1.36, 0.5)),
    "g": ((0.6, 2.0), (1.9, 8.0)),
    "e": ((0.2, 0.9),),
}
T_END = 3.0
TIMES = sorted({t for rows in CHANGES.values() for t, _ in rows})


class Tuned(hm.HybridAutomaton):
    """A ramp that starts anew at its limit, a timer that counts from its last tick, and a ball."""

    slope = hm.Parameter(1.0, tunable=True, unit="1/s")
    limit = hm.Parameter(1.0, tunable=True, minimum=0.1, description="where the ramp starts anew")
    period = hm.Parameter(0.55, tunable=True, unit="s")
    g = hm.Parameter(8.0, tunable=True, unit="m/s2")
    e = hm.Parameter(0.75, tunable=True)
    mass = hm.Parameter(2.0, unit="kg")
    gains = hm.Parameter([1.0, 3.0], tunable=True)
    x = hm.State(0.0, output=True)
    h = hm.State(0.81, unit="m", output=True)
    v = hm.State(0.0, unit="m/s", output=True)
    last = hm.DiscreteState(0.0, unit="s", output=True)
    rounds = hm.DiscreteState(0, integer=True, output=True)
    ticks = hm.DiscreteState(0, integer=True, output=True)
    bounces = hm.DiscreteState(0, integer=True, output=True)
    weight = hm.Output(unit="N", description="follows g at once")
    rest = hm.Output(description="share of the limit that is left")
    mix = hm.Output()
    round_clock = hm.Clock("round")
    tick_clock = hm.Clock("tick")
    bounce_clock = hm.Clock("bounce")

    def flow_map(self, s):
        return {"x": s.slope, "h": s.v, "v": -s.g}

    def flow_set(self, s):
        return s.h

    def outputs(self, s):
        return {"weight": s.mass * s.g, "rest": 1.0 - s.x / s.limit, "mix": s.gains @ np.stack([s.x, s.ticks])}

    transitions = (
        hm.Jump("round", lambda self, s: s.x - s.limit, lambda self, s: {"x": 0.0, "rounds": s.rounds + 1}),
        hm.TimeEvent("tick", lambda self, s: s.last + s.period, lambda self, s: {"last": s.t, "ticks": s.ticks + 1}),
        hm.Jump(
            "bounce",
            lambda self, s: hm.least(-s.h, -s.v),
            lambda self, s: {"h": 0.0, "v": -s.e * s.v, "bounces": s.bounces + 1},
        ),
    )


class TunedAndDriven(Tuned):
    """The same with an input that changes along flows, so that nobody can foretell the next event."""

    push = hm.Input(0.0)

    def flow_map(self, s):
        return {**super().flow_map(s), "x": s.slope + s.push}


def ball_flight(t0, h, v, t, g):
    """Height and velocity at t of a ball that flies since t0."""
    return h + v * (t - t0) - 0.5 * g * (t - t0) ** 2, v - g * (t - t0)


def ball_events():
    """Bounces, and the pieces of the flight: (from, height, velocity, gravity)."""
    pieces, bounces, t, h, v, g, e = [], [], 0.0, 0.81, 0.0, 8.0, 0.75
    changes = sorted([(t, "g", value) for t, value in CHANGES["g"]] + [(t, "e", value) for t, value in CHANGES["e"]])
    while True:
        pieces.append((t, h, v, g))
        floor = t + (v + math.sqrt(v * v + 2.0 * g * h)) / g
        if changes and changes[0][0] < floor:
            at, name, value = changes.pop(0)
            h, v = ball_flight(t, h, v, at, g)
            t, g, e = at, value if name == "g" else g, value if name == "e" else e
        elif floor < T_END:
            _, v = ball_flight(t, h, v, floor, g)
            t, h, v = floor, 0.0, -e * v
            bounces.append(t)
        else:
            return bounces, pieces


ROUNDS = [0.5, 0.9, 1.3, 1.6, 1.8, 2.3, 2.8]  # 0.4 / 1 each, from 1.5 s on 0.4 / 2; 2.3 = 1.9 + (1 - 0.2) / 2
TICKS = [0.55, 0.85, 1.15, 1.35, 1.85, 2.35, 2.85]
BOUNCES, FLIGHT = ball_events()
EVENTS = {"round": ROUNDS, "tick": TICKS, "bounce": BOUNCES}
JUMPS = sorted((t, name) for name, times in EVENTS.items() for t in times)
"""All jumps, in time; no two are at one instant."""


def held(name, t):
    """The value of a parameter at t."""
    rows = [value for at, value in CHANGES[name] if at <= t]
    return rows[-1] if rows else float({"limit": 1.0, "slope": 1.0, "period": 0.55, "g": 8.0, "e": 0.75}[name])


def ramp(t):
    """The ramp at t, after what happens there."""
    begin = max([0.0, *(at for at in ROUNDS if at <= t)])
    slow, fast = min(max(1.5 - begin, 0.0), t - begin), max(t - max(begin, 1.5), 0.0)
    return slow + 2.0 * fast


def exact(t):
    """The values at t, by name, after what happens there."""
    t0, h, v, g = [piece for piece in FLIGHT if piece[0] <= t][-1]
    h, v = ball_flight(t0, h, v, t, g)
    counts = {name: sum(at <= t for at in times) for name, times in EVENTS.items()}
    last = max([0.0, *(at for at in TICKS if at <= t)])
    return {
        "x": ramp(t), "h": h, "v": v, "last": last,
        "weight": 2.0 * held("g", t), "rest": 1.0 - ramp(t) / held("limit", t),
        "rounds": counts["round"], "ticks": counts["tick"], "bounces": counts["bounce"],
    }  # fmt: skip


def signals():
    """The changes as inputs of `simulate`."""
    return {name: hm.Signal(lambda t, name=name: held(name, t), [t for t, _ in CHANGES[name]]) for name in CHANGES}


POINTS = [
    t for t in np.round(np.arange(0.0, T_END, 0.13), 12).tolist() if min(abs(t - np.array(TIMES + ROUNDS))) > 1e-6
]
"""Instants at which nothing happens, for values on both sides of every event."""

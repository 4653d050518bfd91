"""Stiff systems whose events are known: closed forms, or digits of a method of another kind in higher precision."""

import math

import numpy as np
from scipy.optimize import brentq

import hybrid_model as hm

RISES = {
    10.0: (18.633872364890605367, 37.712241931829619437),
    100.0: (162.60048895271987015, 325.43756004508988229),
    1e3: (1614.2862655957325369, 3228.6873914040665200),
    1e4: (16137.327211180078125, 32274.708429262633820, 48412.089647345189516),
}
"""Of `VanDerPol` by its damping, in s.

Collocation at the 13 points of Radau IIA in numbers of 113 bits, alike at tolerances of 1e-16 and 1e-18.
"""


class Drawn(hm.HybridAutomaton):
    """x' = -rate (x - cos t) - sin t: x = cos t + (x0 - cos t0) exp(-rate (t - t0)) (Prothero and Robinson, 1974).

    Where x falls to zero first it is set to 1, and drawn back within some 1/rate: on the way it passes the level 0.5.
    """

    x = hm.State(1.0)
    stage = hm.DiscreteState(0, integer=True)
    rate = hm.Parameter(1e6, unit="1/s")
    zeros = hm.Clock("zero")
    passes = hm.Clock("pass")

    def flow_map(self, s):
        return {"x": -s.rate * (s.x - np.cos(s.t)) - np.sin(s.t)}

    def at_zero(self, s):
        return hm.least(-s.x, 0.5 - s.stage)

    def kick(self, s):
        return {"x": 1.0, "stage": 1}

    def at_level(self, s):
        return hm.least(0.5 - s.x, s.stage - 0.5, 1.5 - s.stage)

    def note(self, s):
        return {"stage": 2}

    transitions = (hm.Jump("zero", at_zero, kick), hm.Jump("pass", at_level, note))


def drawn_events(rate):
    """The kick and the passage after it, in s; what is left of the start is gone by then."""
    zero = math.pi / 2
    width = 1.0 / rate
    level = brentq(
        lambda s: math.cos(zero + s) + (1.0 - math.cos(zero)) * math.exp(-rate * s) - 0.5, 0.0, 10.0 * width, xtol=1e-18
    )
    return {"zero": zero, "pass": zero + level}


class Hysteresis(hm.ModalAutomaton):
    """A slow state climbs in one mode and falls in the other; a fast one follows it and switches at its limits.

    Slow: v' = (target - v)/slow. Fast: w' = (v - w)/fast. Both in closed form in each mode.
    """

    v = hm.State(0.0)
    w = hm.State(0.0)
    slow = hm.Parameter(1.0, unit="s")
    fast = hm.Parameter(1e-6, unit="s")
    turns = hm.Clock("full")
    returns = hm.Clock("empty")

    def climb(self, s):
        return {"v": (3.0 - s.v) / s.slow, "w": (s.v - s.w) / s.fast}

    def sink(self, s):
        return {"v": (-3.0 - s.v) / s.slow, "w": (s.v - s.w) / s.fast}

    def full(self, s):
        return s.w - 1.0

    def empty(self, s):
        return -1.0 - s.w

    def jolt(self, s):
        return {"w": s.w + 0.5 * s.v}

    modes = (hm.Mode("climbing", climb), hm.Mode("sinking", sink))
    switches = (
        hm.Switch("full", "climbing", "sinking", full, jolt),
        hm.Switch("empty", "sinking", "climbing", empty, jolt),
    )


def hysteresis_events(count, slow=1.0, fast=1e-6):
    """Times in s of the first turns and returns, one after the other."""
    t, v, w, target, found = 0.0, 0.0, 0.0, 3.0, []
    ratio = fast / slow
    for _ in range(count):
        a, limit = v - target, math.copysign(1.0, target)
        b = w - target - a / (1.0 - ratio)

        def fast_state(s, a=a, b=b, target=target):
            return target + a / (1.0 - ratio) * math.exp(-s / slow) + b * math.exp(-s / fast)

        # A jolt leads beyond the limit that it came from; the other one is reached much later.
        s = brentq(lambda s, limit=limit: fast_state(s) - limit, 50.0 * fast, 5.0 * slow, xtol=1e-15)
        t, v, w, target = t + s, target + a * math.exp(-s / slow), limit, -target
        w += 0.5 * v
        found.append(t)
    return found


class Robertson(hm.HybridAutomaton):
    """Three reactions at rates from 0.04 to 3e7; notes when half of the first substance is left."""

    a = hm.State(1.0, output=True)
    b = hm.State(0.0, output=True)
    c = hm.State(0.0, output=True)
    halved_once = hm.DiscreteState(0, integer=True)
    half = hm.Clock("jump")

    def flow_map(self, s):
        slow, fast, back = 0.04 * s.a, 3e7 * s.b**2, 1e4 * s.b * s.c
        return {"a": back - slow, "b": slow - back - fast, "c": fast}

    def jump_set(self, s):
        return hm.least(0.5 - s.a, 0.5 - s.halved_once)

    def jump_map(self, s):
        return {"halved_once": 1}


ROBERTSON_END = 1e11
ROBERTSON_AT_END = {"a": 0.2083340149701255e-07, "b": 0.8333360770334713e-13, "c": 0.9999999791665050}
"""Test Set for IVP Solvers, release 2.4, problem ROBER."""
ROBERTSON_HALF = 268.32472601545788716
"""In s; like `RISES`."""


def spread_matrix(n):
    """A full symmetric matrix with eigenvalues from -1 to -1e6, and its eigenvectors."""
    vectors, _ = np.linalg.qr(np.random.default_rng(n).normal(size=(n, n)))
    values = -np.logspace(0.0, 6.0, n)
    return vectors * values @ vectors.T, values, vectors


class Coupled(hm.HybridAutomaton):
    """x' = A x with time scales a million apart, started anew each time its first state falls to the level."""

    n = hm.Dimension("states")
    x = hm.State(1.0, shape="n")
    matrix = hm.Parameter(0.0, shape=("n", "n"))
    level = hm.Parameter(0.05)
    restarts = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": s.matrix @ s.x}

    def jump_set(self, s):
        return s.level - s.x[0]

    def jump_map(self, s):
        return {"x": s.x + 1.0}


def coupled_restarts(count, n, level=0.05):
    """Times in s at which it starts anew, by its eigenvectors."""
    _, values, vectors = spread_matrix(n)
    t, x, found = 0.0, np.ones(n), []
    for _ in range(count):
        parts = vectors.T @ x

        def state(s, parts=parts):
            return vectors @ (np.exp(values * s) * parts)

        times = np.concatenate([[0.0], np.logspace(-9.0, 2.0, 4000)])
        first = np.array([state(s)[0] for s in times])
        after = int(np.argmax(first <= level))
        s = brentq(lambda s: state(s)[0] - level, times[after - 1], times[after], xtol=1e-300, rtol=1e-15)
        t, x = t + s, state(s) + 1.0
        found.append(t)
    return found

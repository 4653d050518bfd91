"""Nine automata as textbooks have them: the benchmarks run them against loops over SciPy, the tests against exact runs.

None of them is in the library, so their maps are those of a user. Exact events: `oracles/exact_textbook.py`.
"""

import numpy as np

import hybrid_model as hm


class DragBall(hm.HybridAutomaton):
    """A ball on a floor in air: drag grows with the square of the speed."""

    h = hm.State(1.0)
    v = hm.State(0.0)
    g = hm.Parameter(9.81)
    drag = hm.Parameter(0.05)
    e = hm.Parameter(0.85)

    def flow_map(self, s):
        return {"h": s.v, "v": -s.g - s.drag * s.v * np.abs(s.v)}

    def flow_set(self, s):
        return s.h

    def jump_set(self, s):
        return hm.least(-s.h, -s.v)

    def jump_map(self, s):
        return {"h": 0.0, "v": -s.e * s.v}


class Neurons(hm.HybridAutomaton):
    """Two leaky integrate-and-fire neurons: one that fires starts again at 0 and lifts the other."""

    a = hm.State(0.0)
    b = hm.State(0.35)
    current_a = hm.Parameter(1.3)
    current_b = hm.Parameter(1.25)
    lift = hm.Parameter(0.04)

    def flow_map(self, s):
        return {"a": s.current_a - s.a, "b": s.current_b - s.b}

    def a_full(self, s):
        return s.a - 1.0

    def b_full(self, s):
        return s.b - 1.0

    def a_fires(self, s):
        return {"a": 0.0, "b": s.b + s.lift}

    def b_fires(self, s):
        return {"b": 0.0, "a": s.a + s.lift}

    transitions = (hm.Jump("a_fires", a_full, a_fires), hm.Jump("b_fires", b_full, b_fires))


class Buck(hm.HybridAutomaton):
    """A step-down converter in continuous conduction whose switch keeps the coil's current in a band.

    In V, A and ms.
    """

    i = hm.State(0.0)
    v = hm.State(0.0)
    on = hm.DiscreteState(1, integer=True)
    supply = hm.Parameter(12.0)
    L = hm.Parameter(0.1)
    C = hm.Parameter(0.2)
    R = hm.Parameter(2.5)
    reference = hm.Parameter(2.0)
    band = hm.Parameter(0.2)

    def flow_map(self, s):
        return {"i": (s.on * s.supply - s.v) / s.L, "v": (s.i - s.v / s.R) / s.C}

    def high(self, s):
        return hm.least(s.i - s.reference - s.band, s.on - 0.5)

    def low(self, s):
        return hm.least(s.reference - s.band - s.i, 0.5 - s.on)

    def switch(self, s):
        return {"on": 1 - s.on}

    transitions = (hm.Jump("off", high, switch), hm.Jump("on", low, switch))


class StickSlip(hm.ModalAutomaton):
    """A block on a spring and on a belt: it sticks until the spring pulls harder than dry friction holds."""

    x = hm.State(0.0)
    v = hm.State(0.5)
    belt = hm.Parameter(0.5)
    k = hm.Parameter(1.0)
    holds = hm.Parameter(1.5)
    drags = hm.Parameter(1.0)

    def sticking(self, s):
        return {"x": s.belt, "v": 0.0}

    def slipping(self, s):
        return {"x": s.v, "v": s.drags - s.k * s.x}

    def pulled(self, s):
        return s.k * s.x - s.holds

    def caught(self, s):
        return hm.least(s.v - s.belt, s.drags - s.k * s.x)

    def catch(self, s):
        return {"v": s.belt}

    modes = (hm.Mode("stick", sticking), hm.Mode("slip", slipping))
    switches = (
        hm.Switch("slips", "stick", "slip", pulled),
        hm.Switch("sticks", "slip", "stick", caught, catch),
    )


class PendulumAtWall(hm.HybridAutomaton):
    """A pendulum that hits a wall left of its lowest point."""

    angle = hm.State(1.2)
    speed = hm.State(0.0)
    wall = hm.Parameter(-0.3)
    e = hm.Parameter(0.95)

    def flow_map(self, s):
        return {"angle": s.speed, "speed": -np.sin(s.angle)}

    def jump_set(self, s):
        return hm.least(s.wall - s.angle, -s.speed)

    def jump_map(self, s):
        return {"angle": s.wall, "speed": -s.e * s.speed}


class CircleBilliard(hm.HybridAutomaton):
    """A point that moves straight in the unit circle and is reflected at it; position and velocity are vectors."""

    r = hm.State([0.3, 0.0])
    w = hm.State([0.6, 0.8])

    def flow_map(self, s):
        return {"r": s.w, "w": np.zeros(2)}

    def jump_set(self, s):
        return hm.least(s.r @ s.r - 1.0, s.r @ s.w)

    def jump_map(self, s):
        normal = s.r / np.sqrt(s.r @ s.r)
        return {"r": normal, "w": s.w - 2.0 * (s.w @ normal) * normal}


class RimlessWheel(hm.HybridAutomaton):
    """A wheel of spokes that walks down a slope (McGeer 1990): an inverted pendulum from spoke to spoke."""

    angle = hm.State(-0.2)
    speed = hm.State(0.6)
    slope = hm.Parameter(0.08)
    half = hm.Parameter(0.3)

    def flow_map(self, s):
        return {"angle": s.speed, "speed": np.sin(s.angle)}

    def jump_set(self, s):
        return hm.least(s.angle - s.slope - s.half, s.speed)

    def jump_map(self, s):
        return {"angle": s.slope - s.half, "speed": np.cos(2.0 * s.half) * s.speed}


class ResetLoop(hm.HybridAutomaton):
    """A Clegg integrator (1958) around 1/(s (s + 1)): it is emptied each time that the error changes its sign."""

    y = hm.State(0.0)
    rate = hm.State(0.0)
    c = hm.State(0.0)
    sign = hm.DiscreteState(1, integer=True)
    gain = hm.Parameter(2.0)
    wanted = hm.Parameter(1.0)

    def flow_map(self, s):
        error = s.wanted - s.y
        return {"y": s.rate, "rate": -s.rate + s.gain * s.c + error, "c": error}

    def crossed(self, s):
        # The second margin: the error moves on away from zero.
        return hm.least(-s.sign * (s.wanted - s.y), s.sign * s.rate)

    def empty(self, s):
        return {"c": 0.0, "sign": -s.sign}

    transitions = (hm.Jump("empty", crossed, empty),)


class SampledPd(hm.HybridAutomaton):
    """A double integrator whose force is computed every 0.1 s from position and speed and is held in between."""

    x = hm.State(1.0)
    v = hm.State(0.0)
    u = hm.DiscreteState(0.0)
    k = hm.DiscreteState(0, integer=True)
    period = hm.Parameter(0.1)
    kp = hm.Parameter(4.0)
    kd = hm.Parameter(2.0)

    def flow_map(self, s):
        return {"x": s.v, "v": s.u}

    def next_time(self, s):
        return s.k * s.period

    def sample(self, s):
        return {"u": -s.kp * s.x - s.kd * s.v, "k": s.k + 1}

    transitions = (hm.TimeEvent("sample", next_time, sample),)


TEXTBOOK = {
    "drag_ball": (DragBall, 4.0),
    "neurons": (Neurons, 20.0),
    "buck": (Buck, 1.0),
    "stick_slip": (StickSlip, 100.0),
    "pendulum_at_wall": (PendulumAtWall, 60.0),
    "circle_billiard": (CircleBilliard, 40.0),
    "rimless_wheel": (RimlessWheel, 40.0),
    "reset_loop": (ResetLoop, 40.0),
    "sampled_pd": (SampledPd, 5.05),
}
"""Name -> class and end time in s (the converter: ms)."""

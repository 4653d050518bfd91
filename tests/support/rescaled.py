"""Any automaton in another unit of time, and two automata whose units are parameters."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, Values
from hybrid_model.declare.wrapper import Wrapper


class InOtherTime(Wrapper):
    """The same automaton where one unit of its time is `unit` seconds: a run is the same one, stretched."""

    def __init__(self, automaton, unit):
        super().__init__(automaton)
        self.unit = unit

    def inner(self, s):
        names = [v.name for v in self.variables if v.kind is not Kind.OUTPUT]
        return Values(self.name, {"t": s.t / self.unit, **{name: s[name] for name in names}})

    def derivatives(self, s):
        return {name: rate / self.unit for name, rate in super().derivatives(s).items()}

    def event_times(self, s):
        return [time * self.unit for time in super().event_times(s)]


class Sawtooth(hm.HybridAutomaton):
    """Rises at the frequency f and falls by one whenever it comes to one."""

    x = hm.State(0.0, output=True)
    n = hm.DiscreteState(0, integer=True, output=True)
    f = hm.Parameter(1.0)

    def flow_map(self, s):
        return {"x": s.f}

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": s.x - 1.0, "n": s.n + 1}


class Ring(hm.HybridAutomaton):
    """An oscillation x = size cos(w t) that counts its changes of sign."""

    x = hm.State(computed=True, output=True)
    v = hm.State(0.0)
    n = hm.DiscreteState(0, integer=True, output=True)
    side = hm.DiscreteState(1)
    w = hm.Parameter(1.0)
    size = hm.Parameter(1.0)

    def start_map(self, s):
        return {"x": s.size}

    def flow_map(self, s):
        return {"x": s.w * s.v, "v": -s.w * s.x}

    def jump_set(self, s):
        return -s.side * s.x

    def jump_map(self, s):
        return {"n": s.n + 1, "side": -s.side}


class Charge(hm.HybridAutomaton):
    """A charge that grows at a constant current and may not exceed what the plate holds; no jump helps."""

    q = hm.State(0.0, output=True)
    current = hm.Parameter(1e-10, unit="C/s")
    most = hm.Parameter(1e-10, unit="C")

    def flow_map(self, s):
        return {"q": s.current}

    def flow_set(self, s):
        return s.most - s.q


class Twins(hm.HybridAutomaton):
    """Two states reach their levels at the same time up to rounding; who fires first takes the other's reason away.

    Together they are one instant, and both fire.
    """

    up = hm.State(0.0)
    down = hm.State(computed=True)
    fired = hm.DiscreteState([0.0, 0.0], output=True)
    f = hm.Parameter(1.0)
    size = hm.Parameter(1.0)

    def start_map(self, s):
        return {"down": 0.3 * s.size}

    def flow_map(self, s):
        return {"up": 0.1 * s.f * s.size, "down": -0.1 * s.f * s.size}

    def risen(self, s):
        return hm.least(s.up - 0.7 * s.size, (0.5 - s.fired[0]) * s.size)

    def fallen(self, s):
        return hm.least(-0.4 * s.size - s.down, (0.5 - s.fired[1]) * s.size)

    transitions = (
        hm.Jump("risen", risen, lambda self, s: {"fired": np.stack([1.0, s.fired[1]])}),
        hm.Jump("fallen", fallen, lambda self, s: {"fired": np.stack([s.fired[0], 1.0])}),
    )

"""Two leaking tanks that share one inflow: the textbook example of Zeno behaviour."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class TwoTank(hm.HybridAutomaton):
    """Two tanks drain all the time; one inflow fills the tank that has reached its lower level last.

    Johansson, Egerstedt, Lygeros, Sastry: On the regularization of Zeno hybrid automata, Systems & Control Letters
    38 (1999), section 3. With ``max(v1, v2) < w < v1 + v2`` the switches accumulate where both tanks are at their lower
    level, which the total volume reaches at ``(x1 + x2 - r1 - r2)/(v1 + v2 - w)``: 4 s for the values below. From one
    round to the next the gaps shrink by ``(w - v1)(w - v2)/(v1 v2)``.
    """

    x1 = hm.State(0.0, unit="m3", description="volume in tank 1", output=True)
    x2 = hm.State(1.0, unit="m3", description="volume in tank 2", output=True)
    filled = hm.DiscreteState(1, integer=True, description="number of the tank that is filled, 1 or 2", output=True)
    w = hm.Parameter(0.75, unit="m3/s", description="inflow")
    v1 = hm.Parameter(0.5, unit="m3/s", description="outflow of tank 1")
    v2 = hm.Parameter(0.5, unit="m3/s", description="outflow of tank 2")
    r1 = hm.Parameter(0.0, unit="m3", description="lower level of tank 1")
    r2 = hm.Parameter(0.0, unit="m3", description="lower level of tank 2")
    filling_first = hm.Clock("fill_first", description="ticks when the inflow turns to tank 1")
    filling_second = hm.Clock("fill_second", description="ticks when the inflow turns to tank 2")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Constant inflow and outflows."""
        return {"x1": s.w * (2 - s.filled) - s.v1, "x2": s.w * (s.filled - 1) - s.v2}

    def flow_set(self, s: hm.Values) -> Value:
        """The tank that is not filled is above its lower level."""
        return np.where(s.filled < 1.5, s.x2 - s.r2, s.x1 - s.r1)

    def first_is_low(self, s: hm.Values) -> Value:
        """Tank 1 at its lower level, and not filled."""
        return hm.least(s.r1 - s.x1, s.filled - 1.5)

    def second_is_low(self, s: hm.Values) -> Value:
        """Tank 2 at its lower level, and not filled."""
        return hm.least(s.r2 - s.x2, 1.5 - s.filled)

    def fill_first(self, s: hm.Values) -> dict[str, Value]:
        """Turn the inflow to tank 1."""
        return {"filled": 1}

    def fill_second(self, s: hm.Values) -> dict[str, Value]:
        """Turn the inflow to tank 2."""
        return {"filled": 2}

    transitions = (
        hm.Jump("fill_first", first_is_low, fill_first),
        hm.Jump("fill_second", second_is_low, fill_second),
    )

"""A ball that a controller pushes at each impact, so that it bounces with a given period."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class PushedBall(hm.HybridAutomaton):
    """A bouncing ball whose impacts add a push: ``v+ = -e v + push``."""

    h = hm.State(1.0, unit="m", description="height of the ball", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity of the ball, upward", output=True)
    impacts = hm.DiscreteState(0, integer=True, description="number of impacts", output=True)
    push = hm.Input(0.0, unit="m/s", discrete=True, description="velocity that an impact adds")
    g = hm.Parameter(9.8, unit="m/s2", description="gravity")
    e = hm.Parameter(0.7, description="coefficient of restitution")
    impact = hm.Clock("jump", description="ticks with each impact")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Free fall."""
        return {"h": s.v, "v": -s.g}

    def flow_set(self, s: hm.Values) -> Value:
        """Above the floor."""
        return s.h

    def jump_set(self, s: hm.Values) -> Value:
        """On the floor and falling."""
        return hm.least(-s.h, -s.v)

    def jump_map(self, s: hm.Values) -> dict[str, Value]:
        """Impact with a push."""
        return {"h": 0.0, "v": -s.e * s.v + s.push, "impacts": s.impacts + 1}


class PeriodController(hm.HybridAutomaton):
    """Measures the time between impacts and corrects the push: ``push+ = max(0, push + gain (period - timer))``.

    It hears of an impact by the count, at the same instant; the corrected push acts at the next impact.
    """

    timer = hm.State(0.0, unit="s", description="time since the last impact")
    push = hm.DiscreteState(0.0, unit="m/s", description="push at the next impact", output=True)
    heard = hm.DiscreteState(0, integer=True, description="number of impacts heard of")
    impacts = hm.Input(0.0, discrete=True, description="number of impacts")
    period = hm.Parameter(2.0, unit="s", description="period wanted")
    gain = hm.Parameter(0.5, unit="m/s2", description="change of the push per second of error")
    correction = hm.Clock("jump", description="ticks with each correction")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Count the time."""
        return {"timer": 1.0}

    def jump_set(self, s: hm.Values) -> Value:
        """An impact not heard of yet."""
        return s.impacts - s.heard - 0.5

    def jump_map(self, s: hm.Values) -> dict[str, Value]:
        """Correct the push and start the timer anew."""
        push = np.maximum(0.0, s.push + s.gain * (s.period - s.timer))
        return {"push": push, "timer": 0.0, "heard": s.impacts}


class JuggledBall(hm.Composition):
    """The ball and the controller in a circle, after the example of composite systems of the HyEQ Toolbox.

    The rebound speeds and pushes obey ``v[n+1] = e v[n] + push[n]`` and
    ``push[n+1] = max(0, push[n] + gain (period - 2 v[n]/g))``, with the flights ``2 v[n]/g``. While no push is cut off
    at zero that map is affine with the determinant ``e + 2 gain/g``. Below one, as for the values here (the toolbox has
    e = 0.9 and gain = 1, above one), the flights converge to `period` and the push to ``(1 - e) g period/2``.

    Parameters
    ----------
    name : str
        Name of the composition.
    period : float
        Period in s that is wanted between impacts.
    """

    def __init__(self, name: str = "JuggledBall", *, period: float = 2.0) -> None:
        parts = {"ball": PushedBall(), "controller": PeriodController(period=period)}
        wires = {"ball.push": "controller.push", "controller.impacts": "ball.impacts"}
        super().__init__(name, parts, wires)

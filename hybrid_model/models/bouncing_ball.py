"""A ball on a floor."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class BouncingBall(hm.HybridAutomaton):
    """A ball on a floor; impacts lose energy.

    Impacts accumulate at ``sqrt(2 h/g) (1 + e)/(1 - e)`` for a ball dropped from h: 2.5587 s for the values below.
    """

    h = hm.State(1.0, unit="m", description="height of the ball", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity of the ball, upward", output=True)
    g = hm.Parameter(9.81, unit="m/s2", description="gravity")
    e = hm.Parameter(0.7, minimum=0.0, maximum=1.0, description="coefficient of restitution")
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
        """Newton's law of impact."""
        return {"h": 0.0, "v": -s.e * s.v}

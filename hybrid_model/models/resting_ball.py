"""A ball that bounces and comes to rest: a classical hybrid automaton."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class RestingBall(hm.ModalAutomaton):
    """A bouncing ball with a mode for what comes after its impacts: it stays down once it would rebound too slowly.

    Dropped from h it hits the floor with ``v0 = sqrt(2 g h)`` and rebounds with ``e^n v0`` after impact n, so it comes
    to rest at the first impact with ``e^n v0 < slowest``. The run goes on where that of `BouncingBall` accumulates.
    """

    h = hm.State(1.0, unit="m", description="height of the ball", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity of the ball, upward", output=True)
    g = hm.Parameter(9.81, unit="m/s2", description="gravity")
    e = hm.Parameter(0.7, description="coefficient of restitution")
    slowest = hm.Parameter(0.1, unit="m/s", description="slowest rebound")

    def fall(self, s: hm.Values) -> dict[str, Value]:
        """Free fall."""
        return {"h": s.v, "v": -s.g}

    def above_floor(self, s: hm.Values) -> Value:
        """Above the floor."""
        return s.h

    def slow_impact(self, s: hm.Values) -> Value:
        """On the floor and falling, too slow to rebound."""
        return hm.least(-s.h, -s.v, s.slowest + s.e * s.v)

    def impact(self, s: hm.Values) -> Value:
        """On the floor and falling."""
        return hm.least(-s.h, -s.v)

    def stop(self, s: hm.Values) -> dict[str, Value]:
        """Lie on the floor."""
        return {"h": 0.0, "v": 0.0}

    def rebound(self, s: hm.Values) -> dict[str, Value]:
        """Newton's law of impact."""
        return {"h": 0.0, "v": -s.e * s.v}

    modes = (hm.Mode("flying", fall, above_floor), hm.Mode("resting"))
    switches = (
        hm.Switch("rest", "flying", "resting", slow_impact, stop),
        hm.Switch("impact", "flying", "flying", impact, rebound),
    )

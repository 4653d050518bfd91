"""A mass pushed back and forth by a relay with hysteresis."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class RelayHysteresis(hm.HybridAutomaton):
    """A mass on rails, ``x'' = -a u``, under the relay ``u = +1`` or ``-1`` that listens to ``x + k x'``.

    The relay turns to +1 where the signal reaches ``width`` and to -1 where it reaches ``-width``. By the closed form
    of the parabolas, a switch at speed v is followed by the opposite switch after ``(v + w)/a`` at the speed w with
    ``(w + k a)^2 = (v - k a)^2 + 4 a width``. That map contracts, so every run approaches the limit cycle with the
    period ``4 width/(k a)``, switches at x = 0 with the speed ``width/k``, and the amplitude
    ``width^2/(2 k^2 a)``: 4 s, 0.5 m/s and 0.25 m for the values below.
    """

    x = hm.State(0.0, unit="m", description="position", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity", output=True)
    relay = hm.DiscreteState(-1, integer=True, description="state of the relay, +1 or -1", output=True)
    acceleration = hm.Parameter(0.5, unit="m/s2", description="acceleration a by the relay's push")
    rate_gain = hm.Parameter(0.2, unit="s", description="weight k of the velocity in the signal")
    width = hm.Parameter(0.1, unit="m", description="half the width of the hysteresis")
    turned_up = hm.Clock("turn_up", description="ticks when the relay turns to +1")
    turned_down = hm.Clock("turn_down", description="ticks when the relay turns to -1")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Double integrator."""
        return {"x": s.v, "v": -s.acceleration * s.relay}

    def too_high(self, s: hm.Values) -> Value:
        """The signal at or above the upper threshold with the relay at -1."""
        return hm.least(s.x + s.rate_gain * s.v - s.width, -s.relay)

    def too_low(self, s: hm.Values) -> Value:
        """The signal at or below the lower threshold with the relay at +1."""
        return hm.least(-s.width - s.x - s.rate_gain * s.v, s.relay)

    def turn_up(self, s: hm.Values) -> dict[str, Value]:
        """Push towards negative positions."""
        return {"relay": 1}

    def turn_down(self, s: hm.Values) -> dict[str, Value]:
        """Push towards positive positions."""
        return {"relay": -1}

    transitions = (hm.Jump("turn_up", too_high, turn_up), hm.Jump("turn_down", too_low, turn_down))

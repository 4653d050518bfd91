"""A heated room with a two-point controller."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class Thermostat(hm.HybridAutomaton):
    """A room that loses heat, and a heater that switches on at `lower` and off at `upper`.

    Between switches the temperature relaxes exponentially, so the switching times have a closed form:
    ``tau ln((upper - T_off)/(lower - T_off))`` off, likewise on.
    """

    temperature = hm.State(20.0, unit="degC", description="room temperature", output=True)
    heating = hm.DiscreteState(1, integer=True, description="1 while the heater is on", output=True)
    ambient = hm.Parameter(5.0, unit="degC", description="temperature outside")
    rise = hm.Parameter(30.0, unit="K", description="steady rise of the temperature by the heater")
    time_constant = hm.Parameter(100.0, unit="s", description="time constant of the room")
    lower = hm.Parameter(19.0, unit="degC", description="the heater goes on here")
    upper = hm.Parameter(21.0, unit="degC", description="the heater goes off here")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """First-order relaxation to the temperature that the heater can hold."""
        return {"temperature": (s.ambient + s.rise * s.heating - s.temperature) / s.time_constant}

    def too_warm(self, s: hm.Values) -> Value:
        """At or above the upper limit with the heater on."""
        return hm.least(s.temperature - s.upper, s.heating - 0.5)

    def too_cold(self, s: hm.Values) -> Value:
        """At or below the lower limit with the heater off."""
        return hm.least(s.lower - s.temperature, 0.5 - s.heating)

    def turn_off(self, s: hm.Values) -> dict[str, Value]:
        """Turn the heater off."""
        return {"heating": 0}

    def turn_on(self, s: hm.Values) -> dict[str, Value]:
        """Turn the heater on."""
        return {"heating": 1}

    transitions = (hm.Jump("off", too_warm, turn_off), hm.Jump("on", too_cold, turn_on))

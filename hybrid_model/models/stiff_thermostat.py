"""A heated room with a fast temperature sensor: two time constants a million apart."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class StiffThermostat(hm.HybridAutomaton):
    """A `Thermostat` that sees the room through a sensor with a lag of its own.

    The room relaxes with ``time_constant``, the sensor follows with ``sensor_lag``, 1e-6 of it for the values below.
    Between switches, with ``w`` the temperature that the heater can hold and ``k = sensor_lag/time_constant``,

        temperature = w + A exp(-t/time_constant),
        reading = w + A/(1 - k) exp(-t/time_constant) + B exp(-t/sensor_lag):

    two exponentials, of which the fast one is gone after a few sensor lags. An explicit method has to keep its steps
    below some three sensor lags all the same, for stability; Radau and BDF step over the slow one.
    """

    temperature = hm.State(20.0, unit="degC", description="room temperature", output=True)
    reading = hm.State(20.0, unit="degC", description="temperature that the sensor shows", output=True)
    heating = hm.DiscreteState(1, integer=True, description="1 while the heater is on", output=True)
    ambient = hm.Parameter(5.0, unit="degC", description="temperature outside")
    rise = hm.Parameter(30.0, unit="K", description="steady rise of the temperature by the heater")
    time_constant = hm.Parameter(100.0, unit="s", description="time constant of the room")
    sensor_lag = hm.Parameter(1e-4, unit="s", description="time constant of the sensor")
    lower = hm.Parameter(19.0, unit="degC", description="the heater goes on where the sensor shows this")
    upper = hm.Parameter(21.0, unit="degC", description="the heater goes off where the sensor shows this")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Two first-order lags in a row."""
        return {
            "temperature": (s.ambient + s.rise * s.heating - s.temperature) / s.time_constant,
            "reading": (s.temperature - s.reading) / s.sensor_lag,
        }

    def too_warm(self, s: hm.Values) -> Value:
        """The sensor at or above the upper limit with the heater on."""
        return hm.least(s.reading - s.upper, s.heating - 0.5)

    def too_cold(self, s: hm.Values) -> Value:
        """The sensor at or below the lower limit with the heater off."""
        return hm.least(s.lower - s.reading, 0.5 - s.heating)

    def turn_off(self, s: hm.Values) -> dict[str, Value]:
        """Turn the heater off."""
        return {"heating": 0}

    def turn_on(self, s: hm.Values) -> dict[str, Value]:
        """Turn the heater on."""
        return {"heating": 1}

    transitions = (hm.Jump("off", too_warm, turn_off), hm.Jump("on", too_cold, turn_on))

"""A boost converter: switch, coil, diode and capacitor raise a voltage."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class BoostConverter(hm.HybridAutomaton):
    """Ideal boost converter with a fixed duty ratio; the diode blocks where the coil's current reaches zero.

    The circuit is affine in each mode, so every event has an exact time by matrix exponentials. The switch closes at
    ``k period`` and opens at ``(k + duty) period``, both computed from the index k. In continuous conduction the mean
    output voltage is ``source/(1 - duty)``, 48 V for the values below; in discontinuous conduction it is
    ``source (1 + sqrt(1 + 4 duty^2/K))/2`` with ``K = 2 inductance/(load period)``, both up to the ripple of the
    voltage, which relative to it is at most ``duty period/(load capacitance)`` in continuous conduction. Erickson,
    Maksimovic: Fundamentals of Power Electronics, sections 2.3 and 5.3.
    """

    CLOSED, CONDUCTING, BLOCKED = 0, 1, 2

    current = hm.State(0.0, unit="A", description="current through the coil", output=True)
    voltage = hm.State(24.0, unit="V", description="voltage of the capacitor and the load", output=True)
    mode = hm.DiscreteState(
        1, integer=True, description="0: switch closed, 1: open and diode conducting, 2: open and diode blocked"
    )
    k = hm.DiscreteState(0, integer=True, internal=True, description="number of the switching period")
    source = hm.Parameter(24.0, unit="V", description="input voltage")
    inductance = hm.Parameter(500e-6, unit="H", description="inductance of the coil")
    capacitance = hm.Parameter(100e-6, unit="F", description="capacitance of the output")
    load = hm.Parameter(20.0, unit="Ohm", description="resistance of the load")
    duty = hm.Parameter(0.5, description="part of each period with the switch closed, between 0 and 1")
    period = hm.Parameter(50e-6, unit="s", description="switching period")
    forward = hm.Parameter(
        1e-6, unit="V", description="voltage at which a blocked diode conducts again, above zero so that it can"
    )
    closing = hm.Clock("close", description="ticks when the switch closes")
    opening = hm.Clock("open", description="ticks when the switch opens")
    blocking = hm.Clock("block", description="ticks when the diode blocks")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Circuit equations of the three modes."""
        to_load = np.where(s.mode == self.CONDUCTING, 1.0, 0.0)
        through = np.where(s.mode == self.BLOCKED, 0.0, 1.0)
        return {
            "current": through * (s.source - to_load * s.voltage) / s.inductance,
            "voltage": (to_load * s.current - s.voltage / s.load) / s.capacitance,
        }

    def closes(self, s: hm.Values) -> Value:
        """Begin of the next period, once the switch is open."""
        return np.where(s.mode == self.CLOSED, np.inf, s.k * s.period)

    def opens(self, s: hm.Values) -> Value:
        """End of the part of the period with the switch closed."""
        return np.where(s.mode == self.CLOSED, (s.k - 1 + s.duty) * s.period, np.inf)

    def runs_dry(self, s: hm.Values) -> Value:
        """The diode conducts against a higher voltage, and no current is left."""
        return hm.least(-s.current, s.voltage - s.source, 0.5 - abs(s.mode - self.CONDUCTING))

    def is_overcome(self, s: hm.Values) -> Value:
        """The diode is blocked, and the output has fallen below the input's voltage."""
        return hm.least(s.source - s.forward - s.voltage, 0.5 - abs(s.mode - self.BLOCKED))

    def close(self, s: hm.Values) -> dict[str, Value]:
        """Close the switch, which short-circuits the coil to ground."""
        return {"mode": self.CLOSED, "k": s.k + 1}

    def open(self, s: hm.Values) -> dict[str, Value]:
        """Open the switch: the current goes on through the diode."""
        return {"mode": self.CONDUCTING}

    def block(self, s: hm.Values) -> dict[str, Value]:
        """Let the diode block; no current is left, whatever rounding says."""
        return {"mode": self.BLOCKED, "current": 0.0}

    def conduct(self, s: hm.Values) -> dict[str, Value]:
        """Let the diode conduct again."""
        return {"mode": self.CONDUCTING}

    transitions = (
        hm.TimeEvent("close", closes, close),
        hm.TimeEvent("open", opens, open),
        hm.Jump("block", runs_dry, block),
        hm.Jump("conduct", is_overcome, conduct),
    )

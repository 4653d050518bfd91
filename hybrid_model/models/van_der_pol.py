"""Van der Pol's oscillator, which relaxes slowly and swings back fast, with a jump each period that measures it."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class VanDerPol(hm.HybridAutomaton):
    """A relaxation oscillation, ``x'' = damping (1 - x^2) x' - x``, in seconds; a jump at each rise through a level.

    For a large ``damping`` the state creeps along a slow curve for most of the period and leaves it for a time of some
    1/damping: time scales that are ``damping^2`` apart. A run is stiff on the slow curve, with a transient at each end
    of it, on which the level lies.

    The period of the limit cycle is 6.6632868593231301897 s for ``damping = 1`` (C. M. Andersen, J. F. Geer, Power
    series expansions for the frequency and period of the limit cycle of the van der Pol equation, 1982), and
    ``(3 - 2 ln 2) damping + 7.01432 damping^(-1/3)`` s up to some ``ln(damping)/damping`` for large ones (A. A.
    Dorodnitsyn, 1947).
    """

    stiff = True

    x = hm.State(2.0, description="deflection", output=True)
    v = hm.State(0.0, unit="1/s", description="rate of the deflection", output=True)
    armed = hm.DiscreteState(0, integer=True, description="1 once the deflection has been low")
    last = hm.DiscreteState(0.0, unit="s", description="time of the last rise", output=True)
    period = hm.DiscreteState(0.0, unit="s", description="time between the last two rises", output=True)
    damping = hm.Parameter(1e3, unit="1/s", description="strength of the damping, negative at small deflections")
    level = hm.Parameter(1.0, description="deflection whose rises are noted")
    rises = hm.Clock("rise", description="ticks with each rise")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Damping that feeds small deflections and brakes large ones, and a spring."""
        return {"x": s.v, "v": s.damping * (1.0 - s.x**2) * s.v - s.x}

    def risen(self, s: hm.Values) -> Value:
        """The deflection at or above the level, having been low."""
        return hm.least(s.x - s.level, s.armed - 0.5)

    def fallen(self, s: hm.Values) -> Value:
        """The deflection as low as it was to be high."""
        return hm.least(-s.level - s.x, 0.5 - s.armed)

    def note(self, s: hm.Values) -> dict[str, Value]:
        """Note the time and the period."""
        return {"armed": 0, "period": s.t - s.last, "last": s.t}

    def arm(self, s: hm.Values) -> dict[str, Value]:
        """Wait for the next rise."""
        return {"armed": 1}

    transitions = (hm.Jump("rise", risen, note), hm.Jump("fall", fallen, arm))

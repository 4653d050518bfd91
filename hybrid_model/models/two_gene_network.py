"""Two genes that regulate each other, with hysteresis."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class TwoGeneNetwork(hm.HybridAutomaton):
    """Protein 1 activates gene 2, protein 2 represses gene 1; each acts as a switch with two thresholds.

    After Shu, Sanfelice: Dynamical properties of a two-gene network with hysteresis, Information and Computation 236
    (2014): ``x1' = k1 (1 - q2) - g1 x1``, ``x2' = k2 q1 - g2 x2``, and q_i turns to 1 where x_i reaches
    ``threshold_i + h_i`` and to 0 where it falls to ``threshold_i - h_i``. Between switches both concentrations are
    exponentials, so each switch has a closed form: x goes from a to b, with its target m, in ``ln((m - a)/(m - b))/g``.
    With thresholds between 0 and ``k_i/g_i`` the switches follow each other for ever in the order q1 on, q2 on,
    q1 off, q2 off, towards a limit cycle.
    """

    x1 = hm.State(0.6, description="concentration of protein 1", output=True)
    x2 = hm.State(0.3, description="concentration of protein 2", output=True)
    q1 = hm.DiscreteState(0, integer=True, description="1 while protein 1 acts", output=True)
    q2 = hm.DiscreteState(0, integer=True, description="1 while protein 2 acts", output=True)
    k1 = hm.Parameter(1.0, unit="1/s", description="production rate of protein 1")
    k2 = hm.Parameter(1.0, unit="1/s", description="production rate of protein 2")
    g1 = hm.Parameter(1.0, unit="1/s", description="degradation rate of protein 1")
    g2 = hm.Parameter(1.0, unit="1/s", description="degradation rate of protein 2")
    threshold1 = hm.Parameter(0.6, description="middle of the thresholds of protein 1")
    threshold2 = hm.Parameter(0.5, description="middle of the thresholds of protein 2")
    h1 = hm.Parameter(0.1, description="half the distance of the thresholds of protein 1")
    h2 = hm.Parameter(0.05, description="half the distance of the thresholds of protein 2")
    first_on = hm.Clock("q1_on", description="ticks when protein 1 begins to act")
    second_on = hm.Clock("q2_on", description="ticks when protein 2 begins to act")
    first_off = hm.Clock("q1_off", description="ticks when protein 1 ceases to act")
    second_off = hm.Clock("q2_off", description="ticks when protein 2 ceases to act")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Production while the gene is on, and degradation."""
        return {"x1": s.k1 * (1 - s.q2) - s.g1 * s.x1, "x2": s.k2 * s.q1 - s.g2 * s.x2}

    def much1(self, s: hm.Values) -> Value:
        """Protein 1 at or above its upper threshold, not yet acting."""
        return hm.least(s.x1 - s.threshold1 - s.h1, 0.5 - s.q1)

    def much2(self, s: hm.Values) -> Value:
        """Protein 2 at or above its upper threshold, not yet acting."""
        return hm.least(s.x2 - s.threshold2 - s.h2, 0.5 - s.q2)

    def little1(self, s: hm.Values) -> Value:
        """Protein 1 at or below its lower threshold, still acting."""
        return hm.least(s.threshold1 - s.h1 - s.x1, s.q1 - 0.5)

    def little2(self, s: hm.Values) -> Value:
        """Protein 2 at or below its lower threshold, still acting."""
        return hm.least(s.threshold2 - s.h2 - s.x2, s.q2 - 0.5)

    def switch1(self, s: hm.Values) -> dict[str, Value]:
        """Turn the other way."""
        return {"q1": 1 - s.q1}

    def switch2(self, s: hm.Values) -> dict[str, Value]:
        """Turn the other way."""
        return {"q2": 1 - s.q2}

    transitions = (
        hm.Jump("q1_on", much1, switch1),
        hm.Jump("q2_on", much2, switch2),
        hm.Jump("q1_off", little1, switch1),
        hm.Jump("q2_off", little2, switch2),
    )

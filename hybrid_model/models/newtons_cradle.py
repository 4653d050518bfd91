"""Newton's cradle: equal balls that pass momentum on in a cascade of impacts at one instant."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class NewtonsCradle(hm.HybridAutomaton):
    """Equal balls on pendula that touch at rest, with small swings: ``x'' = -rate**2 x``; impacts are elastic.

    An impact is a jump of one pair of neighbours, which exchange their velocities. A collision of the row is a cascade
    of such jumps at one t, the leftmost pair that is due first (rule 6). They sort the velocities, so the result does
    not depend on the order: k balls in, k balls out, after ``k (n - k)`` impacts among n balls. All balls meet at their
    rest positions, at ``pi/(2 rate)`` when they are let go from rest, and then every ``pi/rate``.

    Balls that touch at rest must not be in the jump set, or they would hit for ever. An impact therefore needs an
    approach faster than `resting_speed`. Balls closer than `touching` are in contact: rounding gives balls that swing
    together distances of some 1e-17 m, which must not tear a cascade apart. An impact is early by `touching` over the
    approach speed, and leaves the balls displaced by up to `touching`. With ``rate * touching < resting_speed`` balls
    that rest so do not hit, and no two overlap by more than ``2 touching + resting_speed/rate``, the flow set's border.

    One pair at a time is one of several impact laws for a row in contact; Glocker and Aeberhard compare them (The
    geometry of Newton's cradle, in Nonsmooth Mechanics and Analysis, 2006).
    """

    balls = hm.Dimension("number of balls, two or more")
    x = hm.State(0.0, shape="balls", unit="m", description="displacement of each ball to the right", output=True)
    v = hm.State(0.0, shape="balls", unit="m/s", description="velocity of each ball to the right", output=True)
    impacts = hm.DiscreteState(0, integer=True, description="number of impacts since the start", output=True)
    rate = hm.Parameter(10.0, unit="rad/s", description="angular frequency of the pendula, sqrt(g/length)")
    touching = hm.Parameter(1e-14, unit="m", description="balls closer than this are in contact")
    resting_speed = hm.Parameter(1e-11, unit="m/s", description="slower approaches in contact are no impacts")
    impact = hm.Clock("impact", description="ticks with each impact of two balls")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Pendula with small swings."""
        return {"x": s.v, "v": -(s.rate**2) * s.x}

    def flow_set(self, s: hm.Values) -> Value:
        """No ball overlaps the next, apart from what counts as rest in contact."""
        return np.min(s.x[1:] - s.x[:-1]) + 2.0 * s.touching + s.resting_speed / s.rate

    def pairs(self, s: hm.Values) -> Value:
        """Margin of each pair of neighbours: in contact, and approaching."""
        return np.minimum(s.touching - (s.x[1:] - s.x[:-1]), s.v[:-1] - s.v[1:] - s.resting_speed)

    def some_pair_hits(self, s: hm.Values) -> Value:
        """Whether any pair is due."""
        return np.max(self.pairs(s))

    def exchange(self, s: hm.Values) -> dict[str, Value]:
        """The leftmost pair that is due exchanges its velocities."""
        margins = self.pairs(s)
        # A crossing just behind the end of a flow counts as reached with a margin below zero: then the greatest is due.
        due = np.where(margins >= hm.least(np.max(margins), 0.0), 1.0, 0.0)
        first = due * np.where(np.add.accumulate(due) < 1.5, 1.0, 0.0)
        left, right = np.concatenate([first, [0.0]]), np.concatenate([[0.0], first])
        from_right, from_left = np.concatenate([s.v[1:], s.v[-1:]]), np.concatenate([s.v[:1], s.v[:-1]])
        v = np.where(left > 0.5, from_right, np.where(right > 0.5, from_left, s.v))
        return {"v": v, "impacts": s.impacts + 1}

    transitions = (hm.Jump("impact", some_pair_hits, exchange),)

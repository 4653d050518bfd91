"""Event generators: they hold the value last broadcast and decide when to broadcast anew (paper, section 4)."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.scenario.trigger import Threshold
from hybrid_model.declare.variables import Value


class EventGenerator(hm.HybridAutomaton):
    """What all event generators are to others: the state in, the broadcast value and the count of broadcasts out.

    The broadcast at the start, ``xhat(t0) = x(t0)``, is not counted as an event. The jump that broadcasts is called
    ``broadcast`` in every law.
    """

    x = hm.Input(0.0, description="state of the agent")
    broadcast = hm.DiscreteState(computed=True, output=True, description="value last broadcast")
    events = hm.DiscreteState(0, integer=True, output=True, description="number of broadcasts since the start")
    broadcast_clock = hm.Clock("broadcast", description="ticks with each broadcast")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first broadcast."""
        return {"broadcast": s.x}

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast the present state."""
        return {"broadcast": s.x, "events": s.events + 1}

    def error_bound(self, s: hm.Values) -> Threshold | None:
        """What the error never exceeds, from the parameters `s` of a law of one's own; None: nothing is promised."""
        return None

    def least_error(self, s: hm.Values) -> Threshold | None:
        """What the error has reached whenever a law of one's own broadcasts; None: nothing is promised."""
        return None


class ThresholdTrigger(EventGenerator):
    """Broadcasts when the error ``e = xhat - x`` reaches a threshold: ``f = |e| - threshold(t)`` (paper, section 4).

    The threshold is positive, so that the margin is negative after each broadcast, at consensus as well.
    """

    threshold = hm.Parameter(0.5, description="trigger threshold c")

    @abstractmethod
    def threshold_now(self, s: hm.Values) -> Value:
        """The threshold that the error is compared with."""

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""
        return np.abs(s.broadcast - s.x) - self.threshold_now(s)

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)


class StaticTrigger(ThresholdTrigger):
    """Event generator with a constant threshold c (paper, equation of the static trigger function)."""

    def threshold_now(self, s: hm.Values) -> Value:
        """``c``."""
        return Threshold(s.threshold).at(s.t)


class DynamicTrigger(ThresholdTrigger):
    """Event generator with the threshold ``c exp(-beta t)`` (paper, equation of the dynamic trigger function)."""

    decay = hm.Parameter(0.06, unit="1/s", description="decay rate beta of the threshold")

    def threshold_now(self, s: hm.Values) -> Value:
        """``c exp(-beta t)``."""
        return Threshold(s.threshold, s.decay).at(s.t)


class MixedTrigger(DynamicTrigger):
    """Event generator with the threshold ``c0 + c1 exp(-beta t)``.

    G. S. Seyboth, D. V. Dimarogonas, K. H. Johansson, "Event-based broadcasting for multi-agent average consensus",
    Automatica 49 (2013) 245-252. The radius is that of the static trigger with c0; by linearity the rest adds a
    transient that decays as with the dynamic trigger (audit, section 11.1).
    """

    offset = hm.Parameter(0.1, description="threshold c0 that stays")

    def threshold_now(self, s: hm.Values) -> Value:
        """``c0 + c1 exp(-beta t)``."""
        return Threshold(s.threshold, s.decay, s.offset).at(s.t)

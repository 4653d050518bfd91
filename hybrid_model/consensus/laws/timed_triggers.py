"""Triggers that look at the state, or send it, at times fixed in advance."""

from __future__ import annotations

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import dwell_boundary, dwell_index
from hybrid_model.consensus.laws.threshold_triggers import EventGenerator
from hybrid_model.consensus.scenario.trigger import Threshold
from hybrid_model.declare.variables import Value


class SampledTrigger(EventGenerator):
    """The dynamic trigger looked at every `period` only: periodic event-triggered broadcasting.

    At the times ``m period`` the state is sampled; if ``|xhat - x| >= c exp(-beta t)`` there, the sample is broadcast
    at that instant. X. Meng, T. Chen, "Event based agreement protocols for multi-agent networks", Automatica 49 (2013)
    2125-2132. Between two checks the error may pass the threshold, so c in the bounds becomes the c' of the fixed point
    in audit, section 11.7.

    Between checks the margin is a constant, made of the sample and of the threshold at its time.
    """

    threshold = hm.Parameter(0.5, description="trigger threshold c")
    decay = hm.Parameter(0.0, unit="1/s", description="decay rate beta of the threshold")
    period = hm.Parameter(0.1, unit="s", description="time between two checks")
    sample = hm.DiscreteState(computed=True, description="state at the last check")
    checks = hm.DiscreteState(0, integer=True, computed=True, description="index of the last check")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first broadcast, and the index of the check at the start or before it."""
        return {**super().start_map(s), "sample": s.x, "checks": dwell_index(s.t, s.period)}

    def next_check(self, s: hm.Values) -> Value:
        """Time of the next check."""
        return dwell_boundary(s.checks, s.period)

    def check(self, s: hm.Values) -> dict[str, Value]:
        """Sample the state."""
        return {"sample": s.x, "checks": s.checks + 1}

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function at the last check."""
        checked = dwell_boundary(s.checks - 1, s.period)
        return np.abs(s.broadcast - s.sample) - Threshold(s.threshold, s.decay).at(checked)

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast the sample; the jump follows the check at the same instant."""
        return {"broadcast": s.sample, "events": s.events + 1}

    transitions = (hm.TimeEvent("check", next_check, check), hm.Jump("broadcast", error_too_large, send))


class PeriodicBroadcast(EventGenerator):
    """The baseline without a trigger: a broadcast at each of the times ``m period``.

    Event-triggered laws are measured against it. At equal average rate it can be the better one for integrators
    (Meister et al. 2022, 2023).
    """

    period = hm.Parameter(0.1, unit="s", description="time between two broadcasts")
    index = hm.DiscreteState(0, integer=True, internal=True, computed=True, description="index of the last broadcast")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first broadcast, and the index of the time that it has in the schedule."""
        return {**super().start_map(s), "index": dwell_index(s.t, s.period)}

    def next_broadcast(self, s: hm.Values) -> Value:
        """Time of the next broadcast."""
        return dwell_boundary(s.index, s.period)

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast the present state."""
        return {**super().send(s), "index": s.index + 1}

    transitions = (hm.TimeEvent("broadcast", next_broadcast, send),)

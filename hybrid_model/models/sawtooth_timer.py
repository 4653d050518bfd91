"""A timer that ramps up and starts over: once by a guard on its state, once by a schedule."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class SawtoothTimer(hm.HybridAutomaton):
    """A timer with ``elapsed' = 1`` that is set back to zero when it reaches its period: a jump on the state.

    Started at zero at time 0 it expires at ``k period``, k = 1, 2, ...; `ScheduledSawtoothTimer` is the same signal
    with jumps on time. A timer as a state is how Goebel, Sanfelice and Teel (Hybrid Dynamical Systems, 2012) put time
    into the flow and jump sets.
    """

    elapsed = hm.State(0.0, unit="s", description="time since the timer last expired", output=True)
    expiries = hm.DiscreteState(0, integer=True, description="how often the timer has expired", output=True)
    period = hm.Parameter(1.0, unit="s", description="time between expiries")
    expired = hm.Clock("expire", description="ticks when the timer expires")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Time passes."""
        return {"elapsed": 1.0}

    def flow_set(self, s: hm.Values) -> Value:
        """Between zero and the period."""
        return hm.least(s.elapsed, s.period - s.elapsed)

    def at_period(self, s: hm.Values) -> Value:
        """At the period."""
        return s.elapsed - s.period

    def start_over(self, s: hm.Values) -> dict[str, Value]:
        """Start at zero again."""
        return {"elapsed": 0.0, "expiries": s.expiries + 1}

    transitions = (hm.Jump("expire", at_period, start_over),)


class ScheduledSawtoothTimer(hm.HybridAutomaton):
    """The signal of `SawtoothTimer` with its expiries as time events, computed from their number.

    Expiry k + 1 is at ``begin + (k + 1) period``, with the time `begin` at which the timer would have been zero. No
    rounding adds up over the expiries.
    """

    elapsed = hm.State(0.0, unit="s", description="time since the timer last expired", output=True)
    expiries = hm.DiscreteState(0, integer=True, description="how often the timer has expired", output=True)
    begin = hm.DiscreteState(computed=True, internal=True, unit="s", description="time at which the timer was zero")
    period = hm.Parameter(1.0, unit="s", description="time between expiries")
    expired = hm.Clock("expire", description="ticks when the timer expires")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The schedule that fits the timer's start value."""
        return {"begin": s.t - s.elapsed}

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Time passes."""
        return {"elapsed": 1.0}

    def next_expiry(self, s: hm.Values) -> Value:
        """The time of the next expiry."""
        return s.begin + (s.expiries + 1) * s.period

    def start_over(self, s: hm.Values) -> dict[str, Value]:
        """Start at zero again."""
        return {"elapsed": 0.0, "expiries": s.expiries + 1}

    transitions = (hm.TimeEvent("expire", next_expiry, start_over),)

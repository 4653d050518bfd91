"""Rule 7: jumps that enable each other at one instant are bounded, and all of them are named, in both engines alike."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System


class Ring(hm.HybridAutomaton):
    """From t = 1 on each jump enables the next one, and the last the first."""

    k = hm.DiscreteState(0, integer=True, output=True)

    def margin(self, s, place):
        return np.where(s.t < 1.0, s.t - 1.0, 0.5 - abs(s.k - place))

    transitions = (
        hm.Jump("red", lambda self, s: self.margin(s, 0), lambda self, s: {"k": 1}),
        hm.Jump("green", lambda self, s: self.margin(s, 1), lambda self, s: {"k": 2}),
        hm.Jump("blue", lambda self, s: self.margin(s, 2), lambda self, s: {"k": 0}),
    )


class PingPong(hm.HybridAutomaton):
    """Two jumps that enable each other from the start."""

    side = hm.DiscreteState(0, integer=True, output=True)

    transitions = (
        hm.Jump("ping", lambda self, s: 0.5 - s.side, lambda self, s: {"side": 1}),
        hm.Jump("pong", lambda self, s: s.side - 0.5, lambda self, s: {"side": 0}),
    )


class ByTime(hm.HybridAutomaton):
    """A time event and a jump on state that make each other due at t = 0.5."""

    side = hm.DiscreteState(0, integer=True, output=True)

    def due(self, s):
        return np.where(s.side < 0.5, 0.5, np.inf)

    def tick(self, s):
        return {"side": 1}

    def back(self, s):
        return s.side - 0.5

    def answer(self, s):
        return {"side": 0}

    transitions = (hm.TimeEvent("tick", due, tick), hm.Jump("answer", back, answer))


class ByBreakpoint(ByTime):
    """The same with a breakpoint of the flow."""

    transitions = (
        hm.TimeEvent("tick", ByTime.due, ByTime.tick, internal=True),
        hm.Jump("answer", ByTime.back, ByTime.answer),
    )


CYCLES = {
    "PingPong": (
        PingPong,
        ["1001 jumps of 'ping' at one instant, t = 0 s, in turn with 'pong': they enable each other"],
    ),
    "Ring": (
        Ring,
        ["1001 jumps of 'red' at one instant, t = 1 s, in turn with 'green', 'blue': they enable each other"],
    ),
    "ByTime": (
        ByTime,
        ["1001 jumps of 'tick' at one instant, t = 0.5 s, in turn with 'answer': they enable each other"],
    ),
    # The engine in C takes breakpoints inside the flow, and counts what is seen from outside.
    "ByBreakpoint": (
        ByBreakpoint,
        ["1001 jumps of ", "'tick'", "'answer'", "t = 0.5 s, in turn with ", "they enable each other"],
    ),
}


def run_by_fmu(exported, automaton, t_end):
    """How a run of the engine in C ends."""
    try:
        return run_event_exact(
            System([FmuSlave("a", exported(automaton, f"cycle_{automaton.name}"))], {}), t_end
        ).message
    except CosimError as refused:  # what is due at the start is taken when initialization ends
        return str(refused)


@pytest.mark.parametrize("name", CYCLES)
def test_all_jumps_of_a_cycle_are_named(name, exported):
    automaton, words = CYCLES[name]
    arc = hm.simulate(automaton(), 2.0)
    assert arc.stop is hm.Stop.ZENO
    message = run_by_fmu(exported, automaton(), 2.0)
    for word in [*words, "leave the jump sets of the others"]:
        assert word in arc.message
        assert word in message


def test_what_came_before_at_the_same_instant_is_not_named():
    """A jump that is taken once and begins the cycle is no part of it, with a bound of few jumps as well."""

    class Started(hm.HybridAutomaton):
        side = hm.DiscreteState(-1, integer=True)

        transitions = (
            hm.Jump("begin", lambda self, s: -0.5 - s.side, lambda self, s: {"side": 0}),
            hm.Jump("ping", lambda self, s: 0.5 - abs(s.side), lambda self, s: {"side": 1}),
            hm.Jump("pong", lambda self, s: s.side - 0.5, lambda self, s: {"side": 0}),
        )

    for guard in (hm.ZenoGuard(), hm.ZenoGuard(jumps_at_once=3)):
        arc = hm.simulate(Started(), 1.0, zeno=guard)
        assert "'ping' at one instant, t = 0 s, in turn with 'pong': " in arc.message
        assert len(arc.jumps) == 2 * guard.jumps_at_once + 2


def test_a_jump_that_enables_itself_is_named_alone():
    class Restless(hm.HybridAutomaton):
        n = hm.DiscreteState(0, integer=True)

        def jump_set(self, s):
            return s.t - 0.5

        def jump_map(self, s):
            return {"n": s.n + 1}

    message = hm.simulate(Restless(), 1.0).message
    assert (
        "1001 jumps of 'jump' at one instant, t = 0.5 s: after the jump the state is still in the jump set" in message
    )

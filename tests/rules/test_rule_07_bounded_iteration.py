"""Rule 7: jumps at one instant are bounded; the message names the automaton, the jump and the time."""

import pytest
from small_automata import Ramp, Timer

import hybrid_model as hm


class Restless(hm.HybridAutomaton):
    """From t = 1.5 on it is always in its jump set."""

    n = hm.DiscreteState(0, integer=True)

    def jump_set(self, s):
        return s.t - 1.5

    def jump_map(self, s):
        return {"n": s.n + 1}


def test_a_jump_that_never_leaves_its_jump_set_is_stopped():
    arc = hm.simulate(Restless(), 3.0)
    assert arc.stop is hm.Stop.ZENO
    assert len(arc.jumps) == hm.ZenoGuard().jumps_at_once + 1
    assert {jump.t for jump in arc.jumps} == {1.5}
    for word in ("Restless", "'jump'", "t = 1.5 s", "1001 jumps", "leave the jump set"):
        assert word in arc.message


def test_the_bound_is_an_option():
    arc = hm.simulate(Restless(), 3.0, zeno=hm.ZenoGuard(jumps_at_once=7))
    assert len(arc.jumps) == 8


def test_a_cascade_up_to_the_bound_is_allowed():
    class Countdown(Restless):
        def jump_set(self, s):
            return 999.5 - s.n

    arc = hm.simulate(Countdown(), 1.0)
    assert arc.stop is hm.Stop.HORIZON
    assert arc.end.n == 1000


def test_two_jumps_that_enable_each_other_for_ever_are_stopped():
    class PingPong(hm.HybridAutomaton):
        side = hm.DiscreteState(0, integer=True)

        transitions = (
            hm.Jump("ping", lambda self, s: 0.5 - s.side, lambda self, s: {"side": 1}),
            hm.Jump("pong", lambda self, s: s.side - 0.5, lambda self, s: {"side": 0}),
        )

    arc = hm.simulate(PingPong(), 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert len(arc.jumps) <= 2 * (hm.ZenoGuard().jumps_at_once + 1)


def test_two_parts_that_enable_each_other_for_ever_are_stopped_and_named():
    class Echo(hm.HybridAutomaton):
        heard = hm.Input(0.0, discrete=True)
        value = hm.DiscreteState(0.0, output=True)

        def jump_set(self, s):
            return s.heard - s.value

        def jump_map(self, s):
            return {"value": s.heard + 1.0}

    pair = hm.Composition("pair", {"a": Echo(), "b": Echo()}, {"a.heard": "b.value", "b.heard": "a.value"})
    arc = hm.simulate(pair, 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert "pair" in arc.message
    assert "a.jump" in arc.message or "b.jump" in arc.message


def test_time_events_that_catch_up_without_end_are_bounded_too():
    arc = hm.simulate(Timer(first=-1e9), 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert len(arc.jumps) == hm.ZenoGuard().jumps_at_once + 1
    for word in ("Timer", "'tick'", "t = 0 s", "move the time on"):
        assert word in arc.message


def test_many_parts_that_jump_together_are_no_accumulation():
    parts = {f"p{k}": Ramp() for k in range(30)}
    arc = hm.simulate(hm.Composition("row", parts), 2.1, zeno=hm.ZenoGuard(jumps_at_once=2, jumps_in_window=10))
    assert arc.stop is hm.Stop.HORIZON
    assert len(arc.jumps) == 30 * 4


@pytest.mark.parametrize("trigger_at_consensus", [0.0, -0.0])
def test_a_trigger_whose_two_sides_are_zero_is_stopped_with_that_explanation(trigger_at_consensus):
    """The static trigger e^2 >= sigma u^2 at consensus: 0 >= 0 for ever."""

    class RelativeTrigger(hm.HybridAutomaton):
        x = hm.State(0.0)
        held = hm.DiscreteState(0.0)

        def flow_map(self, s):
            return {"x": -s.held}

        def jump_set(self, s):
            return (s.held - s.x) ** 2 - 0.1 * s.held**2 + trigger_at_consensus

        def jump_map(self, s):
            return {"held": s.x}

    arc = hm.simulate(RelativeTrigger(), 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert "a threshold that is zero together with its error fires for ever" in arc.message

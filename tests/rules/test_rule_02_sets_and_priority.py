"""Rule 2: sets are {margin >= 0}; the priority decides where they overlap; leaving both ends the run with a reason."""

import pytest
from small_automata import Corridor, PatientCorridor

import hybrid_model as hm

# The flow is x' = 1, exact for every Runge-Kutta method up to rounding; x is near 1.
ROUNDING = 1e-13


def test_jump_priority_jumps_where_the_sets_begin_to_overlap():
    arc = hm.simulate(Corridor(), 2.5)
    assert [jump.t for jump in arc.jumps] == pytest.approx([1.0, 2.0], abs=ROUNDING)


def test_flow_priority_flows_to_the_end_of_the_flow_set():
    arc = hm.simulate(PatientCorridor(), 4.5)
    assert [jump.t for jump in arc.jumps] == pytest.approx([2.0, 4.0], abs=ROUNDING)


def test_flow_priority_starts_inside_the_jump_set_and_flows():
    arc = hm.simulate(PatientCorridor(x=1.5), 0.75)
    assert [jump.t for jump in arc.jumps] == pytest.approx([0.5], abs=ROUNDING)


def test_flow_priority_jumps_from_outside_the_flow_set_at_once():
    arc = hm.simulate(PatientCorridor(x=3.0), 0.5)
    assert [jump.t for jump in arc.jumps] == [0.0]


def test_jump_priority_jumps_at_once_from_the_overlap():
    arc = hm.simulate(Corridor(x=1.5), 0.5)
    assert [jump.t for jump in arc.jumps] == [0.0]


def test_flow_priority_jumps_where_both_sets_share_only_their_border():
    arc = hm.simulate(PatientCorridor(door=2.0), 2.5)
    assert [jump.t for jump in arc.jumps] == pytest.approx([2.0], abs=ROUNDING)


def test_flow_priority_finds_the_jump_although_rounding_puts_its_border_after_the_end_of_the_flow_set():
    # Far less than the location tolerance apart: the same border to a person, two to the processor.
    arc = hm.simulate(PatientCorridor(door=2.0 + 1e-12), 2.5)
    assert [jump.t for jump in arc.jumps] == pytest.approx([2.0], abs=1e-9)


def test_jump_priority_finds_the_jump_just_after_a_steep_end_of_the_flow_set():
    class Steep(Corridor):
        def flow_set(self, s):
            return 1e6 * (s.wall - s.x)

    arc = hm.simulate(Steep(door=2.0 + 1e-12), 2.5)
    assert [jump.t for jump in arc.jumps] == pytest.approx([2.0], abs=1e-9)


@pytest.mark.parametrize("corridor", [Corridor, PatientCorridor])
def test_leaving_both_sets_is_blocked_and_told_with_the_values(corridor):
    arc = hm.simulate(corridor(door=3.0, back=0.25), 10.0)
    assert arc.stop is hm.Stop.BLOCKED
    # The flow set may be overstepped by 1e-9 of the state's size, at speed 1.
    assert arc.t[-1] == pytest.approx(2.0, rel=2e-9)
    assert corridor.__name__ in arc.message
    assert "t = 2" in arc.message
    assert "x = 2" in arc.message
    assert "margin of the flow set" in arc.message
    assert "Enlarge" in arc.message
    assert arc.jumps == []


@pytest.mark.parametrize("corridor", [Corridor, PatientCorridor])
def test_a_start_outside_both_sets_is_blocked_at_once(corridor):
    arc = hm.simulate(corridor(x=2.5, door=3.0), 10.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] == 0.0
    assert "x = 2.5" in arc.message
    assert "margin of the flow set -0.5" in arc.message


@pytest.mark.parametrize("corridor", [Corridor, PatientCorridor])
def test_a_jump_that_lands_outside_both_sets_is_blocked(corridor):
    arc = hm.simulate(corridor(wall=1.0, door=1.0, back=0.9), 10.0, zeno=hm.ZenoGuard(jumps_at_once=5))
    assert arc.stop is hm.Stop.HORIZON

    class Wild(corridor):
        def jump_set(self, s):
            return hm.least(s.x - s.door, 1.5 - s.x)

    arc = hm.simulate(Wild(wall=1.0, door=1.0, back=7.0), 10.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert len(arc.jumps) == 1
    assert "x = 7" in arc.message


def test_a_jump_at_the_end_time_that_lands_outside_both_sets_is_blocked_too():
    class Wild(hm.HybridAutomaton):
        x = hm.State(0.0)
        done = hm.DiscreteState(0, integer=True)

        def flow_map(self, s):
            return {"x": 0.0}

        def flow_set(self, s):
            return 1.0 - s.x

        def next_time(self, s):
            return 1.0 + s.done * 10.0

        def leap(self, s):
            return {"x": 5.0, "done": 1}

        transitions = (hm.TimeEvent("leap", next_time, leap),)

    arc = hm.simulate(Wild(), 1.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert "x = 5" in arc.message


def test_the_border_belongs_to_both_sets():
    assert hm.simulate(Corridor(wall=1.0, door=3.0, x=1.0), 0.0).stop is hm.Stop.HORIZON
    assert len(hm.simulate(Corridor(x=1.0), 0.0).jumps) == 1


def test_intersection_is_least_and_union_is_greatest():
    assert (hm.least(1.0, -2.0, 3.0), hm.greatest(1.0, -2.0, 3.0)) == (-2.0, 3.0)


def test_horizon_message_names_automaton_and_time():
    arc = hm.simulate(Corridor(), 0.5)
    assert arc.stop is hm.Stop.HORIZON
    assert "Corridor" in arc.message
    assert "t = 0.5" in arc.message

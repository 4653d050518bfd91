"""Rule 3: a guard is crossed on (t0, t1]; right after every jump, and at the start, the state is tested."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from small_automata import Alarm, Corridor, PatientCorridor, Ramp, Timer

import hybrid_model as hm
from hybrid_model.models import BouncingBall


@pytest.mark.parametrize("max_step", [0.25, 0.1, 1.0 / 3.0])
def test_a_zero_at_the_end_of_a_step_fires_once(max_step):
    # With steps of 1/4 the zero at t = 1 is the end of a step, exactly.
    arc = hm.simulate(Alarm.of(lambda t: t - 1.0), 2.0, solver=hm.Solver(max_step=max_step))
    assert list(arc.event_times("ring")) == [1.0]


def test_a_zero_at_the_end_of_the_run_fires_once():
    arc = hm.simulate(Alarm.of(lambda t: t - 1.0), 1.0)
    assert list(arc.event_times("ring")) == [1.0]
    assert arc.stop is hm.Stop.HORIZON


def test_a_zero_at_the_end_of_a_flow_that_a_timer_ends_fires_once():
    loop = hm.Composition("both", {"timer": Timer(first=1.0), "alarm": Alarm.of(lambda t: t - 1.0)})
    arc = hm.simulate(loop, 1.5)
    assert [(jump.name, jump.t) for jump in arc.jumps] == [("timer.tick", 1.0), ("alarm.ring", 1.0)]


def test_a_zero_at_the_start_is_a_state_in_the_jump_set():
    arc = hm.simulate(Alarm.of(lambda t: t), 1.0)
    assert list(arc.event_times("ring")) == [0.0]


def test_a_zero_left_behind_by_a_jump_does_not_fire_again():
    # The ball after an impact: h = 0 is a zero of one margin, v > 0 keeps the ball out of the jump set.
    arc = hm.simulate(BouncingBall(), 1.0)
    assert len(arc.jumps) == 1


def test_a_state_still_in_the_jump_set_after_a_jump_jumps_again_at_the_same_t():
    class Stairs(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def jump_set(self, s):
            return s.x - 1.0

        def jump_map(self, s):
            return {"x": 3.0 - s.x if s.x < 1.5 else 0.0}

    arc = hm.simulate(Stairs(), 1.5)
    assert [jump.j for jump in arc.jumps] == [0, 1]
    assert arc.jumps[0].t == arc.jumps[1].t
    assert arc.jumps[1].x_before[0] == pytest.approx(2.0, abs=1e-12)


def test_a_margin_that_falls_through_zero_does_not_fire():
    arc = hm.simulate(Corridor(x=0.5, wall=10.0, door=-5.0, back=-6.0), 0.0)
    assert len(arc.jumps) == 1  # at the start: in the jump set

    class Falling(Corridor):
        def flow_map(self, s):
            return {"x": -1.0}

        def jump_set(self, s):
            return hm.least(s.x - s.door, -s.x)

    # x falls from 3 through the door at 1: least(x - 1, -x) stays negative throughout.
    assert hm.simulate(Falling(x=3.0, wall=10.0), 5.0).jumps == []


def test_a_guard_on_one_direction_fires_only_in_it():
    # sin t rises through zero at 2 pi, 4 pi and falls through it at pi, 3 pi.
    arc = hm.simulate(Alarm.of(np.sin), 14.0, t_start=0.5)
    assert arc.event_times("ring")[0] == 0.5  # it starts in the jump set
    assert arc.event_times("ring")[1:] == pytest.approx([2 * np.pi, 4 * np.pi], abs=1e-12)


def test_a_state_outside_the_flow_set_by_less_than_the_tolerance_counts_as_inside():
    class Wall(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 0.0}

        def flow_set(self, s):
            return s.size - s.x

        size = hm.Parameter(1.0)

    for size in (1e-20, 1.0, 1e20):
        inside, outside = (Wall(x=size * (1.0 + part), size=size) for part in (0.5e-9, 2e-9))
        assert hm.simulate(inside, 1.0).stop is hm.Stop.HORIZON
        assert hm.simulate(outside, 1.0).stop is hm.Stop.BLOCKED
    assert hm.simulate(Wall(x=1.0 + 2e-9), 1.0, solver=hm.Solver(event_tolerance=1e-8)).stop is hm.Stop.HORIZON


@pytest.mark.parametrize("corridor", [Corridor, PatientCorridor])
def test_a_state_just_outside_that_flows_further_out_is_blocked_and_does_not_fall_through(corridor):
    arc = hm.simulate(corridor(x=2.0 + 0.5e-9, door=9.0), 1.0)
    assert arc.stop is hm.Stop.BLOCKED
    # By 1e-9 of the size of the state, twice: once as it is, once where the flow set is seen to be left.
    assert arc.end.x < 2.0 * (1.0 + 2e-9)


def test_under_flow_priority_rounding_at_the_border_of_a_large_set_does_not_block():
    class Circle(hm.HybridAutomaton):
        """Turns on the border of its flow set: the margin is rounding noise of 1e-10 about zero."""

        priority = hm.Priority.FLOW
        x = hm.State(1e3)
        y = hm.State(0.0)

        def flow_map(self, s):
            return {"x": -s.y, "y": s.x}

        def flow_set(self, s):
            return (1e6 - s.x**2 - s.y**2) / 1e3

    assert hm.simulate(Circle(), 1.0, solver=hm.Solver(event_tolerance=1e-6)).stop is hm.Stop.HORIZON


class ToAndFro(hm.HybridAutomaton):
    """Turns where it would leave its flow set, also where rounding has put it just outside."""

    priority = hm.Priority.FLOW
    x = hm.State(0.0, output=True)
    direction = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"x": s.direction * (1.0 + 0.2 * np.cos(s.t))}

    def flow_set(self, s):
        return 1.0 - np.abs(s.x)

    def jump_set(self, s):
        return np.abs(s.x) - 0.5

    def jump_map(self, s):
        return {"direction": -s.direction}


@pytest.mark.parametrize("start", [0.0, -1.0, 1.0 - 1e-16, -1.0 + 3e-16, -1.0 - 3e-10])
def test_a_flow_that_begins_outside_by_rounding_ends_where_it_leaves_the_flow_set(start):
    """The way t + 0.2 sin(t) is a whole number of turns."""
    arc = hm.simulate(ToAndFro(x=start), 12.0)
    ways = np.array([1.0 - start + 2.0 * k for k in range(6)])
    times = [brentq(lambda t, way=way: t + 0.2 * np.sin(t) - way, -1.0, 15.0, xtol=1e-15) for way in ways]
    times = [t for t in times if 1e-9 < t < 12.0]
    assert [jump.t for jump in arc.jumps if jump.t > 1e-9] == pytest.approx(times, abs=2e-9)
    assert np.abs(arc["x"]).max() < 1.0 + 1e-9


def test_the_tolerance_is_in_the_result():
    assert hm.simulate(Ramp(), 0.1, solver=hm.Solver(event_tolerance=1e-7)).event_tolerance == 1e-7


@settings(max_examples=60, deadline=None)
@given(
    zero=st.fractions(min_value=0, max_value=4, max_denominator=16).map(float),
    steps=st.integers(min_value=1, max_value=40),
)
def test_each_rise_on_a_grid_of_steps_fires_exactly_once(zero, steps):
    arc = hm.simulate(Alarm.of(lambda t: t - zero), 4.0, solver=hm.Solver(max_step=4.0 / steps))
    assert arc.event_times("ring") == pytest.approx([zero], abs=4e-15)

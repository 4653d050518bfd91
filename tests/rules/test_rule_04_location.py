"""Rule 4: located times are the first point at which the margin is >= 0; two crossings in one step are found."""

import math

import numpy as np
import pytest
from small_automata import Alarm, Ramp

import hybrid_model as hm
from hybrid_model.models import BouncingBall

ALL_METHODS = list(hm.Method)


@pytest.mark.parametrize("centre", [0.05, 0.5, 1.7, 3.3, 3.98])
def test_a_margin_that_comes_up_and_goes_down_within_one_step_is_found(centre):
    # The state is a straight line, so the solver's steps grow to the whole run; the pulse is 0.02 s long.
    arc = hm.simulate(Alarm.of(lambda t: 1e-4 - (t - centre) ** 2), 4.0)
    assert arc.event_times("ring") == pytest.approx([centre - 0.01], abs=1e-13)


def test_even_crossings_of_one_step():
    arc = hm.simulate(Alarm.of(lambda t: -(t - 0.4) * (t - 0.6)), 1.0)
    assert arc.event_times("ring") == pytest.approx([0.4], abs=1e-14)
    assert arc.event_times("arm") == pytest.approx([0.6], abs=1e-11)


def test_every_rise_of_a_wave_is_found():
    # Samples at most 0.2/9 s apart, and the wave 0.157 s long: within the documented bound.
    arc = hm.simulate(Alarm.of(lambda t: math.sin(40.0 * t + 3.5)), 10.0, solver=hm.Solver(max_step=0.2))
    rises = (2.0 * math.pi * np.arange(1, 200) - 3.5) / 40.0
    assert arc.event_times("ring") == pytest.approx(rises[rises <= 10.0], abs=1e-13)


@pytest.mark.parametrize("method", ALL_METHODS)
def test_first_impact_by_every_method(method):
    loose = {hm.Method.RADAU: 1e-9, hm.Method.BDF: 1e-9}.get(method, 1e-12)
    arc = hm.simulate(BouncingBall(), 0.5, solver=hm.Solver(method=method, rtol=loose, atol=loose))
    # A parabola is exact for the one-step methods; the multistep ones start with order 1 at a small step.
    tolerance = {hm.Method.BDF: 1e-6, hm.Method.LSODA: 1e-7}.get(method, 1e-12)
    assert arc.jumps[0].t == pytest.approx(math.sqrt(2.0 / 9.81), abs=tolerance)
    assert arc.jumps[0].x_before[1] == pytest.approx(-math.sqrt(2.0 * 9.81), abs=10 * tolerance)
    assert arc["h"].min() >= -tolerance
    # Samples are copies of the solver's state, not views of what it goes on to overwrite.
    t = arc.t[arc.j == 0]
    assert arc["h"][arc.j == 0] == pytest.approx(1.0 - 9.81 / 2 * t**2, abs=tolerance)


def test_the_located_state_is_in_the_jump_set():
    arc = hm.simulate(Ramp(rate=0.3, threshold=0.1), 3.0)
    # The ninth crossing is at the end time up to rounding: it counts (rule 6), and alone may lie a rounding below.
    assert len(arc.jumps) == 9
    assert abs(arc.jumps[-1].x_before[0] - arc.jumps[-1].z_before[0]) >= 0.1 - 0.3 * arc.event_tolerance
    for jump in arc.jumps[:-1]:
        assert abs(jump.x_before[0] - jump.z_before[0]) >= 0.1


def test_a_stiff_flow_by_radau():
    """x' = -1000 (x - cos t): after the layer x follows cos t to 1e-3 and crosses 1/2 near pi/3."""

    class Stiff(hm.HybridAutomaton):
        x = hm.State(2.0)
        low = hm.DiscreteState(0)

        def flow_map(self, s):
            return {"x": -1000.0 * (s.x - np.cos(s.t))}

        def jump_set(self, s):
            return hm.least(0.5 - s.x, 0.5 - s.low)

        def jump_map(self, s):
            return {"low": 1}

    arc = hm.simulate(Stiff(), 2.0, solver=hm.Solver(method=hm.Method.RADAU, rtol=1e-8, atol=1e-10))
    # Particular solution: (a^2 cos t + a sin t)/(1 + a^2) with a = 1000; the layer exp(-1000 t) is gone.
    angle = math.atan2(1.0, 1000.0)
    exact = angle + math.acos(0.5 * math.sqrt(1.0 + 1e-6))
    assert [jump.t for jump in arc.jumps] == pytest.approx([exact], abs=1e-7)
    assert len(arc.t) < 500  # an explicit method needs 2/3.3e-3 steps at least; stiff steps are few


def test_times_near_a_large_start_are_located_to_its_ulp():
    arc = hm.simulate(Ramp(), 1e6 + 1.1, t_start=1e6)
    assert [jump.t for jump in arc.jumps] == pytest.approx([1e6 + 0.5, 1e6 + 1.0], abs=1e-9)


def test_a_guard_disabled_by_minus_infinity():
    class Switched(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def jump_set(self, s):
            return np.where(s.t >= 0.5, s.x - 0.25, -np.inf)

        def jump_map(self, s):
            return {"x": -10.0}

    arc = hm.simulate(Switched(), 1.0)
    assert [jump.t for jump in arc.jumps] == pytest.approx([0.5], abs=1e-15)


def test_without_continuous_states_guards_on_time_are_located():
    class Clockwork(hm.HybridAutomaton):
        n = hm.DiscreteState(1, integer=True)

        def jump_set(self, s):
            return s.t - 0.3 * s.n

        def jump_map(self, s):
            return {"n": s.n + 1}

    arc = hm.simulate(Clockwork(), 1.0)
    assert [jump.t for jump in arc.jumps] == pytest.approx([0.3, 0.6, 0.9], abs=4e-16)


def test_without_anything_a_run_reaches_its_end():
    class Nothing(hm.HybridAutomaton):
        pass

    arc = hm.simulate(Nothing(), 3.0)
    assert (arc.stop, arc.t[-1], arc.jumps) == (hm.Stop.HORIZON, 3.0, [])


def test_a_larger_tolerance_does_not_move_a_lone_crossing():
    times = [
        hm.simulate(Ramp(rate=0.3), 2.0, solver=hm.Solver(event_tolerance=tol)).jumps[0].t for tol in (1e-12, 1e-6)
    ]
    assert times[0] == times[1]

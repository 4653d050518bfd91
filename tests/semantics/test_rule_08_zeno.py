"""Rule 8: a run that accumulates jumps stops with Stop.ZENO, the accumulation time and the remedy."""

import re

import numpy as np
import pytest
from small_automata import Ramp, Timer

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat


def zeno_time(height, e, g=9.81):
    """Sum of the geometric series of flight times of a ball dropped from `height`."""
    return np.sqrt(2.0 * height / g) * (1.0 + e) / (1.0 - e)


def told_time(message):
    return float(re.search(r"t = ([-+.e0-9]+) s", message).group(1))


@pytest.mark.parametrize("height", [1e-6, 1.0, 1e4])
@pytest.mark.parametrize("e", [0.01, 0.3, 0.7, 0.8, 0.95])
def test_the_ball_stops_at_its_accumulation_time(e, height):
    exact = zeno_time(height, e)
    arc = hm.simulate(BouncingBall(h=height, e=e), 2.0 * exact + 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert told_time(arc.message) == pytest.approx(exact, abs=1e-3, rel=1e-6)
    # The run ends before the point of accumulation, by a millionth of the longest gap; 1e-9 for rounding.
    assert exact * (1.0 - 1e-6) <= arc.t[-1] <= exact + 1e-9 * max(1.0, exact)
    for word in ("BouncingBall", "'jump'", "End the run before", "dwell time"):
        assert word in arc.message


def test_a_ball_without_rebound_is_a_cascade_at_one_instant():
    arc = hm.simulate(BouncingBall(e=0.0), 2.0)
    assert arc.stop is hm.Stop.ZENO
    assert told_time(arc.message) == pytest.approx(np.sqrt(2 / 9.81), abs=1e-9)


def test_a_ball_at_rest_on_the_floor_is_stopped_at_the_start():
    arc = hm.simulate(BouncingBall(h=0.0), 2.0)
    assert (arc.stop, arc.t[-1]) == (hm.Stop.ZENO, 0.0)


@pytest.mark.parametrize("t_start", [-1e3, 1e3, 1e6])
def test_the_accumulation_is_found_at_any_start_time(t_start):
    arc = hm.simulate(BouncingBall(), t_start + 5.0, t_start=t_start)
    assert arc.stop is hm.Stop.ZENO
    assert told_time(arc.message) == pytest.approx(t_start + zeno_time(1.0, 0.7), abs=1e-3)
    assert arc.t[-1] == pytest.approx(t_start + zeno_time(1.0, 0.7), abs=1e-4)


def test_a_run_that_ends_before_its_accumulation_is_not_stopped():
    arc = hm.simulate(BouncingBall(), 2.55)
    assert arc.stop is hm.Stop.HORIZON


def test_two_balls_in_one_run_accumulate_each_by_itself():
    balls = hm.Composition("balls", {"slow": BouncingBall(e=0.8), "fast": BouncingBall(e=0.7)})
    arc = hm.simulate(balls, 10.0)
    assert arc.stop is hm.Stop.ZENO
    assert "fast.jump" in arc.message
    assert told_time(arc.message) == pytest.approx(zeno_time(1.0, 0.7), abs=1e-3)


def test_chattering_is_stopped():
    # A thermostat without hysteresis: both switches at 20.
    arc = hm.simulate(Thermostat(lower=20.0, upper=20.0, temperature=19.0), 100.0)
    assert arc.stop is hm.Stop.ZENO
    # 35 - 16 exp(-t/100) = 20.
    assert told_time(arc.message) == pytest.approx(100.0 * np.log(16.0 / 15.0), abs=1e-3)


def test_chattering_with_gaps_that_floats_do_not_resolve_is_stopped():
    # 45 ulp of 1 s from jump to jump.
    arc = hm.simulate(Ramp(threshold=1e-14), 2.0, t_start=1.0)
    assert arc.stop is hm.Stop.ZENO
    assert re.search(r"100 jumps of 'moved' in 1e-12 s", arc.message)


def test_a_window_in_seconds_is_the_users_word():
    arc = hm.simulate(Ramp(threshold=1e-9), 1.0, zeno=hm.ZenoGuard(window=1e-6))
    assert arc.stop is hm.Stop.ZENO
    assert re.search(r"100 jumps of 'moved' in 9.9e-08 s", arc.message)


def test_gaps_that_shrink_like_one_over_n_squared_crowd_in_the_end():
    """No geometric series; but after a gap of 0.4 s, those from n = 15 732 on crowd within a millionth of that."""

    class Basel(hm.HybridAutomaton):
        x = hm.State(0.0)
        n = hm.DiscreteState(1, integer=True)
        skipped = hm.Parameter(15500.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def jump_set(self, s):
            return s.x - np.where(s.n <= 2, 0.4, 1.0 / (s.n + s.skipped) ** 2)

        def jump_map(self, s):
            return {"x": 0.0, "n": s.n + 1}

    arc = hm.simulate(Basel(), 2.0)
    assert arc.stop is hm.Stop.ZENO
    # The 99 gaps of 1 / n^2 between 100 jumps come within 4e-7 s where the middle one has n = sqrt(99 / 4e-7).
    assert len(arc.jumps) + 15500 - 50 == pytest.approx(np.sqrt(99 / 4e-7), abs=5)


def test_gaps_that_shrink_more_slowly_than_geometrically_are_no_accumulation_before_they_crowd():
    # Thresholds crossed at t = sqrt(k): gaps shrink for ever, without a point of accumulation.
    class Roots(Ramp):
        def flow_map(self, s):
            return {"x": 2.0 * s.t}

    arc = hm.simulate(Roots(threshold=1.0), 20.0, t_start=0.0)
    assert arc.stop is hm.Stop.HORIZON
    assert [jump.t for jump in arc.jumps] == pytest.approx(np.sqrt(np.arange(1, len(arc.jumps) + 1)), abs=1e-9)
    assert len(arc.jumps) in (399, 400)


@pytest.mark.parametrize("t_start", [0.0, 1e4])
def test_a_chirp_of_millisecond_gaps_late_in_a_run_is_no_accumulation(t_start):
    """Gaps of 8 ms, each 0.9 of the one before for 12 gaps, then again: what seems 72 ms ahead never comes."""

    class Chirp(hm.HybridAutomaton):
        start = hm.Parameter(0.0)
        due = hm.DiscreteState(computed=True)
        n = hm.DiscreteState(0, integer=True)
        x = hm.State(0.0)

        def start_map(self, s):
            return {"due": s.start + 0.008}

        def flow_map(self, s):
            return {"x": 1.0}

        def jump_set(self, s):
            return s.t - s.due

        def jump_map(self, s):
            return {"due": s.due + 0.008 * 0.9 ** ((s.n + 1) % 12), "n": s.n + 1}

    arc = hm.simulate(Chirp(start=t_start), t_start + 0.5, t_start=t_start)
    assert arc.stop is hm.Stop.HORIZON


def test_fast_time_events_are_the_authors_own_and_no_accumulation():
    arc = hm.simulate(Timer(period=1e-9), 2e-7)
    assert arc.stop is hm.Stop.HORIZON
    assert len(arc.jumps) in (200, 201)


def test_a_run_that_starts_later_than_its_clock_names_the_remedy():
    class Clock(hm.HybridAutomaton):
        n = hm.DiscreteState(0.0, output=True)
        transitions = (hm.TimeEvent("tick", lambda self, s: 0.125 * s.n, lambda self, s: {"n": s.n + 1.0}),)

    class Punctual(Clock):
        n = hm.DiscreteState(computed=True)

        def start_map(self, s):
            return {"n": np.ceil(s.t / 0.125)}

    arc = hm.simulate(Clock(), 1e6 + 1.0, t_start=1e6)
    assert arc.stop is hm.Stop.ZENO
    assert "declare the clock's state with computed=True and let start_map give the next time to come." in arc.message
    # Ticks at 1e6, 1e6 + 1/8, ..., 1e6 + 1 s.
    assert len(hm.simulate(Punctual(), 1e6 + 1.0, t_start=1e6).jumps) == 9


def test_a_guard_with_other_numbers_decides_otherwise():
    arc = hm.simulate(BouncingBall(), 5.0, zeno=hm.ZenoGuard(remainder=0.1))
    assert arc.stop is hm.Stop.ZENO
    assert arc.t[-1] == pytest.approx(zeno_time(1.0, 0.7), abs=0.1)
    assert told_time(arc.message) == pytest.approx(zeno_time(1.0, 0.7), abs=1e-3)

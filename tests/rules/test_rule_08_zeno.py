"""Rule 8: a run that accumulates jumps stops with Stop.ZENO, the accumulation time and the remedy."""

import re

import numpy as np
import pytest
from small_automata import Ramp, Timer

import hybrid_model as hm
from cosim.fmu_slave import FmuSlave
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
    # 9 ulp of 1 s from jump to jump.
    arc = hm.simulate(Ramp(threshold=2e-15), 2.0, t_start=1.0)
    assert arc.stop is hm.Stop.ZENO
    assert re.search(r"100 jumps of 'moved' in 2.2e-13 s", arc.message)


def test_a_window_in_seconds_is_the_users_word():
    arc = hm.simulate(Ramp(threshold=1e-9), 1.0, zeno=hm.ZenoGuard(window=1e-6))
    assert arc.stop is hm.Stop.ZENO
    assert re.search(r"100 jumps of 'moved' in 9.9e-08 s", arc.message)


class Basel(hm.HybridAutomaton):
    """The n-th gap is 1 / n^2, so the jumps accumulate at pi^2 / 6, but not like a geometric series."""

    x = hm.State(0.0)
    n = hm.DiscreteState(1, integer=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return s.x - 1.0 / s.n**2

    def jump_map(self, s):
        return {"x": 0.0, "n": s.n + 1}


def test_gaps_that_shrink_like_one_over_n_squared_crowd_in_the_end():
    arc = hm.simulate(Basel(), 2.0, zeno=hm.ZenoGuard(jumps_in_window=5))
    assert arc.stop is hm.Stop.ZENO
    # The four gaps between five jumps come within a millionth of 1/4, the longest, where 4 / n^2 = 2.5e-7.
    assert len(arc.jumps) == pytest.approx(np.sqrt(4 / 2.5e-7), abs=5)


def test_an_fmu_whose_gaps_shrink_like_one_over_n_squared_is_stopped(exported):
    slave = FmuSlave("basel", exported(Basel(), "basel"))
    slave.start(0.0, 2.0, events=False)
    slave.begin()
    made = slave.step(0.0, 2.0)
    slave.close()
    assert made.terminated.zeno
    # Hundred jumps at a time: 99 / n^2 = 2.5e-7 at n = 19 900, and what is left is 1 / n.
    assert np.pi**2 / 6 - made.reached == pytest.approx(1 / 19_900, rel=0.02)


class LateClock(hm.HybridAutomaton):
    """One tick at once, then a pause, then ticks that come slowly denser, each gap 1 + r n times shorter."""

    x = hm.State(1.0)
    n = hm.DiscreteState(0, integer=True)
    pause = hm.Parameter(1000.0)
    f = hm.Parameter(1e6)
    r = hm.Parameter(1e-3)

    def flow_map(self, s):
        return {"x": np.where(s.n == 1, 1.0 / s.pause, s.f * (1.0 + s.r * s.n))}

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": 0.0, "n": s.n + 1}


@pytest.mark.parametrize(("pause", "f", "r"), [(1000.0, 1e6, 1e-3), (86400.0, 2e3, 0.02), (100.0, 1e5, 0.01)])
def test_a_pause_does_not_make_regular_jumps_an_accumulation(pause, f, r):
    # The gaps of 310 ticks are those of 1 / (f (1 + r n)).
    ticks = np.log1p(310 * r) / (r * f)
    arc = hm.simulate(LateClock(pause=pause, f=f, r=r), pause + ticks)
    assert arc.stop is hm.Stop.HORIZON
    assert len(arc.jumps) > 300


def test_regular_jumps_late_in_the_calendar_are_none_either():
    # The epoch of computers in s; a period of 1 ms has 4194 ulp of it.
    arc = hm.simulate(Ramp(threshold=1e-3), 1.7e9 + 1.0005, t_start=1.7e9)
    assert (arc.stop, len(arc.jumps)) == (hm.Stop.HORIZON, 1000)


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

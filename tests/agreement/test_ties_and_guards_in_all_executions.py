"""Where executions could differ: ties with time events, Zeno far from t = 0, flow priority, quiet blocks."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.result import Ended
from cosim.system import System
from hybrid_model.models import BouncingBall


class Beat(hm.HybridAutomaton):
    """A timer that the outside sees."""

    n = hm.DiscreteState(0, integer=True, output=True)
    period = hm.Parameter(0.2)
    ticks = hm.Clock("beat")

    def next_time(self, s):
        return (s.n + 1) * s.period

    def count(self, s):
        return {"n": s.n + 1}

    transitions = (hm.TimeEvent("beat", next_time, count),)


class Tie(hm.HybridAutomaton):
    """Falls to zero at a beat, up to rounding; what the beat adds the fall doubles, so the order shows."""

    x = hm.State(1.0)
    z = hm.DiscreteState(0.0, output=True)
    k = hm.DiscreteState(0, integer=True)
    rate = hm.Parameter(1.0)
    beats = hm.Clock("beat")
    falls = hm.Clock("fall")

    def flow_map(self, s):
        return {"x": -s.rate}

    def next_time(self, s):
        return (s.k + 1) / s.rate

    def beat(self, s):
        return {"z": s.z + 1.0, "k": s.k + 1}

    def below(self, s):
        return -s.x

    def fall(self, s):
        return {"z": 2.0 * s.z, "x": 1.0}

    transitions = (hm.TimeEvent("beat", next_time, beat), hm.Jump("fall", below, fall))


class Wall(hm.HybridAutomaton):
    """Under flow priority, turned back at a wall by a jump that changes the velocity only."""

    priority = hm.Priority.FLOW
    x = hm.State(0.0, output=True)
    v = hm.State(1.0, output=True)
    pull = hm.Parameter(0.3)
    bounce = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": s.v, "v": -s.pull * s.x}

    def flow_set(self, s):
        return 1.0 - s.x

    def jump_set(self, s):
        return s.x - 0.5

    def jump_map(self, s):
        return {"v": -0.9 * np.abs(s.v)}


class Halving(hm.HybridAutomaton):
    """Gaps that halve twelve times and then stay at one second: geometric for a while, and no Zeno."""

    x = hm.State(0.0)
    n = hm.DiscreteState(0, integer=True)
    emptied = hm.Clock("empty")

    def flow_map(self, s):
        return {"x": 1.0}

    def full(self, s):
        return s.x - np.where(s.n < 12, 0.5**s.n, 1.0)

    def empty(self, s):
        return {"x": 0.0, "n": s.n + 1}

    transitions = (hm.Jump("empty", full, empty),)


def slave(execution, automaton, exported, key):
    return AutomatonSlave("a", automaton) if execution == "in process" else FmuSlave("a", exported(automaton, key))


EXECUTIONS = pytest.mark.parametrize("execution", ["in process", "fmu"])


@EXECUTIONS
@pytest.mark.parametrize("interval", [0.01, 0.1, 0.2])
def test_events_at_points_of_the_output_grid(execution, interval, exported):
    result = run_event_exact(System([slave(execution, Beat(), exported, "beat")], {}), 3.0, output_interval=interval)
    assert result.tick_times("a", "ticks") == pytest.approx([(n + 1) * 0.2 for n in range(15)], abs=1e-12)


@EXECUTIONS
@pytest.mark.parametrize("ulps", range(-6, 7))
def test_events_a_few_ulp_from_an_output_point(execution, ulps, exported):
    impact = float(np.sqrt(2 / 9.81))
    interval = impact + ulps * float(np.spacing(impact))
    system = System([slave(execution, BouncingBall(), exported, "ball")], {})
    result = run_event_exact(system, 2.0 * interval, output_interval=interval)
    assert result.tick_times("a", "impact") == pytest.approx([impact], abs=1e-9)


@pytest.mark.parametrize("rate", [1.0, 0.3, 0.7, 1.7])
def test_a_guard_and_a_time_event_at_one_time_come_in_declared_order(rate, exported):
    arc = hm.simulate(Tie(rate=rate), 3.5 / rate)
    assert [jump.name for jump in arc.jumps] == ["beat", "fall"] * 3
    assert arc.end.z == 14.0
    for execution in ("in process", "fmu"):
        system = System([slave(execution, Tie(rate=rate), exported, f"tie{rate}")], {})
        result = run_event_exact(system, 3.5 / rate)
        assert [tick.clock for tick in result.ticks] == ["beats", "falls"] * 3
        assert result.final["a.z"] == 14.0


def test_timers_that_differ_by_rounding_beat_at_one_instant(exported):
    """3 * 0.1 and 0.3 differ in the last digit; the order of the parts decides, not the digit."""
    for names in ("ab", "ba"):
        parts = {name: Beat(period={"a": 0.1, "b": 0.3}[name]) for name in names}
        both = hm.Composition("both", parts)
        result = run_event_exact(System([FmuSlave("a", exported(both, f"beats_{names}"))], {}), 0.35)
        assert [tick.clock for tick in result.ticks if tick.t > 0.25] == [f"{name}.ticks" for name in names]
        arc = hm.simulate(both, 0.35)
        together = [jump.name for jump in arc.jumps if jump.t > 0.25]
        assert together == [f"{name}.beat" for name in names]
        assert len({jump.t for jump in arc.jumps if jump.t > 0.25}) == 1


def test_a_jump_that_turns_back_at_the_border_is_followed_by_flow(exported):
    arc = hm.simulate(Wall(), 3.0)
    assert arc.stop is hm.Stop.HORIZON
    assert len(arc.jumps) == 1
    for execution in ("in process", "fmu"):
        result = run_event_exact(System([slave(execution, Wall(), exported, "wall")], {}), 3.0)
        assert result.tick_times("a", "bounce") == pytest.approx(arc.event_times("jump"), abs=1e-9)
        assert result.final["a.x"] == pytest.approx(arc.end.x, abs=1e-9)


@EXECUTIONS
@pytest.mark.parametrize("t_start", [0.0, 1e3, 1e6])
def test_the_zeno_guard_is_the_same_in_all_executions(execution, t_start, exported):
    arc = hm.simulate(BouncingBall(), t_start + 5.0, t_start=t_start)
    system = System([slave(execution, BouncingBall(), exported, "ball")], {})
    result = run_event_exact(system, t_start + 5.0, t_start=t_start)
    assert arc.stop is hm.Stop.ZENO
    assert result.ended is Ended.ZENO
    assert len(result.tick_times("a", "impact")) == len(arc.jumps)
    assert result.t - t_start == pytest.approx(np.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-3)


@EXECUTIONS
@pytest.mark.parametrize("t_start", [0.0, 1e3])
def test_gaps_that_shrink_for_a_while_are_no_zeno(execution, t_start, exported):
    arc = hm.simulate(Halving(), t_start + 6.5, t_start=t_start)
    result = run_event_exact(
        System([slave(execution, Halving(), exported, "halving")], {}), t_start + 6.5, t_start=t_start
    )
    assert arc.stop is hm.Stop.HORIZON
    assert result.ended is Ended.HORIZON
    assert len(result.tick_times("a", "emptied")) == len(arc.jumps) == 16


@EXECUTIONS
def test_time_events_at_one_instant_are_bounded(execution, exported):
    """A timer of 1 ms that begins 2 s before the run has 2000 beats to catch up with at once."""
    result = run_event_exact(System([slave(execution, Beat(period=0.001), exported, "fast")], {}), 2.5, t_start=2.0)
    assert result.ended is Ended.ZENO
    assert hm.simulate(Beat(period=0.001), 2.5, t_start=2.0).stop is hm.Stop.ZENO


def test_jumps_that_grow_ever_denser_have_an_end():
    """Not Zeno: each gap is a little shorter than the one before, and the time goes to infinity."""

    class Denser(hm.HybridAutomaton):
        x = hm.State(0.0)
        n = hm.DiscreteState(1, integer=True)

        def flow_map(self, s):
            return {"x": 1.0}

        def jump_set(self, s):
            return s.x - 1.0 / s.n

        def jump_map(self, s):
            return {"x": 0.0, "n": s.n + 1}

    arc = hm.simulate(Denser(), 100.0, zeno=hm.ZenoGuard(max_jumps=500))
    assert arc.stop is hm.Stop.JUMPS
    assert len(arc.jumps) == 500
    assert "500 jumps by t = 6.79" in arc.message


def test_a_block_without_events_is_left_alone(exported):
    """No rollback: a quiet FMU is stepped once, to the stop time, however many events the others have."""
    quiet = FmuSlave("quiet", exported(BouncingBall(h=1e6), "high_ball"))
    busy = AutomatonSlave("busy", Beat())
    calls = []
    step = quiet.step
    quiet.step = lambda t, t_next: calls.append((t, t_next)) or step(t, t_next)
    quiet.save = lambda: pytest.fail("a block that predicts is never saved")
    run_event_exact(System([quiet, busy], {}), 3.1)
    assert calls == [(0.0, 3.1)]


class Rest(hm.HybridAutomaton):
    """Rests outside its flow set by a rounding and drifts by less; every half second something else leaves it."""

    y = hm.State(-1e-14, output=True)
    w = hm.State(0.5, output=True)
    hit = hm.Clock("jump")

    def flow_map(self, s):
        return {"y": -1e-16, "w": -1.0}

    def flow_set(self, s):
        return hm.least(s.y, s.w)

    def jump_set(self, s):
        return -s.w

    def jump_map(self, s):
        return {"w": 0.5}


@EXECUTIONS
def test_a_state_a_rounding_outside_the_flow_set_hides_no_guard(execution, exported):
    result = run_event_exact(System([slave(execution, Rest(), exported, "rest")], {}), 2.2)
    assert result.tick_times("a", "hit") == pytest.approx([0.5, 1.0, 1.5, 2.0], abs=1e-12)
    assert [jump.t for jump in hm.simulate(Rest(), 2.2).jumps] == pytest.approx([0.5, 1.0, 1.5, 2.0], abs=1e-12)

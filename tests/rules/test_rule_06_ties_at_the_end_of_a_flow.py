"""Rule 6: a crossing that rounding puts just behind a time event or the end time counts as reached there."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System


class Staircase(hm.HybridAutomaton):
    """Rises at a rate and broadcasts every `height`; a timer, with period `period`, stops and starts the rise."""

    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True)
    k = hm.DiscreteState(0, integer=True)
    rate = hm.Parameter(0.1)
    height = hm.Parameter(0.3)
    period = hm.Parameter(3.0)
    send = hm.Clock("send")

    def flow_map(self, s):
        return {"x": s.rate * (1.0 - np.mod(s.k, 2))}

    def risen(self, s):
        return s.x - s.sent - s.height

    def hold(self, s):
        return {"sent": s.x}

    def next_switch(self, s):
        return (s.k + 1) * s.period

    def switch(self, s):
        return {"k": s.k + 1}

    transitions = (
        hm.TimeEvent("switch", next_switch, switch, internal=True),
        hm.Jump("send", risen, hold),
    )


def simulated(automaton, t_end, exported):
    return hm.simulate(automaton, t_end).event_times("send")


def in_process(automaton, t_end, exported):
    return run_event_exact(System([AutomatonSlave("a", automaton)], {}), t_end).tick_times("a", "send")


def as_fmu(automaton, t_end, exported):
    slave = FmuSlave("a", exported(automaton, f"staircase{automaton.name}"))
    return run_event_exact(System([slave], {}), t_end).tick_times("a", "send")


RUNS = pytest.mark.parametrize("run", [simulated, in_process, as_fmu])


@RUNS
@pytest.mark.parametrize("rate", [0.1, 0.3, 0.7])
def test_a_crossing_at_a_breakpoint_is_taken_there(run, rate, exported):
    """The rise reaches the height just as the timer stops it; x misses it by a rounding for some rates."""
    automaton = Staircase(name=f"b{rate}".replace(".", ""), rate=rate, height=3.0 * rate)
    times = run(automaton, 10.0, exported)
    assert times == pytest.approx([3.0, 9.0], abs=1e-9)


@RUNS
@pytest.mark.parametrize("rate", [0.1, 0.3, 0.7])
def test_a_crossing_at_the_end_time_is_taken_there(run, rate, exported):
    automaton = Staircase(name=f"e{rate}".replace(".", ""), rate=rate, height=2.9 * rate, period=100.0)
    times = run(automaton, 2.9, exported)
    assert times == pytest.approx([2.9], abs=1e-9)


@RUNS
def test_what_misses_by_more_than_the_tolerance_is_not_taken(run, exported):
    automaton = Staircase(name="miss", rate=0.1, height=0.3 + 1e-8)
    assert len(run(automaton, 5.0, exported)) == 0


class TwoGuards(hm.HybridAutomaton):
    """Two guards of one state reach their levels at the end time; the first jump takes the second's reason away."""

    x = hm.State(0.0)
    first = hm.DiscreteState(0)
    second = hm.DiscreteState(0)

    def flow_map(self, s):
        return {"x": 0.1}

    def level(self, s):
        return s.x - 0.29

    def reset_first(self, s):
        return {"x": 0.0, "first": s.first + 1}

    def reset_second(self, s):
        return {"second": s.second + 1, "x": 0.0}

    transitions = (hm.Jump("first", level, reset_first), hm.Jump("second", level, reset_second))


def test_a_jump_that_lowers_the_margin_takes_the_other_guard_back():
    arc = hm.simulate(TwoGuards(), 2.9)
    assert [jump.name for jump in arc.jumps] == ["first"]


class Twice(hm.HybridAutomaton):
    """Counts the same instants by a clock and by a ramp, whose levels are met where steps end at the clock's times."""

    rate = hm.Parameter(3.0)
    x = hm.State(0.0)
    ticks = hm.DiscreteState(0.0)
    levels = hm.DiscreteState(0.0)

    def flow_map(self, s):
        return {"x": s.rate}

    transitions = (
        hm.TimeEvent("tick", lambda self, s: 0.1 * (s.ticks + 1.0), lambda self, s: {"ticks": s.ticks + 1.0}),
        hm.Jump(
            "level", lambda self, s: s.x - 0.1 * s.rate * (s.levels + 1.0), lambda self, s: {"levels": s.levels + 1.0}
        ),
    )


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("rate", [3.0, 0.7, 0.9, 1.1, 2.3])
def test_a_level_that_is_met_at_the_very_end_of_a_step_is_met_with_the_time_event(rate, engine):
    """Rounding must not put the state at the event, computed anew, below the level."""
    arc = hm.simulate(Twice(rate=rate), 3.05, engine=engine)
    together = [(one.t, one.name, other.name) for one, other in zip(arc.jumps[::2], arc.jumps[1::2], strict=True)]
    assert [names for _, *names in together] == [["tick", "level"]] * 30
    assert all(one.t == other.t for one, other in zip(arc.jumps[::2], arc.jumps[1::2], strict=True))


class Stairs(hm.HybridAutomaton):
    """Counts the levels that a ramp comes to."""

    rate = hm.Parameter(1.0)
    x = hm.State(0.0)
    count = hm.DiscreteState(0.0)

    def flow_map(self, s):
        return {"x": s.rate}

    transitions = (
        hm.Jump("tick", lambda self, s: s.x - 0.1 * s.rate * (s.count + 1.0), lambda self, s: {"count": s.count + 1.0}),
    )


class Relaxing(hm.HybridAutomaton):
    """Rises ever slower to one, and falls back: its events cut the steps of what runs with it."""

    x = hm.State(0.3)

    def flow_map(self, s):
        return {"x": 1.0 - 0.3 * s.x}

    transitions = (hm.Jump("fall", lambda self, s: s.x - 1.0, lambda self, s: {"x": 0.1}),)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("rates", [(3.4, 1.93), (2.42, 0.6), (1.65, 3.26), (2.74, 3.48)])
def test_levels_at_the_end_of_a_run_are_met_together_in_the_order_of_the_parts(rates, engine):
    """One of the two is met at the end or some rounding before it, the other some rounding behind it."""
    parts = {"a": Stairs(rate=rates[0]), "b": Stairs(rate=rates[1]), "c": Relaxing()}
    arc = hm.simulate(hm.Composition("stairs", parts, {}), 3.0, engine=engine)
    assert [jump.name for jump in arc.jumps if jump.t > 2.95 and "tick" in jump.name] == ["a.tick", "b.tick"]


class Climb(hm.HybridAutomaton):
    """Climbs for as long as it may, by flow priority, and begins anew; a clock ticks once."""

    rate = hm.Parameter(1.0)
    top = hm.Parameter(1.0)
    at = hm.Parameter(1.0)
    x = hm.State(0.0)
    ticks = hm.DiscreteState(0)
    priority = hm.Priority.FLOW

    def flow_map(self, s):
        return {"x": s.rate}

    def flow_set(self, s):
        return s.top - s.x

    transitions = (
        hm.TimeEvent("tick", lambda self, s: np.where(s.ticks < 0.5, s.at, np.inf), lambda self, s: {"ticks": 1}),
        hm.Jump("again", lambda self, s: s.x - s.top, lambda self, s: {"x": 0.0}),
    )


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("at", [2.9, 9.0])
@pytest.mark.parametrize("rate", [1.0, 0.1, 0.3, 0.7])
def test_a_flow_that_ends_with_the_run_is_over(rate, at, engine):
    """Where the flow leads is seen from where it came, as there is no time left."""
    climb = Climb(rate=rate, top=2.9 * rate, at=at)
    ends, goes_on = ([jump.name for jump in hm.simulate(climb, t_end, engine=engine).jumps] for t_end in (2.9, 3.0))
    assert ends == goes_on == (["tick", "again"] if at < 3.0 else ["again"])

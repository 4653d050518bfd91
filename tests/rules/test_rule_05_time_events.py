"""Rule 5: known discontinuities are time events: the flow is integrated exactly up to them, never across."""

import math

import numpy as np
import pytest
from small_automata import Store, Timer

import hybrid_model as hm


class SquareWave(hm.HybridAutomaton):
    """x' = +1 and -1 in turn, changing at multiples of the period."""

    x = hm.State(0.0)
    k = hm.DiscreteState(1, integer=True)
    sign = hm.DiscreteState(1, integer=True)
    period = hm.Parameter(0.3)

    def flow_map(self, s):
        return {"x": s.sign * 1.0}

    def change(self, s):
        return s.k * s.period

    def flip(self, s):
        return {"sign": -s.sign, "k": s.k + 1}

    transitions = (hm.TimeEvent("flip", change, flip, internal=True),)


def test_the_flow_ends_exactly_at_the_event():
    arc = hm.simulate(SquareWave(), 10.0)
    assert [jump.t for jump in arc.jumps] == [k * 0.3 for k in range(1, 34)]


def test_no_piece_of_flow_has_both_sides():
    arc = hm.simulate(SquareWave(), 3.0)
    # A triangle wave, exact up to the rounding of 10 additions.
    phase = np.mod(arc.t, 0.6)
    assert arc["x"] == pytest.approx(np.where(phase <= 0.3, phase, 0.6 - phase), abs=1e-14)


def test_time_events_at_the_start_and_at_the_end_are_taken():
    arc = hm.simulate(Timer(), 3.0)
    assert [jump.t for jump in arc.jumps] == [0.0, 1.0, 2.0, 3.0]


def test_time_events_before_the_start_are_due_at_the_start():
    arc = hm.simulate(Timer(first=-2.0), 0.5)
    assert [jump.t for jump in arc.jumps] == [0.0, 0.0, 0.0]


def test_an_event_at_infinity_never_comes():
    assert hm.simulate(Never(), 1.0).jumps == []


class Never(hm.HybridAutomaton):
    transitions = (hm.TimeEvent("never", lambda self, s: np.inf, lambda self, s: {}),)


@pytest.mark.parametrize("gap", [1, 2, 15, 16, 17, 100])
def test_time_events_a_few_ulps_apart(gap):
    """Pieces too short for any stepper: the flow between is not lost. Times within 8 ulp are one time."""
    first = 0.7
    second = first + gap * np.spacing(1.0)
    ticks = hm.Composition(
        "pair",
        {
            "flow": SquareWave(period=5.0),
            "a": Timer(first=first, period=9.0),
            "b": Timer(first=second, period=9.0),
        },
    )
    arc = hm.simulate(ticks, 1.0)
    both = [second, second] if gap <= 8 else [first, second]
    assert [(jump.name, jump.t) for jump in arc.jumps] == [("a.tick", both[0]), ("b.tick", both[1])]
    assert arc.end["flow.x"] == pytest.approx(1.0, abs=1e-14)


def test_an_input_with_breakpoints_is_integrated_exactly():
    signal = hm.Signal(lambda t: 1.0 if t < 0.3 else (-2.0 if t < 0.7 else 5.0), breakpoints=[0.7, 0.3])
    arc = hm.simulate(Store(), 1.0, inputs={"u": signal})
    # 0.3 - 0.8 + 1.5 = 1; a step across a breakpoint would be wrong by the step error of a jump, far above 1e-14.
    assert arc.end.x == pytest.approx(1.0, abs=1e-14)
    assert arc.at("x", [0.3, 0.7]) == pytest.approx([0.3, -0.5], abs=1e-14)


@pytest.mark.parametrize("breakpoint", [0.0, 1.0])
def test_breakpoints_at_the_start_and_at_the_end(breakpoint):
    signal = hm.Signal(lambda t: 2.0 if t < breakpoint else 3.0, breakpoints=[breakpoint])
    arc = hm.simulate(Store(), 1.0, inputs={"u": signal})
    assert arc.end.x == pytest.approx(3.0 if breakpoint == 0.0 else 2.0, abs=1e-14)


def test_a_breakpoint_that_enables_a_guard_fires_it_at_the_breakpoint():
    class Watcher(Store):
        armed = hm.DiscreteState(1)

        def jump_set(self, s):
            return hm.least(s.u - 0.5, s.armed - 0.5)

        def jump_map(self, s):
            return {"armed": 0}

    signal = hm.Signal(lambda t: 1.0 if t >= 0.35 else 0.0, breakpoints=[0.35])
    arc = hm.simulate(Watcher(), 1.0, inputs={"u": signal})
    assert [jump.t for jump in arc.jumps] == [0.35]
    assert arc.jumps[0].x_before[0] == pytest.approx(0.0, abs=1e-15)


def test_a_smooth_input_is_a_function_of_time():
    arc = hm.simulate(Store(), 2.0, inputs={"u": math.cos})
    assert arc.end.x == pytest.approx(math.sin(2.0), abs=1e-12)


@pytest.mark.parametrize("method", list(hm.Method))
def test_every_method_stops_at_events_and_goes_on(method):
    arc = hm.simulate(SquareWave(), 1.0, solver=hm.Solver(method=method, rtol=1e-9, atol=1e-10))
    assert [jump.t for jump in arc.jumps] == [k * 0.3 for k in range(1, 4)]
    assert arc.end.x == pytest.approx(0.2, abs=1e-8)


class Alarm(hm.HybridAutomaton):
    """Rings once when its input is up."""

    x = hm.State(0.0)
    u = hm.Input(0.0)
    rung = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"x": s.u}

    def jump_set(self, s):
        return hm.least(s.u - 0.5, 0.5 - s.rung)

    def jump_map(self, s):
        return {"rung": s.rung + 1}


@pytest.mark.parametrize("breakpoints", [[0.25], [0.25, 1.0]], ids=["not told", "told"])
@pytest.mark.parametrize("late", [0.0, 1e-9])
def test_an_input_that_jumps_at_the_end_of_the_run_has_its_new_value_there(breakpoints, late):
    """Whether or not it is told: at the end an input is what its function says."""
    signal = hm.Signal(lambda t: 1.0 if t >= 1.0 + late else 0.0, breakpoints)
    arc = hm.simulate(Alarm(), 1.0, inputs={"u": signal})
    assert [jump.t for jump in arc.jumps] == ([] if late else [1.0])
    assert arc.at("x", 1.0) == 0.0

"""Random affine automata against closed forms: no event is missed, doubled or taken out of order.

The automata have up to three modes, four guards (some crossed at one instant by construction), two timers, an input
with breakpoints, and resets. `oracles.affine_run` runs them exactly. Half of the runs end at the instant of an event or
have a timer or a breakpoint put there, so that zeros at both ends of a flow are the rule and not the exception.
"""

import math
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from drawing import examples
from drawn_automata import compare, exponentials, modal_systems, parabolas, piecewise_linear, rotations
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import hybrid_model as hm

# strategy, examples by default and in the long run (13 400 together), time, state: an event may be late by
# time + state/slope. Straight lines and parabolas are exact but for some ten roundings of numbers near 10, and crossing
# times are quotients by slopes of 1/8 and more; the others have the solver's error, 1e-13 a step, over up to 12 flows.
FAMILIES = {
    "piecewise linear": (piecewise_linear, 50, 5500, 1e-12, 1e-13),
    "parabolas": (parabolas, 60, 3000, 1e-12, 1e-12),
    "exponentials": (exponentials, 20, 2500, 1e-11, 1e-11),
    "rotations": (rotations, 15, 1200, 1e-11, 1e-11),
    "modal systems": (modal_systems, 15, 1200, 1e-11, 1e-11),
}
SOLVERS = [hm.Solver(), hm.Solver(max_step=0.25), hm.Solver(max_step=1 / 3)]


def check(family, examples):
    """Compare drawn systems with their exact runs, and count what the draws contained."""
    strategy, _, _, time, state = FAMILIES[family]
    seen = Counter()

    # A case is small and printed whole; to shrink it further takes minutes.
    @settings(
        max_examples=examples,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy(), st.sampled_from(SOLVERS))
    def property_holds(system, solver):
        exact = compare(system, time=time, state=state, solver=solver)
        times = [float(event.t) for event in exact.events]
        seen["compared"] += bool(times) or not exact.cut
        seen["several events"] += len(times) >= 4
        seen["at one instant"] += any(a == b for a, b in pairwise(times))
        seen["at the end of the run"] += bool(times) and times[-1] == float(system.t_end)

    property_holds()
    return seen


@pytest.mark.parametrize("family", FAMILIES)
def test_events_are_those_of_the_closed_form(family):
    examples = FAMILIES[family][1]
    seen = check(family, examples)
    # The draws are not empty of what they are for.
    assert seen["compared"] >= 0.75 * examples
    assert seen["several events"] >= 0.15 * examples
    assert seen["at one instant"] >= 0.2 * examples
    if examples >= 100:
        assert seen["at the end of the run"] >= 1


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_events_are_those_of_the_closed_form_in_ten_thousand_cases(family):
    seen = check(family, FAMILIES[family][2])
    assert seen["compared"] >= 0.75 * FAMILIES[family][2]


# Waves: many crossings in one step.


BELOW = 1e-9
"""A wave arms this far below its level: at the level itself it would ring and arm in turn, without end."""


class Wave(hm.HybridAutomaton):
    """Rings when a sine of time rises to `level`, arms when it has fallen below: the state is a straight line."""

    x = hm.State(0.0)
    armed = hm.DiscreteState(0, integer=True)
    omega, phase, level = hm.Parameter(1.0), hm.Parameter(0.0), hm.Parameter(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def margin(self, s):
        return np.sin(s.omega * s.t + s.phase) - s.level

    def risen(self, s):
        return hm.least(self.margin(s), s.armed - 0.5)

    def fallen(self, s):
        return hm.least(-BELOW - self.margin(s), 0.5 - s.armed)

    def ring(self, s):
        return {"armed": 0}

    def arm(self, s):
        return {"armed": 1}

    transitions = (hm.Jump("ring", risen, ring), hm.Jump("arm", fallen, arm))


def wave_crossings(omega, phase, level, t_end):
    """Crossing times in (0, t_end): a sine rises through the level at asin(level) and falls at pi - asin(level)."""
    turns = np.arange(-2, int(omega * t_end / (2 * math.pi)) + 3) * 2 * math.pi
    rises = (math.asin(level) + turns - phase) / omega
    falls = (math.pi - math.asin(level - BELOW) + turns - phase) / omega
    events = sorted([(t, "ring") for t in rises] + [(t, "arm") for t in falls])
    return [(t, name) for t, name in events if 0.0 < t < t_end]


@examples(8, 20)
@given(st.integers(4, 250), st.integers(0, 62), st.integers(-9, 9))
def test_every_crossing_of_a_wave_in_one_step_is_found(omega, phase, level):
    # Up to 20 crossings in steps that grow to the whole run: nothing in the state tells the solver of them.
    t_end = 1.0
    omega, phase, level = omega / 4 + 0.01, phase / 10 + 0.003, level / 10 + 0.001
    armed = math.sin(phase) < level
    arc = hm.simulate(Wave(omega=omega, phase=phase, level=level, armed=armed), t_end)
    exact = wave_crossings(omega, phase, level, t_end)
    assert [jump.name for jump in arc.jumps] == [name for _, name in exact]
    # The sine's rounding, some 1e-14 at angles up to 70, over its slope: omega sqrt(1 - level^2) >= 0.4.
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _ in exact], abs=1e-12)


class Turning(Wave):
    """The same for the state of a rotation, which the solver follows in steps of its own choice."""

    y = hm.State(1.0)

    def flow_map(self, s):
        return {"x": s.omega * s.y, "y": -s.omega * s.x}

    def margin(self, s):
        return s.x - s.level


@examples(6, 15)
@given(st.integers(0, 62), st.integers(-8, 8), st.sampled_from([1e-3, 1e-5, 1e-7]))
def test_every_crossing_of_a_rotation_in_coarse_steps_is_found(phase, level, rtol):
    omega, phase, level, t_end = 3.0, phase / 10 + 0.003, level / 10 + 0.001, 10.0
    x, y = math.sin(phase), math.cos(phase)
    exact = wave_crossings(omega, phase, level, t_end)
    if t_end - exact[-1][0] < 0.05:
        t_end += 0.1
        exact = wave_crossings(omega, phase, level, t_end)
    solver = hm.Solver(rtol=rtol, atol=rtol)
    arc = hm.simulate(Turning(x=x, y=y, omega=omega, level=level, armed=x < level), t_end, solver=solver)
    assert [jump.name for jump in arc.jumps] == [name for _, name in exact]
    # At 1e-3 a step is longer than a radian; global errors of 30 radians over the slope, 3 sqrt(1 - 0.8^2).
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _ in exact], abs=30 * rtol)


# What draws have found, in its smallest form.


class Circling(hm.HybridAutomaton):
    """On the unit circle; the guard needs a point outside of it. A timer ends a flow at 1/2 s."""

    x, y = hm.State(1.0), hm.State(0.0)
    ticks = hm.DiscreteState(0)

    def flow_map(self, s):
        return {"x": -s.y, "y": s.x}

    def outside(self, s):
        return s.x - 1.5

    def stay(self, s):
        return {}

    def time(self, s):
        return 0.5 + s.ticks

    def tick(self, s):
        return {"ticks": s.ticks + 1}

    transitions = (hm.Jump("outside", outside, stay), hm.TimeEvent("tick", time, tick))


@pytest.mark.parametrize("length", [1e-15, 8e-15, 2e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9])
def test_a_flow_shorter_than_the_event_tolerance_reaches_no_guard_far_away(length):
    arc = hm.simulate(Circling(), 0.5 + length)
    assert [jump.name for jump in arc.jumps] == ["tick"]


def test_a_timer_that_rounding_puts_behind_the_end_of_the_run_is_not_taken():
    """A run ends where it is told to: what is due later by an ulp belongs to the next run (rule 6)."""

    class Clock(hm.HybridAutomaton):
        x = hm.State(0.0)
        ticks = hm.DiscreteState(0)

        def flow_map(self, s):
            return {"x": 1.0}

        def time(self, s):
            # 3 * 0.1 is one ulp above 0.3.
            return (s.ticks + 1.0) * 0.1

        def tick(self, s):
            return {"ticks": s.ticks + 1}

        transitions = (hm.TimeEvent("tick", time, tick),)

    assert len(hm.simulate(Clock(), 0.3).jumps) == 2
    assert len(hm.simulate(Clock(), 3 * 0.1).jumps) == 3

"""Location of rises: half-open interval, close pairs of crossings, accuracy, and the documented bound."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hybrid_model as hm
from hybrid_model.reference import zero_crossings
from hybrid_model.reference.zero_crossings import DEGREE, first_nonnegative, may_rise, scan_times
from hybrid_model.scales import ulp


def first_rise(margin, a, b, panels=1):
    """Locate the first rise of a function on (a, b] as a run does for one step."""
    for start, end in itertools.pairwise(np.linspace(a, b, panels + 1)):
        times = scan_times(start, end)
        samples = np.array([margin(t) for t in times])
        bracket = zero_crossings.first_rise(times, samples, lambda at: np.array([margin(t) for t in at]))
        if bracket is not None:
            assert may_rise(samples[:, None])[0]
            return first_nonnegative(margin, *bracket)
    return None


def test_ulp_is_the_distance_of_floats_at_any_size():
    for t in (0.0, 1e-300, 1e-9, 1.0, 1e6):
        assert ulp(-t) == ulp(t) == np.spacing(t)


def test_scan_times_hold_the_ends_and_do_not_fall():
    for a, b in ((0.0, 1.0), (1.0, 1.0 + 4e-16), (-1e6, -1e6 + 1e-9)):
        times = scan_times(a, b)
        assert len(times) == DEGREE + 1
        assert (times[0], times[-1]) == (a, b)
        assert np.all(np.diff(times) >= 0)


def test_zero_at_the_end_is_found_at_the_end():
    assert first_rise(lambda t: t - 1.0, 0.0, 1.0) == 1.0


def test_zero_at_the_start_is_no_crossing():
    assert first_rise(lambda t: t, 0.0, 1.0) is None
    assert first_rise(lambda t: -t, 0.0, 1.0) is None


def test_falling_margin_is_no_crossing():
    assert first_rise(lambda t: 0.5 - t, 0.0, 1.0) is None


def test_the_rise_after_a_fall_is_found():
    assert first_rise(lambda t: (t - 0.4) * (t - 0.6), 0.0, 1.0) == pytest.approx(0.6, abs=1e-15)


def test_even_crossings_of_one_step_are_found_at_the_first():
    assert first_rise(lambda t: -(t - 0.4) * (t - 0.6), 0.0, 1.0) == pytest.approx(0.4, abs=1e-15)


@pytest.mark.parametrize("centre", [0.02, 0.05, 1 / 9, 1.5 / 9, 0.5, 7.5 / 9, 0.95, 0.98])
@pytest.mark.parametrize("half", [1e-2, 1e-4, 1e-6])
def test_two_crossings_close_together_are_found_wherever_in_the_step(centre, half):
    found = first_rise(lambda t: half**2 - (t - centre) ** 2, 0.0, 1.0)
    # The margin's rounding, 1e-16, over its slope at the crossing, 2 half; a few ulp of t.
    assert found == pytest.approx(centre - half, abs=1e-15 + 1e-16 / half)


@pytest.mark.parametrize("function", [np.cos, lambda t: 1.0 - t**2 / 2 + t**3 / 7, lambda t: np.exp(-3.0 * t**2)])
@pytest.mark.parametrize("centre", [0.03, 0.21, 0.5, 0.77, 0.97])
def test_maxima_of_other_forms_than_parabolas_are_found(function, centre):
    top = function(0.0)
    found = first_rise(lambda t: function(t - centre) - top + 1e-8, 0.0, 1.0)
    assert found is not None
    assert found == pytest.approx(centre, abs=2e-4)


def test_a_margin_that_only_touches_zero_is_found_if_it_reaches_zero_in_floating_point():
    assert first_rise(lambda t: -abs(t - 0.5), 0.0, 1.0) == 0.5  # 0.5 is a sample
    assert first_rise(lambda t: 1e-12 - (t - 0.53) ** 2, 0.0, 1.0) == pytest.approx(0.53, abs=2e-6)
    assert first_rise(lambda t: -1e-12 - (t - 0.53) ** 2, 0.0, 1.0) is None


def test_the_documented_bound_more_samples_find_what_fewer_miss():
    def margin(t):
        return math.exp(-(((t - 0.3) / 0.003) ** 2)) - 0.5

    assert first_rise(margin, 0.0, 1.0) is None
    # Half height of the peak at 0.003 sqrt(ln 2) from its centre.
    assert first_rise(margin, 0.0, 1.0, panels=25) == pytest.approx(0.3 - 0.003 * math.sqrt(math.log(2.0)), abs=1e-14)


def test_the_located_time_is_on_the_side_where_the_margin_is_zero_or_above():
    for zero in np.linspace(0.01, 0.99, 50):
        margin = lambda t, zero=zero: t**3 - zero**3  # noqa: E731
        t = first_nonnegative(margin, 0.0, 1.0)
        assert margin(t) >= 0.0
        assert margin(t - 8 * ulp(t)) < 0.0


def test_a_discontinuous_margin_is_located_at_its_first_float():
    assert first_nonnegative(lambda t: 1.0 if t >= 0.7 else -1.0, 0.0, 1.0) == pytest.approx(0.7, abs=2 * ulp(1.0))


def test_a_margin_that_stays_zero_is_located_where_it_becomes_zero():
    assert first_rise(lambda t: min(t - 0.5, 0.0), 0.0, 1.0) == pytest.approx(0.5, abs=4 * ulp(1.0))


def test_a_falling_zero_at_a_sample_does_not_hide_the_rise_before_it():
    assert first_rise(lambda t: -(t - 0.6) * (t - 2 / 3), 0.0, 1.0) == pytest.approx(0.6, abs=1e-14)


@pytest.mark.parametrize("below", [-math.inf, -1e300])
def test_an_infinite_margin_is_located_like_any_other(below):
    # np.where(z > 0, x, -inf) is a natural way to disable a guard.
    margin = lambda t: t - 0.5 if t >= 0.5 else below  # noqa: E731
    assert first_rise(margin, 0.0, 1.0) == pytest.approx(0.5, abs=4 * ulp(1.0))


def test_a_margin_of_minus_infinity_throughout_never_fires():
    assert first_rise(lambda t: -math.inf, 0.0, 1.0) is None


@settings(max_examples=200, deadline=None)
@given(a=st.floats(-1e3, 1e3), length=st.floats(1e-6, 1e3), where=st.floats(0.0, 1.0), slope=st.floats(1e-3, 1e3))
def test_roots_of_affine_margins(a, length, where, slope):
    b = a + length
    root = a + where * length
    assume(a < root <= b)
    found = first_rise(lambda t: slope * (t - root), a, b)
    # t - root is exact near the root, so only brentq's tolerance is left.
    assert found == pytest.approx(root, abs=6 * ulp(max(abs(a), abs(b))))


@settings(max_examples=300, deadline=None)
@given(st.lists(st.integers(1, 59), min_size=1, max_size=DEGREE, unique=True))
def test_first_rise_of_polynomials_with_known_roots(sixtieths):
    """Up to eight roots, at least 1/60 apart, in one step whose samples are up to 1/5 apart."""
    roots = sorted(k / 60 for k in sixtieths)

    def margin(t):
        # Negative at the start, as every margin is where a flow starts: the first root is the first rise.
        return -((-1.0) ** len(roots)) * math.prod(t - root for root in roots)

    assert first_rise(margin, 0.0, 1.0) == pytest.approx(roots[0], abs=1e-12)


@settings(max_examples=200, deadline=None)
@given(st.floats(5.0, 60.0), st.floats(0.0, 2 * math.pi), st.floats(-0.999, 0.999))
def test_first_rise_of_a_sine_with_many_crossings_in_one_step(rate, phase, level):
    start = math.sin(phase) - level
    assume(abs(start) > 1e-9)
    found = first_rise(lambda t: math.sin(rate * t + phase) - level, 0.0, 1.0)
    # Rising crossings: rate t + phase = asin(level) + 2 pi k.
    rise = math.asin(level) - phase
    exact = (rise + 2 * math.pi * math.ceil(-rise / (2 * math.pi))) / rate
    if exact > 1.0 + 1e-9:
        assert found is None
    elif exact < 1.0 - 1e-9:
        assert found == pytest.approx(exact, abs=1e-13 / math.cos(math.asin(level)))


@settings(max_examples=200, deadline=None)
@given(st.floats(0.05, 0.95), st.floats(1e-6, 0.04), st.floats(0.1, 10.0))
def test_a_kink_below_zero_hides_no_crossing_after_it(kink, gap, slope):
    """The margin of a falling body on the floor, least(a, b), has a kink in every flight."""
    zero = kink + gap
    found = first_rise(lambda t: min(slope * (t - zero), (t - kink) - slope * gap), 0.0, 1.0)
    exact = max(zero, kink + slope * gap)
    assert found == (None if exact > 1.0 else pytest.approx(exact, abs=1e-14 / min(slope, 1.0)))


@pytest.mark.parametrize("power", [4, 6, 8, 10])
def test_located_times_converge_with_the_solver_tolerance(power):
    """x'' = -x from (0, 1): x = sin t rises through 1/2 at pi/6; the error follows the tolerance of the flow."""

    class Oscillator(hm.HybridAutomaton):
        x = hm.State(0.0)
        v = hm.State(1.0)
        done = hm.DiscreteState(0)

        def flow_map(self, s):
            return {"x": s.v, "v": -s.x}

        def jump_set(self, s):
            return hm.least(s.x - 0.5, 0.5 - s.done)

        def jump_map(self, s):
            return {"done": 1}

    tolerance = 10.0**-power
    arc = hm.simulate(
        Oscillator(), 1.0, solver=hm.Solver(method=hm.Method.RK45, rtol=max(tolerance, 1e-12), atol=tolerance)
    )
    # One step's tolerance times the handful of steps to pi/6, over the slope cos(pi/6); 100 is generous for both.
    assert arc.jumps[0].t == pytest.approx(math.pi / 6, abs=100 * tolerance)

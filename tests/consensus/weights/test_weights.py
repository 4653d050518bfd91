"""Clocks, waveforms and their integrals, against definitions, quadrature and closed forms done by hand."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from hybrid_model.consensus.clocks.clockwork import dwell_boundary, dwell_index, half_wave, half_wave_boundary
from hybrid_model.consensus.clocks.periods import common_period
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.gate import gate_boundary, gate_segment, is_open
from hybrid_model.consensus.weights.gated_sine import GatedSine, SineCarrier, WeightMap

rates = st.floats(0.05, 30.0)
phases = st.floats(-20.0, 20.0)
inner_duties = st.floats(0.5, 99.5)
times = st.floats(-100.0, 100.0)
maps = st.sampled_from(list(WeightMap))
waveforms = st.builds(
    GatedSine,
    gate_rate=rates,
    sine_rate=rates,
    duty_percent=st.one_of(inner_duties, st.sampled_from([0.0, 100.0])),
    phase=phases,
    map=maps,
)


def matlab_square(angle, duty_percent):
    """MATLAB's square: +1 for the first `duty_percent` of each period 2*pi, else -1."""
    return np.where(np.mod(angle, 2 * np.pi) < 2 * np.pi * duty_percent / 100, 1.0, -1.0)


class TestClocks:
    @given(k=st.integers(-5000, 5000), rate=rates, phase=phases, duty=inner_duties)
    @settings(max_examples=300)
    def test_a_gate_boundary_belongs_to_the_next_segment(self, k, rate, phase, duty):
        boundary = gate_boundary(k, rate, phase, duty)
        assert gate_segment(boundary, rate, phase, duty) == k + 1
        assert gate_segment(np.nextafter(boundary, -np.inf), rate, phase, duty) == k

    @given(t=times, rate=rates, phase=phases, duty=st.floats(0.0, 100.0))
    @settings(max_examples=300)
    def test_a_time_lies_within_its_segment(self, t, rate, phase, duty):
        k = gate_segment(t, rate, phase, duty)
        assert gate_boundary(k - 1, rate, phase, duty) <= t < gate_boundary(k, rate, phase, duty)

    @given(k=st.integers(-5000, 5000), rate=rates)
    @settings(max_examples=300)
    def test_half_wave_and_dwell_boundaries_belong_to_the_next_index(self, k, rate):
        assert half_wave(half_wave_boundary(k, rate), rate) == k + 1
        assert dwell_index(dwell_boundary(k, rate), rate) == k + 1

    def test_on_windows_of_the_paper_meet_a_dwell_of_pi_bit_for_bit(self):
        for j in range(100):
            start_of_window = gate_boundary(4 * j - 1, 4.0, 0.0, 20.0)  # on-window 2j starts at j*pi
            assert start_of_window == dwell_boundary(j - 1, math.pi)

    def test_extreme_duties_have_one_kind_of_segment(self):
        t = np.linspace(-10, 10, 1001)
        assert np.all(gate_segment(t, 3.0, 0.4, 0.0) % 2 == 1)
        assert np.all(gate_segment(t, 3.0, 0.4, 100.0) % 2 == 0)

    @given(t=st.floats(-50, 50), rate=rates, phase=phases, duty=inner_duties)
    @settings(max_examples=50, deadline=None)
    @pytest.mark.filterwarnings("ignore::FutureWarning")  # casadi announces a choice of numpy behaviour
    def test_the_same_lines_trace_to_symbols(self, t, rate, phase, duty):
        casadi = pytest.importorskip("casadi")
        time, gate, angle, share = (casadi.SX.sym(name) for name in ("t", "rate", "phase", "duty"))
        k = gate_segment(time, gate, angle, share)
        weight = is_open(k) * SineCarrier(5.0, WeightMap.ABS).value(time)
        outputs = [k, gate_boundary(k, gate, angle, share), half_wave(time, gate), weight]
        traced = casadi.Function("traced", [time, gate, angle, share], outputs)
        number = gate_segment(t, rate, phase, duty)
        expected = [
            number,
            gate_boundary(number, rate, phase, duty),
            half_wave(t, rate),
            abs(2 * (1 - number % 2) * math.sin(5.0 * t)),
        ]
        # Indices must be equal; products may be reordered by the tracer, hence rounding in the others.
        actual = [float(value) for value in traced(t, rate, phase, duty)]
        assert actual == pytest.approx(expected, rel=1e-13, abs=1e-13)


class TestGatedSine:
    @given(wave=waveforms, t=times)
    @settings(max_examples=200)
    def test_value_follows_the_formula_of_the_paper(self, wave, t):
        angle = wave.gate_rate * t - wave.phase
        g = (matlab_square(angle, wave.duty_percent) + 1) * np.sin(wave.sine_rate * t)
        expected = g**2 if wave.map is WeightMap.SQUARE else abs(g)
        edges = wave.breakpoints(t - 1e-9, t + 1e-9)
        if edges.size == 0:  # at a boundary itself the two computations may round to different sides
            assert float(wave.value(t)) == pytest.approx(float(expected), abs=1e-12)

    @given(wave=waveforms, t0=st.floats(-20, 20), span=st.floats(0.0, 5.0))
    @settings(max_examples=100, deadline=None)
    def test_integral_agrees_with_quadrature_piece_by_piece(self, wave, t0, span):
        cuts = [t0, *wave.breakpoints(t0, t0 + span), t0 + span]
        total = 0.0
        for a, b in pairwise(cuts):
            if wave.amplitude((a + b) / 2) == 0:
                continue  # kinks behind a closed gate are no breakpoints
            total += quad(lambda t: float(wave.carrier.value(t)), a, b, epsabs=1e-11, limit=200)[0]
        # Quadrature to 1e-11 on each piece; rounding of sin(rate*t) at rate*t up to 750 adds about 1e-13.
        assert float(wave.integral(t0, t0 + span)) == pytest.approx(total, abs=1e-10)

    @given(wave=waveforms, t=st.lists(times, min_size=3, max_size=3))
    @settings(max_examples=200)
    def test_integral_is_additive_antisymmetric_and_not_negative(self, wave, t):
        a, b, c = sorted(t)
        whole, left, right = (float(wave.integral(*pair)) for pair in ((a, c), (a, b), (b, c)))
        assert whole == pytest.approx(left + right, abs=1e-9)  # sums of up to 1000 windows
        assert float(wave.integral(c, a)) == pytest.approx(-whole, abs=1e-9)
        assert left >= -1e-12

    @given(wave=waveforms)
    @settings(max_examples=50)
    def test_integral_of_arrays_equals_the_scalar_one(self, wave):
        starts, ends = np.linspace(-3, 4, 7), np.linspace(5, 6, 7)
        scalars = [float(wave.integral(a, b)) for a, b in zip(starts, ends, strict=True)]
        np.testing.assert_allclose(wave.integral(starts, ends), scalars, atol=1e-10)
        assert wave.integral(starts[:, None], ends).shape == (7, 7)

    @given(wave=waveforms, t=st.floats(-5, 5))
    @settings(max_examples=200)
    def test_between_breakpoints_nothing_jumps(self, wave, t):
        cuts = np.array([t, *wave.breakpoints(t, t + 2.0), t + 2.0])
        assert np.all(np.diff(cuts) > 0)
        for a, b in pairwise(cuts):
            inside = np.linspace(a, b, 9)[1:-1]
            assert np.ptp(wave.amplitude(inside)) == 0

    def test_half_period_integrals_of_the_paper_are_four_on_times(self):
        # Audit, section 9: int_0^pi g_i^2 = 4 d_i, and for |g_i| (2/5)(1 - cos 5d + sin 5d).
        for i in range(4):
            duty = 20 - i * 0.1 * np.pi
            on_time = np.pi / 2 * duty / 100
            square, absolute = (GatedSine(4.0, 5.0, duty, map=kind) for kind in WeightMap)
            assert float(square.integral(0.0, np.pi)) == pytest.approx(4 * on_time, rel=1e-13)
            by_hand = 2 / 5 * (1 - np.cos(5 * on_time) + np.sin(5 * on_time))
            assert float(absolute.integral(0.0, np.pi)) == pytest.approx(by_hand, rel=1e-13)

    def test_kinks_of_the_absolute_value_are_breakpoints_and_zeros_of_the_square_are_not(self):
        kinks = GatedSine(1.0, 5.0, 100.0, map=WeightMap.ABS).breakpoints(0.0, 2.0)
        np.testing.assert_allclose(kinks, np.pi / 5 * np.arange(1, 4))
        assert GatedSine(1.0, 5.0, 100.0).breakpoints(0.0, 2.0).size == 0

    @given(rate=st.floats(0.1, 10), p=st.integers(1, 30), q=st.integers(1, 30), duty=inner_duties, phase=phases)
    @settings(max_examples=100)
    def test_the_period_of_rational_rates_is_one(self, rate, p, q, duty, phase):
        wave = GatedSine(rate * p, rate * q, duty, phase)
        period = wave.period
        assert period is not None
        # Smallest common multiple of 2 pi/(rate p) and pi/(rate q).
        common = math.lcm(2 * q, p)
        assert period == pytest.approx(common * math.pi / (rate * p * q), rel=1e-12)
        mean = float(wave.integral(0.3, 0.3 + period))
        assert float(wave.integral(1.7, 1.7 + period)) == pytest.approx(mean, rel=1e-9, abs=1e-9)

    def test_period_of_the_paper_is_pi(self):
        assert GatedSine(4.0, 5.0, 20.0).period == pytest.approx(math.pi, rel=1e-15)

    def test_incommensurable_rates_have_no_period(self):
        assert GatedSine(4.0, math.sqrt(2), 20.0).period is None

    def test_a_gate_that_never_or_always_opens(self):
        assert GatedSine(4.0, math.sqrt(2), 0.0).period == 0.0
        assert GatedSine(4.0, math.sqrt(2), 100.0).period == pytest.approx(math.pi / math.sqrt(2))

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ((0.0, 5.0, 20.0), r"gate_rate is 0.0; it must be positive"),
            ((4.0, -5.0, 20.0), r"sine_rate is -5.0; it must be positive"),
            ((4.0, 5.0, 100.1), r"duty_percent is 100.1; it must lie between 0 and 100"),
            ((4.0, math.nan, 20.0), r"sine_rate is nan; it must be a finite number"),
            ((4.0, 5.0, 20.0, math.inf), r"phase is inf; it must be a finite number"),
        ],
    )
    def test_bad_values_are_named(self, values, message):
        with pytest.raises(ValueError, match=message):
            GatedSine(*values)


class TestConstantWeight:
    def test_everything(self):
        weight = ConstantWeight(2.5)
        assert float(weight.value(3.0)) == 2.5
        np.testing.assert_array_equal(weight.value([0.0, 1.0]), [2.5, 2.5])
        assert float(weight.integral(1.0, 4.0)) == 7.5
        assert weight.breakpoints(0.0, 10.0).size == 0
        assert weight.period == 0.0

    @pytest.mark.parametrize("level", [-0.1, math.nan, math.inf])
    def test_bad_levels_are_refused(self, level):
        with pytest.raises(ValueError, match="the constant weight is"):
            ConstantWeight(level)


class TestCommonPeriod:
    def test_multiples(self):
        assert common_period([2 * math.pi, math.pi / 2, 3 * math.pi]) == pytest.approx(6 * math.pi, rel=1e-15)

    def test_constants_do_not_count(self):
        assert common_period([0.0, 1.5, 0.0]) == 1.5
        assert common_period([]) == 0.0

    def test_none_and_irrational_quotients(self):
        assert common_period([1.0, None]) is None
        assert common_period([1.0, math.sqrt(2)]) is None
        assert common_period([1.0, 1.0 + 1e-9]) is None

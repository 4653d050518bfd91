"""Waveforms of every kind: definitions, quadrature, periods, closed forms done by hand."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from drawn_times import starts
from hypothesis import given, settings
from hypothesis import strategies as st
from own_importer import Exchange, Importer
from scipy.integrate import quad

import hybrid_model as hm
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.sequence import SwitchingSequence
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.distances import distance_weights, reliability_weight
from hybrid_model.consensus.weights.edge_automata import ForeseenWeights
from hybrid_model.consensus.weights.edge_weights import EdgeWeights
from hybrid_model.consensus.weights.function import FunctionWeight
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap
from hybrid_model.consensus.weights.kinds import WeightKind, weights_block
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sampled import SampledWeight
from hybrid_model.consensus.weights.sine import SineWeight
from hybrid_model.consensus.weights.square import SquareWeight
from hybrid_model.consensus.weights.waveform import Waveform

rates = st.floats(0.05, 30.0)
phases = st.floats(-20.0, 20.0)
levels = st.floats(0.0, 5.0)
times = st.floats(-60.0, 60.0)


@st.composite
def piecewise(draw):
    begins, rest = draw(starts())
    values = draw(st.lists(levels, min_size=len(begins), max_size=len(begins)))
    cycle = begins[-1] - begins[0] + rest if draw(st.booleans()) else None
    return PiecewiseWeight(begins, tuple(values), cycle)


@st.composite
def sampled(draw):
    samples, _ = draw(starts(least=2))
    values = draw(st.lists(levels, min_size=len(samples), max_size=len(samples)))
    return SampledWeight(samples, tuple(values), draw(st.booleans()))


inner_duties = st.floats(0.5, 99.5)
duties = st.one_of(inner_duties, st.sampled_from([0.0, 100.0]))
gated = st.builds(GatedSine, rates, rates, duties, phases, st.sampled_from(list(WeightMap)))
waveforms = st.one_of(
    st.builds(ConstantWeight, levels),
    gated,
    st.builds(SineWeight, levels, st.floats(0.0, 1.0), rates, phases),
    st.builds(SquareWeight, levels, levels, rates, duties, phases),
    piecewise(),
    sampled(),
    st.sampled_from(
        [
            FunctionWeight(lambda t: np.exp(np.sin(t)), period=2 * math.pi),
            FunctionWeight(lambda t: np.abs(np.sin(2 * t)), (0.0,), math.pi / 2),
            FunctionWeight(lambda t: 1 / (1 + t**2)),
            FunctionWeight(lambda t: np.maximum(1 - np.abs(t - 3), 0.0), (2.0, 3.0, 4.0)),
        ]
    ),
)


def by_quadrature(wave, t0, t1):
    """Integral of the values, piece by piece between the breakpoints."""
    cuts = [t0, *wave.breakpoints(t0, t1), t1]
    return sum(quad(inside, a, b, args=(wave, a, b), epsabs=1e-11, limit=200)[0] for a, b in pairwise(cuts))


def inside(t, wave, a, b):
    """The value at t or, at the ends of the piece, just inside it: a jump belongs to the neighbour."""
    return float(wave.value(min(max(t, a), math.nextafter(b, a))))


class TestEveryKind:
    @given(wave=waveforms, t=times)
    @settings(max_examples=200)
    def test_is_a_waveform_whose_value_is_amplitude_times_carrier(self, wave, t):
        assert isinstance(wave, Waveform)
        product = float(wave.amplitude(t)) * float(wave.carrier.value(t))
        assert float(wave.value(t)) == pytest.approx(product, rel=1e-15)
        assert float(wave.value(t)) >= 0

    @given(wave=waveforms, t0=st.floats(-12, 12), span=st.floats(0.0, 6.0))
    @settings(max_examples=150, deadline=None)
    def test_integral_agrees_with_quadrature(self, wave, t0, span):
        # Quadrature to 1e-11 on each piece; rounding of a phase of up to some hundred adds about 1e-13.
        allowed = 1e-11 * (10 + len(wave.breakpoints(t0, t0 + span)))
        assert float(wave.integral(t0, t0 + span)) == pytest.approx(by_quadrature(wave, t0, t0 + span), abs=allowed)

    @given(wave=waveforms, t=st.lists(times, min_size=3, max_size=3))
    @settings(max_examples=150)
    def test_integral_is_additive_and_antisymmetric(self, wave, t):
        a, b, c = sorted(t)
        whole, left, right = (float(wave.integral(*pair)) for pair in ((a, c), (a, b), (b, c)))
        assert whole == pytest.approx(left + right, abs=1e-9)
        assert float(wave.integral(c, a)) == pytest.approx(-whole, abs=1e-9)
        assert left >= -1e-12

    @given(wave=waveforms, t=times, cycles=st.integers(1, 4))
    @settings(max_examples=200)
    def test_period_repeats_values_integrals_and_breakpoints(self, wave, t, cycles):
        period = wave.period
        if period is None:
            return
        span = cycles * (period or 1.0)
        assert float(wave.integral(t, t + span)) == pytest.approx(
            cycles * float(wave.integral(0.0, period or 1.0)), rel=1e-11, abs=1e-8
        )
        if period > 0:
            # A gate and a sine may have breakpoints that are one up to rounding.
            extra = 1 if not isinstance(wave, GatedSine) else np.inf
            assert len(wave.breakpoints(t, t + period)) <= len(wave.breakpoints(0.0, period)) + extra
            near = wave.breakpoints(t - 1e-9, t + 1e-9)
            if near.size == 0:  # at a breakpoint itself the two computations may round to different sides
                assert float(wave.value(t + period)) == pytest.approx(float(wave.value(t)), abs=1e-6)

    @given(wave=waveforms, t=times)
    @settings(max_examples=150)
    def test_nothing_jumps_between_breakpoints(self, wave, t):
        cuts = np.array([t, *wave.breakpoints(t, t + 2.0), t + 2.0])
        assert np.all(np.diff(cuts) > 0)
        for a, b in pairwise(cuts):
            assert np.ptp(wave.amplitude(np.linspace(a, b, 9)[1:-1])) == 0

    @given(wave=waveforms)
    @settings(max_examples=60)
    def test_arrays_equal_scalars(self, wave):
        begins, ends = np.linspace(-3, 4, 7), np.linspace(5, 6, 7)
        scalars = [float(wave.integral(a, b)) for a, b in zip(begins, ends, strict=True)]
        np.testing.assert_allclose(wave.integral(begins, ends), scalars, atol=1e-10)
        assert wave.integral(begins[:, None], ends).shape == (7, 7)
        np.testing.assert_array_equal(wave.value(begins), [float(wave.value(t)) for t in begins])


ONE_OF_EACH = {
    WeightKind.GATED_SINE: GatedSine(4.0, 5.0, 60.0, 0.3),
    WeightKind.CONSTANT: ConstantWeight(0.7),
    WeightKind.SINE: SineWeight(1.0, 0.5, 3.0, 0.2),
    WeightKind.SQUARE: SquareWeight(2.0, 0.3, 3.0, 40.0),
    WeightKind.PIECEWISE: PiecewiseWeight((0.0, 1.0), (0.4, 2.0), 1.6),
    WeightKind.SAMPLED: SampledWeight((0.0, 1.0, 2.0), (0.2, 1.0, 0.5), repeat=True),
    WeightKind.FUNCTION: FunctionWeight(lambda t: np.exp(np.sin(t)), period=2 * math.pi),
}


@pytest.mark.parametrize("kind", WeightKind)
def test_the_edges_of_an_agent_have_the_value_of_the_data(kind):
    wave = ONE_OF_EACH[kind]
    for end in (0.1, 2.7):
        weights = hm.simulate(weights_block([wave, wave]), end)["weights"]
        np.testing.assert_allclose(weights[-1], float(wave.value(end)), rtol=1e-14)


@pytest.mark.parametrize(
    "kind", [kind for kind in WeightKind if issubclass(ONE_OF_EACH[kind].automaton, ForeseenWeights)]
)
@given(start=st.floats(0.0, 20.0), span=st.floats(0.0, 5.0), weight_map=st.sampled_from(list(WeightMap)))
@settings(max_examples=30, deadline=None)
@pytest.mark.filterwarnings("ignore::FutureWarning")  # casadi announces a choice of numpy behaviour
def test_one_formula_serves_numbers_arrays_and_symbols(kind, start, span, weight_map):
    casadi = pytest.importorskip("casadi")
    wave = ONE_OF_EACH[kind]
    carrier = replace(wave, map=weight_map).carrier if isinstance(wave, GatedSine) else wave.carrier
    a, b = casadi.SX.sym("a"), casadi.SX.sym("b")
    traced = casadi.Function("traced", [a, b], [carrier.value(a), carrier.integral(a, b)])
    numbers = [float(carrier.value(start)), float(carrier.integral(start, start + span))]
    assert [float(found) for found in traced(start, start + span)] == pytest.approx(numbers, rel=1e-13, abs=1e-13)
    times = np.array([start, start + span])
    arrays = [carrier.value(times)[0], carrier.integral(times[:1], times[1:])[0]]
    assert arrays == pytest.approx(numbers, rel=1e-14, abs=1e-15)


def matlab_square(angle, duty_percent):
    """MATLAB's square: +1 for the first `duty_percent` of each period 2*pi, else -1."""
    return np.where(np.mod(angle, 2 * np.pi) < 2 * np.pi * duty_percent / 100, 1.0, -1.0)


class TestGatedSine:
    @given(wave=gated, t=times)
    @settings(max_examples=200)
    def test_value_follows_the_formula_of_the_paper(self, wave, t):
        angle = wave.gate_rate * t - wave.phase
        g = (matlab_square(angle, wave.duty_percent) + 1) * np.sin(wave.sine_rate * t)
        expected = g**2 if wave.map is WeightMap.SQUARE else abs(g)
        edges = wave.breakpoints(t - 1e-9, t + 1e-9)
        if edges.size == 0:  # at a boundary itself the two computations may round to different sides
            assert float(wave.value(t)) == pytest.approx(float(expected), abs=1e-12)

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


def samples_that_end_at_zero(top, end):
    """A saw tooth: its last row falls to 0, where rounding leaves what is computed from its beginning below."""
    return SampledWeight((0.0, 0.3, end), (top / 3, top, 0.0), repeat=True)


def touching_zero(t):
    """The positive part of a sine, and a sum that is 0 up to rounding."""
    return np.maximum(np.sin(t), 0.0) + (1.0 - np.cos(t) ** 2 - np.sin(t) ** 2)


class TestNeverNegative:
    """Weights touch zero, and rounding decides on which side of it: just before, at and just after each breakpoint."""

    @given(top=st.floats(0.1, 5.0), end=st.floats(0.4, 3.0), zeros=st.integers(0, 3), k=st.integers(-2000, 2000))
    @settings(max_examples=300)
    def test_samples_at_the_ends_of_rows(self, top, end, zeros, k):
        pad = tuple(0.3 * n / (zeros + 1) for n in range(1, zeros + 1))
        wave = SampledWeight((0.0, *pad, 0.3, end), (0.0, *(0.0 for _ in pad), top, 0.0), repeat=True)
        clock = wave.carrier.clock
        begins = clock.begin(np.arange(k * clock.rows, (k + 1) * clock.rows))
        times = np.concatenate([np.nextafter(begins, -np.inf), begins, np.nextafter(begins, np.inf)])
        assert wave.value(times).min() >= 0

    def test_samples_just_below_a_multiple_of_the_period(self):
        wave = SampledWeight((0.0, 1, 2, 3, 4, 5, 5.40625), (0.0, 0, 0, 0, 2.625, 1.125, 0), repeat=True)
        assert float(wave.value(-7.6e-105)) == 0.0

    def test_a_function_that_rounding_leaves_below_zero(self):
        wave = FunctionWeight(touching_zero, period=2 * math.pi)
        times = np.linspace(0.0, 6.0, 500)
        assert wave.carrier.raw(times).min() < 0
        assert wave.value(times).min() == 0

    @pytest.mark.parametrize("end", [0.7, 0.9, 1.1])
    def test_in_runs(self, end):
        block = weights_block([samples_that_end_at_zero(1.3, end)])
        for arc in (hm.simulate(block, 20.0, engine=engine) for engine in ("python", "native")):
            assert arc["weights"].min() == 0.0

    def test_a_function_in_runs(self):
        block = weights_block([FunctionWeight(touching_zero)])
        for arc in (hm.simulate(block, 20.0, engine=engine) for engine in ("python", "native")):
            assert arc["weights"].min() == 0.0

    @pytest.mark.parametrize("fmi", ["2.0", "3.0"])
    def test_in_fmus(self, exported, fmi):
        # An importer reads the output where a row ends and before it says so: the row still holds.
        path = exported(weights_block([samples_that_end_at_zero(1.3, 0.7)]), key="falling_samples", fmi=fmi)
        found = []
        with Importer(path, "me") as importer:
            importer.initialize(20.0)
            exchange = Exchange(importer, 20.0, (), {}, ())
            exchange.iterate()
            while exchange.next_event < 20.0:
                importer.fmu.enterContinuousTimeMode()
                importer.fmu.setTime(exchange.next_event)
                found.append(importer.get("weights[1]"))
                importer.fmu.enterEventMode()
                exchange.iterate()
        assert len(found) == 57  # 28 whole periods, and one row more
        assert min(found) == 0.0


class TestByHand:
    def test_constant(self):
        weight = ConstantWeight(2.5)
        np.testing.assert_array_equal(weight.value([0.0, 1.0]), [2.5, 2.5])
        assert float(weight.integral(1.0, 4.0)) == 7.5
        assert weight.breakpoints(0.0, 10.0).size == 0
        assert weight.period == 0.0

    def test_sine(self):
        wave = SineWeight(2.0, 0.5, 3.0, 0.7)
        assert float(wave.value(1.1)) == pytest.approx(2 + math.sin(3 * 1.1 - 0.7))
        assert wave.period == pytest.approx(2 * math.pi / 3)
        assert SineWeight(2.0, 0.0, 3.0).period == 0.0

    def test_square(self):
        wave = SquareWeight(3.0, 1.0, math.pi, 25.0)  # period 2 s, high for half a second
        np.testing.assert_array_equal(wave.value([0.0, 0.49, 0.5, 1.99, 2.0]), [3.0, 3.0, 1.0, 1.0, 3.0])
        assert float(wave.integral(0.0, 3.0)) == pytest.approx(3 + 2 * (0.5 + 0.5))
        assert wave.period == 2.0
        assert SquareWeight(1.0, 1.0, 2.0, 25.0).period == 0.0

    def test_piecewise(self):
        once = PiecewiseWeight((1.0, 2.0, 4.0), (5.0, 0.0, 2.0))
        np.testing.assert_array_equal(once.value([-9.0, 1.9, 2.0, 3.9, 4.0, 99.0]), [5.0, 5.0, 0.0, 0.0, 2.0, 2.0])
        assert float(once.integral(0.0, 6.0)) == 5 * 2 + 2 * 2
        assert once.period is None
        again = PiecewiseWeight((1.0, 2.0, 4.0), (5.0, 0.0, 2.0), cycle=4.0)
        np.testing.assert_array_equal(again.value([0.5, 1.0, 5.0, 6.5, 8.9]), [2.0, 5.0, 5.0, 0.0, 2.0])
        assert float(again.integral(1.0, 401.0)) == pytest.approx(100 * (5 + 0 + 2), rel=1e-13)
        np.testing.assert_array_equal(again.breakpoints(0.0, 6.0), [1.0, 2.0, 4.0, 5.0])

    def test_samples_that_repeat_jump_back_and_others_stay(self):
        ramp = SampledWeight((0.0, 1.0, 3.0), (0.0, 2.0, 4.0), repeat=True)
        np.testing.assert_allclose(ramp.value([0.5, 2.0, 3.0, 3.5, -0.5]), [1.0, 3.0, 0.0, 1.0, 3.5])
        assert ramp.period == 3.0
        assert float(ramp.integral(0.0, 30.0)) == pytest.approx(10 * (1 + 6))
        once = SampledWeight((0.0, 1.0, 3.0), (1.0, 2.0, 4.0))
        np.testing.assert_allclose(once.value([-5.0, 3.0, 50.0]), [1.0, 4.0, 4.0])
        assert once.domain == (0.0, 3.0)

    def test_proportional_samples_share_their_carrier(self):
        shape, double = (0.0, 1.0, 2.0), (0.0, 2.0, 4.0)
        weights = EdgeWeights(tuple(SampledWeight((0.0, 1.0, 3.0), v) for v in (shape, double)), NoSwitching(2))
        piece = weights.pieces(0.0, 3.0)[0]
        assert piece.shared_carrier is not None
        np.testing.assert_array_equal(piece.amplitudes, [2.0, 4.0])
        assert EdgeWeights((SquareWeight(1.0, 0.2, 1.0, 30.0),), NoSwitching(1)).pieces(0, 1)[0].carriers == (
            UnitCarrier(),
        )

    def test_reliability(self):
        wave = reliability_weight(lambda r: 2 * r**2, lambda t: 0.5 + 0.5 * np.cos(t), period=2 * math.pi)
        # The mean of (1 + cos)^2/2 is 3/4.
        assert float(wave.integral(0.0, 2 * math.pi)) == pytest.approx(2 * math.pi * 0.75, rel=1e-13)

    def test_distance(self):
        # Agent 1 rests, agent 2 swings from 0 to 2; the radio reaches 1.5, with a kink where d = 1.5.
        still, moving = (lambda t: (0.0 * t,)), (lambda t: (1 - np.cos(t),))
        (wave,) = distance_weights(
            [(1, 2)], [still, moving], lambda d: np.maximum(1.5 - d, 0.0), bends=[1.5], horizon=9.0, period=2 * math.pi
        )
        out = math.acos(-0.5)
        np.testing.assert_allclose(wave.kinks, [out, 2 * math.pi - out], rtol=1e-12)
        assert float(wave.value(math.pi)) == 0.0
        expected = 2 * (0.5 * out + math.sin(out))  # 1.5 - 1 + cos t
        assert float(wave.integral(0.0, 2 * math.pi)) == pytest.approx(expected, rel=1e-12)

    def test_integral_through_an_unannounced_kink_is_refined(self):
        wave = FunctionWeight(lambda t: np.abs(t - 1 / 3))
        assert float(wave.integral(0.0, 1.0)) == pytest.approx((1 / 9 + 4 / 9) / 2, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GatedSine(0.0, 5.0, 20.0), r"gate_rate is 0.0; it must be positive"),
        (lambda: GatedSine(4.0, -5.0, 20.0), r"sine_rate is -5.0; it must be positive"),
        (lambda: GatedSine(4.0, 5.0, 100.1), r"duty_percent is 100.1; it must lie between 0 and 100"),
        (lambda: GatedSine(4.0, math.nan, 20.0), r"sine_rate is nan; it must be a finite number"),
        (lambda: GatedSine(4.0, 5.0, 20.0, math.inf), r"phase is inf; it must be a finite number"),
        (lambda: ConstantWeight(-0.1), "the constant weight is -0.1; it must not be negative"),
        (lambda: ConstantWeight(math.nan), "the constant weight is nan; it must be a finite number"),
        (lambda: ConstantWeight(math.inf), "the constant weight is inf; it must be a finite number"),
        (lambda: SineWeight(-1.0, 0.5, 1.0), "mean is -1.0; it must not be negative"),
        (lambda: SineWeight(1.0, 1.5, 1.0), "depth is 1.5; it must lie between 0 and 1, else the weight is negative"),
        (lambda: SineWeight(1.0, 0.5, 0.0), "rate is 0.0; it must be positive"),
        (lambda: SquareWeight(1.0, -0.5, 1.0, 20.0), "low is -0.5; it must not be negative"),
        (lambda: SquareWeight(1.0, 0.5, 1.0, 120.0), "duty_percent is 120.0; it must lie between 0 and 100"),
        (lambda: PiecewiseWeight((), ()), "starts is empty"),
        (lambda: PiecewiseWeight((0.0, 1.0), (1.0,)), "values lists 1 numbers for 2 starts; give one for each"),
        (lambda: PiecewiseWeight((0.0, 0.0), (1.0, 2.0)), r"starts\[2\] is 0.0; it must be later than the one before"),
        (lambda: PiecewiseWeight((0.0, 2.0), (1.0, 2.0), 2.0), "cycle is 2.0; it must be longer than 2.0"),
        (lambda: PiecewiseWeight((0.0,), (-1.0,)), r"values\[1\] is -1.0; it must not be negative"),
        (lambda: SampledWeight((0.0,), (1.0,)), "times lists 1 samples; there must be at least 2"),
        (lambda: SampledWeight((0.0, math.nan), (1.0, 1.0)), r"times\[2\] is nan; it must be a finite number"),
        (lambda: FunctionWeight(lambda t: np.sin(t) ** 2 - 1e-9), "the weight at t = 0 is -1e-09; it must not be neg"),
        (lambda: FunctionWeight(lambda t: np.cos(t)), "the weight at t = .* must not be negative"),
        (
            lambda: FunctionWeight(lambda t: t, period=1.0),
            "period is 1.0, but the weight is 0 at t = 0 and 1 one period",
        ),
        (lambda: FunctionWeight(lambda t: t * t, period=-1.0), "period is -1.0; it must be positive"),
    ],
)
def test_bad_values_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_edge_weights_follow_a_sequence():
    wave = SineWeight(1.0, 0.8, 2.0)
    sequence = SwitchingSequence((0.5, 1.25), ((1,), (2,)), 2, repeat=True)
    weights = EdgeWeights((wave, wave), sequence)
    cuts = [0.0, 0.5, 1.75, 2.25, 3.0]
    parts = [float(wave.integral(a, b)) for a, b in pairwise(cuts)]
    np.testing.assert_allclose(weights.integral(0.0, 3.0), [parts[0] + parts[2], parts[1] + parts[3]], rtol=1e-13)
    primitive = weights.primitive(0.0, 3.0)
    np.testing.assert_allclose(
        primitive(np.array([0.0, 1.1, 3.0])), [weights.integral(0.0, t) for t in (0.0, 1.1, 3.0)], atol=1e-14
    )

"""The clocks of gates, half waves, dwell intervals and rows, for floats and symbols; common periods."""

import math

import numpy as np
import pytest
from drawn_times import starts
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid_model.consensus.clocks.intervals import dwell_boundary, dwell_index, half_wave, half_wave_boundary
from hybrid_model.consensus.clocks.periods import common_period
from hybrid_model.consensus.clocks.rows import RowClock, row_begin, row_number
from hybrid_model.consensus.weights.gate import gate_boundary, gate_segment, is_open
from hybrid_model.consensus.weights.gated_sine import SineCarrier, WeightMap

rates = st.floats(0.05, 30.0)
phases = st.floats(-20.0, 20.0)
inner_duties = st.floats(0.5, 99.5)
times = st.floats(-100.0, 100.0)


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


class TestRowClock:
    @given(table=starts(), k=st.integers(-3000, 3000), repeats=st.booleans())
    @settings(max_examples=300)
    def test_a_computed_beginning_lies_in_its_row(self, table, k, repeats):
        begins, rest = table
        clock = RowClock(begins, begins[-1] - begins[0] + rest if repeats else None)
        number = k if repeats else k % clock.rows
        begin = float(clock.begin(number))
        assert int(clock.number(begin)) == number
        if repeats or number > 0:
            assert int(clock.number(math.nextafter(begin, -math.inf))) == number - 1
        # The form that is traced gives the same bits.
        period = clock.period or 0.0
        assert row_begin(number, np.array(begins), period) == begin
        assert row_number(begin, np.array(begins), period) == number

    @given(table=starts(), t=times, repeats=st.booleans())
    @settings(max_examples=300)
    def test_both_forms_find_the_same_row(self, table, t, repeats):
        begins, rest = table
        clock = RowClock(begins, begins[-1] - begins[0] + rest if repeats else None)
        number = int(clock.number(t))
        assert row_number(t, np.array(begins), clock.period or 0.0) == number
        assert t < clock.begin(number + 1)
        assert t >= clock.begin(number) or (not repeats and number == 0)

    def test_behind_the_last_row_there_is_none(self):
        clock = RowClock((0.0, 1.0))
        assert float(clock.begin(2)) == math.inf
        assert row_begin(2, np.array([0.0, 1.0]), 0.0) == math.inf
        assert clock.breakpoints(0.0, 100.0).tolist() == [1.0]


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

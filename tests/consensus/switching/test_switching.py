"""Cyclic switching, and the weights of all edges under it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.edge_weights import EdgeWeights
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap

TWO_TREES = SwitchingCycle(math.pi, ((1, 2, 3), (2, 3, 4)), 4)
MIXED = EdgeWeights(
    (
        GatedSine(4.0, 5.0, 35.0, phase=0.3),
        GatedSine(4.0, 3.0, 60.0, map=WeightMap.ABS),
        ConstantWeight(0.7),
    ),
    SwitchingCycle(1.1, ((1, 2), (), (2, 3)), 3),
)


def test_phases_cycle_and_begin_at_their_instants():
    assert [TWO_TREES.phase(t) for t in (0.0, 3.0, math.pi, 6.0, 2 * math.pi)] == [0, 0, 1, 1, 0]
    np.testing.assert_array_equal(TWO_TREES.active_at(0.0), [True, True, True, False])
    np.testing.assert_array_equal(TWO_TREES.active_at(math.pi), [False, True, True, True])


@given(j=st.integers(0, 10_000), dwell=st.floats(0.01, 100))
@settings(max_examples=200)
def test_a_computed_switching_instant_begins_the_next_phase(j, dwell):
    switching = SwitchingCycle(dwell, ((1,), (2,), ()), 2)
    assert switching.phase(j * dwell) == j % 3


def test_breakpoints_are_strictly_inside():
    np.testing.assert_array_equal(TWO_TREES.breakpoints(0.0, 3 * math.pi), [math.pi, 2 * math.pi])
    assert TWO_TREES.breakpoints(1.0, 1.0).size == 0
    assert NoSwitching(4).breakpoints(0.0, 100.0).size == 0


def test_periods():
    assert TWO_TREES.period == 2 * math.pi
    assert SwitchingCycle(1.0, ((1, 2), (2, 1)), 2).period == 0.0
    assert NoSwitching(2).period == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, ((1,),), 1), "dwell is 0.0; it must be a positive"),
        ((math.inf, ((1,),), 1), "dwell is inf"),
        ((1.0, (), 1), "active is empty"),
        ((1.0, ((1,), (3,)), 2), "active phase 2 names edge 3; edges are numbered from 1 to 2"),
        ((1.0, ((0,),), 2), "active phase 1 names edge 0"),
        ((1.0, ((1, 1),), 2), r"active phase 1 is \[1, 1\]; each edge may be listed only once"),
    ],
)
def test_bad_values_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        SwitchingCycle(*arguments)


class TestEdgeWeights:
    @given(t0=st.floats(0.0, 10.0), span=st.floats(0.0, 4.0))
    @settings(max_examples=50, deadline=None)
    def test_integral_agrees_with_quadrature_piece_by_piece(self, t0, span):
        total = np.zeros(3)
        for piece in MIXED.pieces(t0, t0 + span):
            for edge in np.flatnonzero(piece.amplitudes):
                value = piece.carriers[edge].value
                total[edge] += piece.amplitudes[edge] * quad(lambda t, f=value: float(f(t)), piece.start, piece.end)[0]
        np.testing.assert_allclose(MIXED.integral(t0, t0 + span), total, atol=1e-10)  # quad: 1.5e-8 relative, smooth

    @given(t=st.floats(0.0, 50.0))
    @settings(max_examples=100)
    def test_value_is_amplitude_times_carrier(self, t):
        product = MIXED.amplitudes(t) * [float(carrier.value(t)) for carrier in MIXED.carriers]
        np.testing.assert_allclose(MIXED.value(t), product, atol=1e-15)

    def test_inactive_edges_carry_no_weight(self):
        assert not MIXED.value(1.5).any()
        np.testing.assert_array_equal(MIXED.integral(1.1, 2.2), 0.0)

    def test_integral_of_arrays_equals_the_scalar_one(self):
        starts = np.linspace(0.0, 9.0, 13)
        rows = [MIXED.integral(start, start + 2.5) for start in starts]
        np.testing.assert_allclose(MIXED.integral(starts, starts + 2.5), rows, atol=1e-13)

    def test_instants_that_agree_up_to_rounding_are_one_breakpoint(self):
        weights = EdgeWeights((GatedSine(4.0, 5.0, 20.0, map=WeightMap.ABS),) * 4, TWO_TREES)
        times = weights.breakpoints(0.0, 100.0)
        assert np.diff(times).min() > 1e-3

    def test_period_spans_waveforms_and_switching(self):
        assert EdgeWeights((GatedSine(4.0, 5.0, 20.0),) * 4, TWO_TREES).period == pytest.approx(2 * math.pi)
        assert MIXED.period is None
        assert EdgeWeights((ConstantWeight(1.0),), NoSwitching(1)).period == 0.0

    def test_the_number_of_edges_must_agree(self):
        with pytest.raises(ValueError, match="2 waveforms, but the switching is for 4"):
            EdgeWeights((ConstantWeight(1.0),) * 2, TWO_TREES)

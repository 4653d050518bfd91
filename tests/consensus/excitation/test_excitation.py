"""Excitation constants and the Floquet rate: published values, closed forms, quadrature, a general ODE solver."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from hybrid_model.consensus.exact.floquet import floquet_spectrum, transition_matrix
from hybrid_model.consensus.excitation.norm_integral import NormPrimitive
from hybrid_model.consensus.excitation.persistence import (
    Signal,
    excitation_constants,
    scenario_excitation,
    signal_factor,
)
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.edge_weights import EdgeWeights
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap

PUBLISHED = 1e-6  # the reference values are given with six decimals


@pytest.fixture(scope="module")
def paper():
    return load_scenario("paper-a")


def mixed_scenario():
    """Edges of three different shapes, overlapping, so that nothing is a scalar times a constant matrix."""
    scenario = read_scenario(
        {
            "name": "mixed",
            "stop_time": 1.0,
            "network": {"agents": 3, "edges": [[1, 2], [2, 3], [3, 1]], "initial": [0.0, 0.0, 0.0], "gain": 0.8},
            "weights": {
                "kind": "gated-sine",
                "gate_rate": 2.0,
                "sine_rate": [1.0, 3.0, 2.0],
                "duty_percent": [40.0, 70.0, 55.0],
                "phase": [0.0, 1.0, -1.0],
            },
            "switching": {"dwell": math.pi, "active": [[1, 2, 3], [1, 2]]},
            "trigger": {"kind": "static", "threshold": 0.1},
        }
    )
    first, second, third = scenario.weights.waveforms
    return replace(
        scenario, weights=replace(scenario.weights, waveforms=(first, replace(second, map=WeightMap.ABS), third))
    )


class TestPublishedReferenceValuesOfScenarioA:
    @pytest.mark.parametrize(
        ("signal", "expected"),
        [
            (Signal.TREE_WEIGHTS, {"mu1": 1.256637, "mu2": 2.473796}),
            (Signal.TREE_COORDINATES, {"mu1": 1.577391, "mu2": 5.725561, "mu2_bar": 5.764946}),
            (Signal.DISAGREEMENT, {"mu1": 2.990276, "mu2": 8.052068, "mu2_bar": 8.441277, "frobenius": 9.345300}),
        ],
    )
    def test_excitation(self, paper, signal, expected):
        constants = scenario_excitation(paper, signal)
        assert constants.window == pytest.approx(2 * math.pi)
        for name, value in expected.items():
            assert getattr(constants, name) == pytest.approx(value, abs=PUBLISHED), name

    def test_floquet(self, paper):
        spectrum = floquet_spectrum(paper)
        assert spectrum.rate == pytest.approx(0.468778, abs=PUBLISHED)
        np.testing.assert_allclose(spectrum.multipliers, [0.0525799, 0.0262069, 0.000292459], atol=1e-7)


class TestRelationsBetweenTheSignals:
    """Audit, section 1; each holds for any tree of the underlying graph."""

    @pytest.mark.parametrize("tree", [(1, 2, 3), (2, 3, 4), (1, 5, 4)])
    def test_coordinates_of_a_tree_bound_the_tree_free_ones(self, paper, tree):
        partition = TreePartition(4, paper.network.underlying_edges, tree)
        weights, m, n = (scenario_excitation(paper, signal, partition) for signal in Signal)
        smallest, largest = partition.Lambda[[0, -1]]
        slack = 1 + 1e-12
        assert smallest * m.mu1 <= n.mu1 * slack
        assert n.mu2 <= largest * m.mu2 * slack
        assert weights.mu1 <= m.mu1 * slack
        for constants in (weights, m, n):
            assert constants.mu1 <= constants.mu2 <= constants.mu2_bar * slack <= 3 * constants.mu2 * slack

    def test_a_tree_with_an_edge_without_weight_is_not_exciting(self, paper):
        partition = TreePartition(4, paper.network.underlying_edges, (1, 2, 5 + 1))
        assert scenario_excitation(paper, Signal.TREE_WEIGHTS, partition).mu1 == 0.0


class TestWindows:
    def test_constant_weights_give_the_spectrum_of_the_laplacian(self):
        factor = disagreement_basis(4).T @ incidence(4, ((1, 2), (2, 3), (3, 4)))
        weights = EdgeWeights((ConstantWeight(1.0),) * 3, NoSwitching(3))
        constants = excitation_constants(factor, weights, window=0.5)
        # Path with three edges: 2 - 2 cos(i pi/4).
        spectrum = 2 - 2 * np.cos(np.arange(1, 4) * np.pi / 4)
        assert constants.mu1 == pytest.approx(0.5 * spectrum[0], rel=1e-12)
        assert constants.mu2 == pytest.approx(0.5 * spectrum[-1], rel=1e-12)
        assert constants.mu2_bar == pytest.approx(0.5 * spectrum[-1], rel=1e-12)
        assert constants.frobenius == pytest.approx(0.5 * np.linalg.norm(spectrum), rel=1e-12)

    def test_rotating_excitation_attains_the_factor_p(self):
        # Audit, section 5.1: M = e_i e_i^T on the i-th third of the window; the integrated norm is p times mu2.
        weights = EdgeWeights((ConstantWeight(2.0),) * 3, SwitchingCycle(1.0, ((1,), (2,), (3,)), 3))
        constants = excitation_constants(np.eye(3), weights)
        assert constants.window == 3.0
        assert (constants.mu1, constants.mu2, constants.mu2_bar) == pytest.approx((2.0, 2.0, 6.0))

    def test_a_single_gate_has_its_extremes_where_the_hand_finds_them(self):
        # Weight 1 on [0, 1), 0 on [1, 2), window 1.5: at worst .5 of it is on, at best 1.
        weights = EdgeWeights((ConstantWeight(1.0),), SwitchingCycle(1.0, ((1,), ()), 1))
        constants = excitation_constants(np.ones((1, 1)), weights, window=1.5)
        assert constants.mu1 == pytest.approx(0.5, abs=1e-12)
        assert constants.mu2 == pytest.approx(1.0, abs=1e-12)

    @pytest.mark.parametrize("window", [2.0, 4.0])
    def test_no_window_of_a_dense_scan_is_outside(self, window):
        scenario = mixed_scenario()
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        constants = excitation_constants(factor, scenario.edge_weights, window)
        starts = np.linspace(0.0, scenario.edge_weights.period, 4001)
        integrals = scenario.edge_weights.integral(starts, starts + window)
        eigenvalues = np.linalg.eigvalsh(np.einsum("re,se,qe->srq", factor, integrals, factor))
        assert constants.mu1 <= eigenvalues[:, 0].min() + 1e-9
        assert constants.mu2 >= eigenvalues[:, -1].max() - 1e-9
        # The scan's step is 1.6e-3 s and the extrema are smooth or at corners: it finds them to a few 1e-3.
        assert constants.mu1 == pytest.approx(eigenvalues[:, 0].min(), abs=5e-3)
        assert constants.mu2 == pytest.approx(eigenvalues[:, -1].max(), abs=5e-3)

    def test_scenario_a_needs_a_window_longer_than_the_tree_is_off(self, paper):
        # Audit, section 8: a window of the tree G1 has mu1 > 0 only beyond 4.45 s, without a tree beyond 1.26 s.
        assert scenario_excitation(paper, Signal.TREE_WEIGHTS, window=4.3).mu1 == pytest.approx(0.0, abs=1e-12)
        assert scenario_excitation(paper, Signal.TREE_WEIGHTS, window=4.6).mu1 > 1e-4
        assert scenario_excitation(paper, Signal.DISAGREEMENT, window=1.25).mu1 == pytest.approx(0.0, abs=1e-12)
        assert scenario_excitation(paper, Signal.DISAGREEMENT, window=1.4).mu1 > 1e-4

    def test_windows_that_make_no_sense_are_refused(self, paper):
        constant = EdgeWeights((ConstantWeight(1.0),), NoSwitching(1))
        aperiodic = EdgeWeights((GatedSine(1.0, math.sqrt(2), 20.0),), NoSwitching(1))
        with pytest.raises(ValueError, match="every window length will do; say which"):
            excitation_constants(np.eye(1), constant)
        with pytest.raises(ValueError, match="no common period"):
            excitation_constants(np.eye(1), aperiodic)
        with pytest.raises(ValueError, match="window is -1"):
            scenario_excitation(paper, Signal.DISAGREEMENT, window=-1.0)


def test_norm_integral_agrees_with_adaptive_quadrature():
    scenario = mixed_scenario()
    factor = signal_factor(scenario, Signal.DISAGREEMENT)
    weights = scenario.edge_weights
    primitive = NormPrimitive(factor, weights, 0.0, 7.0)
    for end in (0.3, 2.9, 7.0):
        total = 0.0
        for piece in weights.pieces(0.0, end):

            def norm(t, piece=piece):
                values = piece.amplitudes * [float(carrier.value(t)) for carrier in piece.carriers]
                return np.linalg.norm((factor * values) @ factor.T, 2)

            total += quad(norm, piece.start, piece.end, epsabs=1e-11, epsrel=1e-11, limit=500)[0]
        assert primitive(np.array([end]))[0] == pytest.approx(total, abs=1e-9)


def test_norm_integral_through_a_crossing_of_eigenvalues():
    # Two edges on their own: the norm is max(4 sin^2 t, 1), with a kink at sin t = 1/2.
    weights = EdgeWeights((GatedSine(0.5, 1.0, 100.0), ConstantWeight(1.0)), NoSwitching(2))
    primitive = NormPrimitive(np.eye(2), weights, 0.0, math.pi / 2)
    kink, end = math.pi / 6, math.pi / 2
    expected = kink + 2 * (end - kink) + math.sin(2 * kink)  # 4 sin^2 = 2 - 2 cos 2t
    assert primitive(np.array([end]))[0] == pytest.approx(expected, abs=1e-10)


class TestFloquet:
    def test_constant_weights_decay_with_the_algebraic_connectivity(self):
        entries = {
            "name": "path",
            "stop_time": 1.0,
            "network": {"agents": 4, "edges": [[1, 2], [2, 3], [3, 4]], "initial": [0.0] * 4, "gain": 3.0},
            "weights": {"kind": "constant", "value": 0.5},
            "trigger": {"kind": "static", "threshold": 0.1},
        }
        rate = floquet_spectrum(read_scenario(entries)).rate
        assert rate == pytest.approx(3.0 * 0.5 * (2 - math.sqrt(2)), rel=1e-12)

    @pytest.mark.parametrize("make", [mixed_scenario, lambda: load_scenario("paper-a")])
    def test_transition_matrix_agrees_with_a_general_solver(self, make):
        scenario = make()
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        flow = np.eye(factor.shape[0])
        for piece in scenario.edge_weights.pieces(0.2, 5.0):

            def derivative(t, y, piece=piece, shape=flow.shape):
                values = piece.amplitudes * [float(carrier.value(t)) for carrier in piece.carriers]
                matrix = (factor * values) @ factor.T
                return (-scenario.network.gain * matrix @ y.reshape(shape)).ravel()

            solution = solve_ivp(derivative, (piece.start, piece.end), flow.ravel(), "Radau", rtol=1e-9, atol=1e-11)
            flow = solution.y[:, -1].reshape(flow.shape)
        np.testing.assert_allclose(transition_matrix(scenario, 0.2, 5.0), flow, atol=1e-6)  # Radau at rtol 1e-9

    def test_rate_is_that_of_a_long_run(self):
        scenario = mixed_scenario()
        spectrum = floquet_spectrum(scenario)
        cycles = 12
        norm = np.linalg.norm(transition_matrix(scenario, 0.0, cycles * spectrum.period), 2)
        # ||Phi^k||^(1/k) tends to the spectral radius like 1/k; the norm of a similarity is a factor of a few.
        assert -math.log(norm) / (cycles * spectrum.period) == pytest.approx(spectrum.rate, rel=0.05)

    def test_no_period_no_multipliers(self):
        scenario = mixed_scenario()
        odd = replace(scenario.weights.waveforms[0], sine_rate=math.sqrt(2))
        weights = replace(scenario.weights, waveforms=(odd, *scenario.weights.waveforms[1:]))
        with pytest.raises(ValueError, match="no monodromy matrix"):
            floquet_spectrum(replace(scenario, weights=weights))

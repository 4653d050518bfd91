"""Certificates near the limits of what floats hold: long periods, short periods, beta close to the rate."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from certified import network, run_of
from scipy.integrate import solve_ivp

from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.certificates.energy import energy_radius
from hybrid_model.consensus.certificates.rates import corollary_rate, corollary_rate_exact
from hybrid_model.consensus.exact.floquet import floquet_spectrum
from hybrid_model.consensus.excitation.joint import joint_excitation
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor, window_extremes
from hybrid_model.consensus.graphs.undirected import complete_edges, disagreement_basis, incidence
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

PATH_RATE = 2 - math.sqrt(2)
"""Second smallest eigenvalue of the Laplacian of the path on four agents."""


def limit(edges, weights, **further):
    """States one apart, a threshold of 0.1, half a minute."""
    initial = [float(i) for i in range(max(map(max, edges)))]
    base = {"trigger": {"kind": "static", "threshold": 0.1}, "initial": initial, "stop_time": 30.0}
    return network(edges, weights, **base | further)


def slow_path(rate, phase):
    weights = {"kind": "sine", "mean": 1.0, "depth": 0.5, "rate": rate, "phase": phase}
    return limit([[1, 2], [2, 3], [3, 4]], weights)


def scaled_rate(scenario, segments, sweeps):
    """Rate of a single state that is integrated, and scaled after each segment, until it is the slowest one."""
    period, n, gain = scenario.edge_weights.period, scenario.network.agents, scenario.network.gain
    factor = disagreement_basis(n).T @ incidence(n, scenario.network.edges)

    def velocity(t, y):
        return -gain * (factor * scenario.edge_weights.value(t)) @ (factor.T @ y)

    state, logarithm = np.ones(n - 1), 0.0
    for _ in range(sweeps):
        logarithm = 0.0
        for k in range(segments):
            span = (period * k / segments, period * (k + 1) / segments)
            state = solve_ivp(velocity, span, state, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
            size = np.linalg.norm(state)
            state, logarithm = state / size, logarithm + math.log(size)
    return -logarithm / period


class TestLongPeriods:
    def test_waves_a_turn_apart_are_one_wave(self):
        """The weights are integrated as different ones, and the rate is that of their mean."""
        spectrum = floquet_spectrum(slow_path(0.02, [0.0, 2 * math.pi, 4 * math.pi]))
        assert spectrum.is_scaled
        assert spectrum.rate == pytest.approx(PATH_RATE, rel=1e-9)  # accuracy of the cells' flows

    def test_against_a_state_that_is_scaled_on_the_way(self):
        scenario = slow_path(0.1, [0.0, 0.3, 0.6])
        assert floquet_spectrum(scenario).rate == pytest.approx(scaled_rate(scenario, 60, 2), rel=1e-8)  # of the oracle

    def test_two_matchings_that_wait_for_each_other(self):
        """Each direction is forgotten in one half of the period and kept in the other: multipliers exp(-2 h)."""
        switching = {"dwell": 10.0, "active": [[1, 2], [3, 4]]}
        edges = [[1, 2], [3, 4], [1, 3], [2, 4]]
        spectrum = floquet_spectrum(limit(edges, {"kind": "constant", "value": 1.0}, switching=switching))
        assert spectrum.is_scaled
        assert spectrum.rate == pytest.approx(1.0, rel=1e-9)  # e^{-20} lies 8 digits above rounding

    @pytest.mark.parametrize("dwell", [1.0, 2.0, 4.0])
    def test_both_ways_meet(self, dwell):
        switching = {"dwell": dwell, "active": [[1, 2], [3, 4]]}
        edges = [[1, 2], [3, 4], [1, 3], [2, 4]]
        spectrum = floquet_spectrum(limit(edges, {"kind": "constant", "value": 1.0}, switching=switching))
        assert spectrum.rate == pytest.approx(1.0, rel=1e-12)
        expected = np.exp(-dwell * np.array([2.0, 2.0, 4.0]))
        np.testing.assert_allclose(np.abs(spectrum.multipliers), expected, atol=1e-14)


@pytest.fixture(scope="module")
def analysis():
    return analyse(load_scenario("paper-a"), resolution=0.1)


class TestBetaCloseToTheRate:
    def test_the_energy_bound_is_of_the_order_of_the_exact_radius(self, analysis):
        """The windows one by one: without them this bound is 6.7e305 at beta = 0.45."""
        bounds = Bounds(analysis)
        exact, energy = 0.5 * bounds.unit_exact_radius(0.45), 0.5 * energy_radius(analysis, 0.45)
        assert exact <= energy <= 12 * exact
        assert exact == pytest.approx(92.36, rel=1e-2)  # a grid of 0.1

    def test_it_grows_with_beta_and_ends_at_the_rate(self, analysis):
        found = [energy_radius(analysis, beta) for beta in np.linspace(0.0, 0.468, 40)]
        assert all(early <= late for early, late in pairwise(found))
        assert energy_radius(analysis, 0.47) is None

    def test_too_close_is_said(self):
        paper = load_scenario("paper-a")
        close = analyse(paper).spectrum.rate - 1e-9
        found = certify(replace(paper, trigger=Trigger(TriggerKind.DYNAMIC, 0.5, close)))
        assert found.value("radius", "exact") is None
        assert found.value("radius", "energy") is None
        notes = " ".join(found.notes)
        assert "The exact radius and the improved gap are not computed: beta = 0.46" in notes
        assert "The energy bound does not exist: beta = 0.46" in notes

    def test_a_period_much_shorter_than_the_time_of_forgetting(self):
        scenario = limit(
            [[1, 2], [2, 3]], {"kind": "sine", "mean": 1.0, "depth": 0.5, "rate": 3e4, "phase": [0.0, 0.3]}
        )
        found = certify(scenario)
        # Weights that fast act by their mean: the rate and the radius of the path with weight 1.
        mean = certify(limit([[1, 2], [2, 3]], {"kind": "constant", "value": 1.0}))
        assert found.value("rate", "floquet") == pytest.approx(1.0, rel=1e-6)
        assert found.value("radius", "exact") == pytest.approx(mean.value("radius", "exact"), rel=2e-4)
        assert found.value("radius", "exact") < found.value("radius", "energy") < found.value("radius", "improved")

    def test_weights_that_differ_by_orders_of_magnitude(self):
        """Modes from 6e-4/s to 2e3/s; the number is of a sum over cells that grow with their age."""
        scenario = limit([[1, 2], [2, 3], [3, 4]], {"kind": "constant", "value": [1e3, 1.0, 1e-3]})
        assert certify(scenario).value("radius", "exact") == pytest.approx(0.48967, abs=2e-5)

    def test_weights_that_are_nearly_always_off(self):
        """Switched on for a hundred-thousandth of the time: they act by their mean, only very slowly."""
        gated = {"kind": "gated-sine", "duty_percent": 0.001, "gate_rate": 4.0, "sine_rate": 1.0}
        found = certify(limit(LINE, gated))
        mean = certify(limit(LINE, {"kind": "constant", "value": found.value("rate", "floquet")}))
        slowest = mean.value("rate", "floquet") / found.value("rate", "floquet")
        assert slowest == pytest.approx(PATH_RATE, rel=1e-6)
        assert found.value("radius", "exact") == pytest.approx(mean.value("radius", "exact"), rel=2e-4)
        assert found.value("min_gap", "valid") < found.value("min_gap", "improved")


SINES = {"kind": "sine", "mean": 1.0, "depth": 0.9, "rate": 2.0, "phase": [0.0, 1.0, 2.0]}
LINE = [[1, 2], [2, 3], [3, 4]]


class TestWhatRemains:
    """Hypotheses fail, and what the certificates still say is true of a run."""

    @pytest.mark.parametrize(
        ("trigger", "gap"),
        [({"kind": "sampled", "threshold": 0.1, "period": 0.9}, 0.9), ({"kind": "periodic", "period": 0.2}, 0.2)],
    )
    def test_broadcasts_at_known_times_are_a_period_apart(self, trigger, gap):
        scenario = limit(LINE, SINES, trigger=trigger)
        found = certify(scenario, run_of(scenario), resolution=0.1)
        assert found.value("radius", "exact") is None
        assert found.value("min_gap", "improved") == gap <= found.value("min_gap", "observed")
        assert "and the period, as a gap, are certified" in " ".join(found.notes)

    def test_without_trigger_errors_nothing_is_left(self):
        scenario = limit(LINE, SINES, trigger={"kind": "continuous"})
        found = certify(scenario, run_of(scenario), resolution=0.1)
        assert found.value("radius", "observed") == found.value("radius", "exact") == 0.0

    def test_a_share_of_the_threshold_that_falls_fast_costs_no_gap(self):
        """Without a period: a mixed threshold whose decay is far above every rate still has the gap of its offset."""
        switching = {"kind": "random-dwell", "active": [[1, 2], [2, 3]], "shortest": 0.3, "longest": 0.9, "seed": 4}
        trigger = {"kind": "mixed", "offset": 0.1, "threshold": 0.2, "decay": 3.0}
        scenario = limit(LINE, {"kind": "constant", "value": 1.0}, trigger=trigger, switching=switching)
        found = certify(scenario, window=2.0, resolution=0.1)
        static = certify(replace(scenario, trigger=Trigger(TriggerKind.STATIC, 0.1)), window=2.0, resolution=0.1)
        assert 0 < found.value("min_gap", "valid") <= found.value("min_gap", "improved")
        assert 0.1 * static.value("min_gap", "improved") < found.value("min_gap", "improved")

    def test_an_edge_that_is_switched_off_for_ever(self):
        """The only jointly connected interval then lasts until the end: no window behind it holds another one."""
        switching = {"kind": "sequence", "dwell": [2.0, 28.0], "active": [[1, 2], [1]]}
        scenario = limit([[1, 2], [2, 3]], {"kind": "constant", "value": 1.0}, switching=switching)
        joint = joint_excitation(scenario)
        assert [(interval.start, interval.end) for interval in joint.intervals] == [(0.0, 30.0)]
        assert 0 < joint.mu1_of_paths <= joint.mu1_of_trees <= joint.mu1_of_intervals <= joint.exact.mu1 * (1 + 1e-12)
        assert corollary_rate(joint, 1.0) <= corollary_rate_exact(joint, 1.0)


def test_what_one_analysis_finds_the_other_knows():
    analysis = analyse(load_scenario("paper-a0"), resolution=0.2)
    copy = analysis.alike(replace(analysis.scenario, trigger=Trigger(TriggerKind.STATIC, 0.1)))
    assert copy.worst(0.0) is analysis.worst(0.0)
    assert copy.contraction(2) == analysis.contraction(2) < analysis.contraction()


def test_constants_of_many_square_waves_against_all_windows():
    """Extremes lie where a window's end meets a breakpoint; a fine grid of windows finds nothing beyond them."""
    edges = complete_edges(5)
    rates = [1.0 + 0.137 * math.sqrt(number + 2) for number in range(len(edges))]
    weights = {"kind": "square", "high": 1.0, "low": 0.1, "gate_rate": rates, "duty_percent": 30.0}
    scenario = limit([list(edge) for edge in edges], weights)
    factor, wanted = signal_factor(scenario, Signal.DISAGREEMENT), scenario.edge_weights
    assert wanted.period is None
    found = window_extremes(factor, wanted, 4.0, 30.0)
    starts = np.linspace(0.0, 26.0, 4001)
    integrals = (factor * wanted.integral(starts, starts + 4.0)[:, None, :]) @ factor.T
    eigenvalues = np.linalg.eigvalsh(integrals)
    # The steepest slope of an eigenvalue is lambda_max(D D^T) = 5, the step 0.0065 s.
    assert found.mu1 <= eigenvalues[:, 0].min() <= found.mu1 + 5 * 0.0065
    assert found.mu2 - 5 * 0.0065 <= eigenvalues[:, -1].max() <= found.mu2
    pieces = wanted.pieces(0.0, 30.0)
    for piece in pieces[::7]:
        np.testing.assert_array_equal(piece.amplitudes, wanted.amplitudes((piece.start + piece.end) / 2))

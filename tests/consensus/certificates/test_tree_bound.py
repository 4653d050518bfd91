"""Theorems 1 and 2 along a tree: published values, the algebra of the audit, runs below the valid bound, all trees."""

import math
from dataclasses import replace

import numpy as np
import pytest
from certified import network
from oracles.exact_consensus import exact_run
from scipy.integrate import quad

from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.rates import corollary_rate, corollary_rate_exact, rate_of_contraction
from hybrid_model.consensus.certificates.tree_bound import BoundForm, convergence_bound, default_window, tree_radii
from hybrid_model.consensus.exact.floquet import floquet_spectrum
from hybrid_model.consensus.excitation.joint import joint_excitation
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind


def constant_network(agents, edges, initial, value=1.0, *, threshold=0.5, decay=0.0, **more):
    weights, trigger = {"kind": "constant", "value": value}, {"kind": "dynamic", "threshold": threshold, "decay": decay}
    return network(edges, weights, agents=agents, initial=initial, trigger=trigger, stop_time=10.0, **more)


def with_decay(scenario, decay):
    return replace(scenario, trigger=Trigger(TriggerKind.DYNAMIC, scenario.trigger.threshold, decay))


class TestPublishedReferenceValuesOfScenarioA:
    def test_rho_error_bound_and_initial_norm(self):
        scenario = load_scenario("paper-a")
        bound = convergence_bound(scenario, BoundForm.VALID)
        assert bound.rho == pytest.approx(2.613126, abs=1e-6)
        assert bound.error_bound == pytest.approx(math.sqrt(3), rel=1e-15)
        # The published 2.703701 is the norm over all six edges of the complete graph, 2 ||x - mean||.
        assert edge_norm(scenario, np.array(scenario.network.initial)) == pytest.approx(2.703701, abs=1e-6)

    def test_the_valid_disturbance_uses_the_integrated_norm_of_m(self):
        bound = convergence_bound(load_scenario("paper-a-static"), BoundForm.VALID)
        smallest, largest = 2 - math.sqrt(2), 2 + math.sqrt(2)  # edge Laplacian of the path with three edges
        gamma = 2 * smallest * 1.577391 / (1 + math.sqrt(3) * largest * 5.725561) ** 2
        overshoot = math.sqrt(largest / smallest / (1 - gamma))
        assert bound.overshoot == pytest.approx(overshoot, rel=1e-6)
        assert bound.disturbance == pytest.approx(largest * overshoot * math.sqrt(3) * 5.764946, rel=1e-6)
        assert bound.kappa2 == pytest.approx(bound.disturbance / (1 - math.sqrt(1 - gamma)), rel=1e-5)

    def test_the_dynamic_trigger_of_the_paper_is_outside_the_printed_hypothesis(self):
        bound = convergence_bound(load_scenario("paper-a"), BoundForm.PRINTED)
        assert (bound.kappa1, bound.kappa2, bound.radius) == (None, None, None)
        assert bound.notes[0].startswith(
            "The printed bound needs beta < alpha_v, but beta is 0.06 and alpha_v is 0.000481"
        )
        with pytest.raises(ValueError, match="needs beta < alpha_v"):
            bound.at(1.0)

    def test_the_printed_radius_is_that_of_the_theorem(self):
        # Theorem 2: kappa2 = k ||Lambda|| m C e^{alpha t0 + 2 alpha T} mu2/(e^{alpha T} - 1) with beta = t0 = 0.
        bound = convergence_bound(load_scenario("paper-a-static"), BoundForm.PRINTED)
        growth = bound.rate * bound.window
        expected = bound.disturbance * math.exp(2 * growth) / math.expm1(growth)
        assert bound.radius == pytest.approx(bound.rho * expected, rel=1e-12)


def test_two_agents_have_the_constants_found_by_hand():
    # Audit, section 6: n = 2, w = k = 1, c = .5, T = .05: alpha 1.807, m 1.095, kappa1 -1.212, kappa2 1.387.
    scenario = constant_network(2, [[1, 2]], [0.0, 0.05])
    bound = convergence_bound(scenario, BoundForm.PRINTED, window=0.05)
    gamma = 2 * 2 * 0.05 / (1 + 2 * 0.05) ** 2
    assert bound.rate == pytest.approx(-math.log(1 - gamma) / 0.1, rel=1e-12)
    assert bound.rate == pytest.approx(1.807, abs=5e-4)
    assert bound.overshoot == pytest.approx(1.095, abs=5e-4)
    assert bound.kappa1 == pytest.approx(-1.212, abs=5e-4)
    assert bound.kappa2 == pytest.approx(1.387, abs=5e-4)


class TestThreeCasesOfTheValidForm:
    """The bound is the variation-of-constants integral, majorised window by window (audit, section 5.2)."""

    SCENARIO = constant_network(3, [[1, 2], [2, 3]], [1.0, 0.0, -1.0])

    @pytest.mark.parametrize("share", [0.0, 0.3, 1 - 1e-9, 1.0, 1 + 1e-9, 3.0])
    def test_it_lies_above_the_integral_that_it_majorises(self, share):
        rate = convergence_bound(self.SCENARIO, BoundForm.VALID, window=0.2).rate
        scenario = with_decay(self.SCENARIO, share * rate)
        bound = convergence_bound(scenario, BoundForm.VALID, window=0.2)
        per_second = bound.disturbance / bound.window  # ||M|| is constant here, so mu2_bar = ||M|| T
        for t in (0.0, 0.1, 1.0, 5.0):
            integral = quad(lambda s: math.exp((rate - share * rate) * s), 0.0, t, epsabs=1e-12)[0]
            state = bound.transient * math.exp(-rate * t) + per_second * math.exp(-rate * t) * integral
            exact = bound.rho * state
            assert exact <= float(bound.at(t)) * (1 + 1e-9)
            # One window more than the integral needs, and within a window the largest exponential for all.
            assert float(bound.at(t)) <= exact + bound.rho * bound.disturbance * math.exp(3 * rate * 0.2) * (1 + t)

    @pytest.mark.parametrize("share", [0.0, 0.5, 2.0])
    def test_kappas_reproduce_the_bound(self, share):
        rate = convergence_bound(self.SCENARIO, BoundForm.VALID).rate
        bound = convergence_bound(with_decay(self.SCENARIO, share * rate), BoundForm.VALID)
        t = np.linspace(0.0, 10.0, 11)
        state = bound.kappa1 * np.exp(-bound.rate * t) + bound.kappa2 * np.exp(-bound.decay * t)
        # kappa1 and kappa2 are about a hundred times their sum at t = 0.
        np.testing.assert_allclose(bound.at(t), bound.rho * state, rtol=1e-11)

    def test_kappas_with_equal_rates(self):
        rate = convergence_bound(self.SCENARIO, BoundForm.VALID).rate
        bound = convergence_bound(with_decay(self.SCENARIO, rate), BoundForm.VALID)
        t = np.linspace(0.0, 10.0, 11)
        state = (bound.kappa1 + bound.kappa2 * (t / bound.window + 1)) * np.exp(-rate * t)
        np.testing.assert_allclose(bound.at(t), bound.rho * state, rtol=1e-13)

    def test_it_is_continuous_in_beta(self):
        rate = convergence_bound(self.SCENARIO, BoundForm.VALID).rate
        values = [
            float(convergence_bound(with_decay(self.SCENARIO, rate * share), BoundForm.VALID).at(3.0))
            for share in (1 - 1e-12, 1.0, 1 + 1e-12)
        ]
        assert values == pytest.approx([values[1]] * 3, rel=1e-9)

    def test_radius_is_the_limit(self):
        static = convergence_bound(self.SCENARIO, BoundForm.VALID)
        assert static.radius == pytest.approx(float(static.at(1e6)), rel=1e-12)
        dynamic = convergence_bound(with_decay(self.SCENARIO, 0.1), BoundForm.VALID)
        assert dynamic.radius == 0.0
        assert float(dynamic.at(1e6)) == 0.0


@pytest.mark.parametrize("decay", [0.0, 0.1, 0.6, 2.0])
@pytest.mark.parametrize("switching", [False, True])
def test_runs_stay_below_the_valid_bound(decay, switching):
    random = np.random.default_rng(7)
    more = {"switching": {"dwell": 0.05, "active": [[1, 2, 3], [2, 3, 4]]}} if switching else {}
    for _ in range(4):
        scenario = constant_network(
            4,
            [[1, 2], [2, 3], [3, 4], [4, 1]],
            random.uniform(-1, 1, 4).tolist(),
            random.uniform(0.5, 2.0, 4).tolist(),
            threshold=0.3,
            decay=decay,
            **more,
        )
        bound = convergence_bound(scenario, BoundForm.VALID)
        for stop in (0.3, 2.0, 5.0):
            x = exact_run(replace(scenario, stop_time=stop)).x_end
            assert edge_norm(scenario, x) <= float(bound.at(stop))


def test_runs_of_the_paper_stay_below_the_valid_bound():
    for name in ("paper-a", "paper-a-static"):
        scenario = load_scenario(name)
        bound = convergence_bound(scenario, BoundForm.VALID)
        for stop in (1.0, 10.0, 50.0):
            x = exact_run(replace(scenario, stop_time=stop)).x_end
            assert edge_norm(scenario, x) <= float(bound.at(stop))


def test_a_tree_that_is_not_exciting_gives_no_bound_but_a_note():
    scenario = load_scenario("paper-a-static")
    partition = TreePartition(4, scenario.network.underlying_edges, (1, 2, 6))
    bound = convergence_bound(scenario, BoundForm.PRINTED, partition)
    assert bound.rate == 0.0
    assert bound.kappa2 is None
    assert "integral of W_tau over a window of 6.28319 s can be singular" in bound.notes[0]


def test_without_persistent_excitation_there_is_no_bound():
    scenario = constant_network(3, [[1, 2], [2, 3]], [1.0, 0.0, -1.0], [1.0, 0.0])
    for form in BoundForm:
        assert convergence_bound(scenario, form).kappa1 is None


def test_default_windows():
    scenario = load_scenario("paper-a")
    tree = TreePartition(4, scenario.network.underlying_edges)
    assert default_window(scenario, tree) == pytest.approx(2 * math.pi)
    constant = constant_network(2, [[1, 2]], [0.0, 1.0], 3.0)
    window = default_window(constant, TreePartition(2, ((1, 2),)))
    assert window == pytest.approx(0.01 / 6.0)  # k sqrt(p) ||Lambda|| mu2 T = 6 T
    # A short window loses two percent of the exact rate 2 k w.
    assert convergence_bound(constant, BoundForm.VALID).rate == pytest.approx(6.0, rel=0.02)


def test_a_graph_that_is_not_connected_is_refused():
    scenario = constant_network(4, [[1, 2], [3, 4]], [0.0] * 4)
    with pytest.raises(ValueError, match="not connected"):
        convergence_bound(scenario, BoundForm.VALID)


def test_rate_of_contraction():
    assert rate_of_contraction(1 - math.exp(-2 * 0.7 * 3), 3.0) == pytest.approx(0.7, rel=1e-12)


class TestTreesAndCorollary:
    def test_the_number_of_exciting_trees(self):
        # The cycle on four agents has four spanning trees.
        assert len(tree_radii(load_scenario("paper-a"), 2 * math.pi)) == 4

    def test_every_tree_bounds_the_exact_radius(self):
        analysis = analyse(load_scenario("paper-a-static"))
        exact = Bounds(analysis).exact_radius
        for form in BoundForm:
            for found in tree_radii(analysis.scenario, analysis.window, form):
                assert found.radius >= exact

    @pytest.mark.parametrize("dwell", [math.pi / 2, math.pi, 2 * math.pi])
    def test_repaired_corollary_on_the_example(self, dwell):
        scenario = load_scenario("paper-a")
        scenario = replace(scenario, switching=replace(scenario.switching, dwell=dwell))
        joint = joint_excitation(scenario)
        rates = [corollary_rate(joint, 1.0), corollary_rate_exact(joint, 1.0), floquet_spectrum(scenario).rate]
        assert rates[0] > 0
        assert rates == sorted(rates)

    def test_repaired_corollary_on_random_switching(self):
        random = np.random.default_rng(409)
        for _ in range(40):
            active = [(random.choice(6, int(random.integers(3, 5)), replace=False) + 1).tolist() for _ in range(3)]
            scenario = network(
                [[1, 2], [2, 3], [3, 4], [4, 1], [1, 3], [2, 4]],
                {"kind": "constant", "value": random.uniform(0.2, 2, 6).tolist()},
                switching={"dwell": 0.5, "active": [*active, [1, 2, 3]]},
            )
            joint = joint_excitation(scenario)
            rates = [corollary_rate(joint, 1.0), corollary_rate_exact(joint, 1.0), floquet_spectrum(scenario).rate]
            assert rates[0] > 0
            assert rates == sorted(rates)

"""The exact worst case: closed forms, quadrature, errors that reach it; and the grid that it is summed over."""

import numpy as np
import pytest
from certified import network, path
from oracles.bang_bang import reached

from hybrid_model.consensus.exact.floquet import transition_matrix
from hybrid_model.consensus.exact.reachable_sets import ReachableSets
from hybrid_model.consensus.exact.transition_grid import transition_grid
from hybrid_model.consensus.exact.worst_case import worst_case
from hybrid_model.consensus.graphs.undirected import disagreement_basis, weighted_laplacian
from hybrid_model.consensus.scenario.files import load_scenario


class TestExactWorstCase:
    @pytest.mark.parametrize("decay", [0.0, 0.8, 2.0])
    def test_two_agents_by_hand(self, decay):
        # int k 2w 2c e^{-(2kw - beta)s} ds = 2c 2w/(2w - beta).
        scenario = network([[1, 2]], {"kind": "constant", "value": 1.5})
        found = worst_case(scenario, 1.0, decay)
        expected = 2 * 0.3 * 3.0 / (3.0 - decay)
        # Each cell takes the mean of the exponential; the resolution of 0.01 leaves some 1e-6.
        assert found.radius == pytest.approx(expected, rel=1e-5)
        assert found.pairs[1, 2] == pytest.approx(expected, rel=1e-5)

    def test_pairs_with_constant_weights_by_quadrature(self):
        scenario = network(path(4), {"kind": "constant", "value": [1.0, 0.5, 2.0]})
        found = worst_case(scenario, 3.0, 0.1)
        rates, vectors = np.linalg.eigh(weighted_laplacian(4, scenario.network.edges, [1.0, 0.5, 2.0]))
        # The trapezoidal rule, also over kinks where a component changes its sign: errors of the square of a step.
        times = np.linspace(0.0, 60.0, 60_001)
        for (i, j), width in found.pairs.items():
            modes = vectors * rates * (vectors[i - 1] - vectors[j - 1])
            total = np.abs(modes @ np.exp(-np.outer(rates, times))).sum(axis=0) * np.exp(0.1 * times)
            assert width == pytest.approx(0.3 * np.trapezoid(total, times), rel=2e-5)

    @pytest.mark.parametrize("decay", [0.0, 0.06])
    def test_errors_exist_that_reach_the_radius_of_the_paper(self, decay):
        scenario = load_scenario("paper-a")
        sets = ReachableSets(scenario, 2 * np.pi, decay, 0.05)
        found = worst_case(scenario, 2 * np.pi, decay, 0.05)
        index = int(np.argmin(np.abs(sets.times - found.time)))
        random = np.random.default_rng(1).standard_normal((3, 30))
        value, direction = sets.radius(index, random)
        assert 0.5 * value <= found.radius * (1 + 1e-6)
        xi = reached(scenario, direction[:, 0], float(sets.times[index]), 8 * np.pi, decay)
        # n = 4 and the complete graph: ||x_e|| = 2 ||xi||. The oracle's weights are constant on 60 steps a piece.
        assert 0.5 * 2 * np.linalg.norm(xi) == pytest.approx(0.5 * value, rel=2e-3)
        assert 0.5 * 2 * np.linalg.norm(xi) <= found.radius * 1.002

    def test_finer_grids_change_little_and_never_lower_the_value(self):
        scenario = load_scenario("paper-a-static")
        coarse, fine = (worst_case(scenario, 2 * np.pi, 0.0, r).radius for r in (0.05, 0.01))
        assert coarse <= fine * (1 + 1e-7)
        assert fine == pytest.approx(coarse, rel=1e-4)

    def test_random_errors_stay_inside(self):
        """Random bang-bang errors of random length never leave the set."""
        scenario = network(
            [[1, 2], [2, 3], [3, 4], [4, 1]],
            {"kind": "constant", "value": 1.0},
            switching={"dwell": 0.5, "active": [[1, 2], [3, 4]]},
        )
        radius = worst_case(scenario, 1.0, 0.0).radius / 0.3
        U = disagreement_basis(4)
        cells = transition_grid(scenario, 0.0, 1.0, 0.1)
        random = np.random.default_rng(2)
        D = np.stack([np.eye(4)[j - 1] - np.eye(4)[i - 1] for i, j in scenario.network.edges], axis=1)
        for _ in range(20):
            xi, hold = np.zeros(3), int(random.integers(1, 12))
            for k in range(40 * len(cells.flows)):
                if k % hold == 0:
                    error = random.choice([-1.0, 1.0], 4)
                fixed = -(U.T @ error)
                xi = fixed + cells.flows[k % len(cells.flows)] @ (xi - fixed)
                assert np.linalg.norm(D.T @ U @ xi) <= radius * (1 + 1e-9)


class TestTransitionGrid:
    def test_product_is_the_transition_matrix(self):
        scenario = load_scenario("paper-a")
        flow = transition_grid(scenario, 0.0, 7.0, 0.05).product()
        np.testing.assert_allclose(flow, transition_matrix(scenario, 0.0, 7.0), atol=1e-13)

    def test_different_carriers_by_magnus_steps(self):
        weights = {
            "kind": "gated-sine",
            "gate_rate": 2.0,
            "sine_rate": [1.0, 2.0, 3.0],
            "duty_percent": [60.0, 80.0, 100.0],
        }
        scenario = network(path(4), weights)
        # transition_matrix integrates such pieces to a relative tolerance of 1e-12.
        np.testing.assert_allclose(
            transition_grid(scenario, 0.0, 3.0, 0.02).product(), transition_matrix(scenario, 0.0, 3.0), atol=1e-9
        )


@pytest.mark.parametrize("periods", [1, 3])
def test_contraction_and_overshoot_are_those_of_all_norms(periods):
    """Norms are computed where it is open whether they are the largest: the same as computing all of them."""
    grid = transition_grid(load_scenario("paper-a"), 0.0, 2 * np.pi, 0.1)
    n, identity = len(grid.flows), np.eye(3)
    total, age, largest = {j: identity for j in range(n)}, np.zeros(n), 0.0
    lengths, over_periods = np.diff(grid.times), []
    assert n <= 256  # beyond, cells are joined
    for step in range(max(2, periods) * n):
        for j in range(n):
            at = (j + step) % n
            total[j], age[j] = grid.flows[at] @ total[j], age[j] + lengths[at]
        norms = np.array([np.linalg.norm(total[j], 2) for j in range(n)])
        largest = max(largest, np.max(norms * np.exp(0.3 * age))) if step < 2 * n else largest
        if step + 1 == periods * n:
            over_periods = norms
    assert grid.contraction(periods) == pytest.approx(max(over_periods), rel=1e-12)
    assert grid.overshoot(0.3) == pytest.approx(largest, rel=1e-12)

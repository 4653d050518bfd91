"""Balanced directed graphs: the contraction over a window against the exact flow."""

import numpy as np
import pytest

from hybrid_model.consensus.graphs.digraphs import (
    BalancedSwitching,
    directed_contraction,
    directed_laplacian,
    is_weight_balanced,
    symmetric_part,
)
from hybrid_model.consensus.graphs.generators import erdos_renyi_graph
from hybrid_model.consensus.graphs.undirected import disagreement_basis, weighted_laplacian

ROUNDING = 1e-9  # relative, of products of a few matrix exponentials


def random_balanced_digraph(agents, cycles, rng):
    """A sum of weighted cycles, as all balanced graphs are: the first passes all agents; without cycles it is empty."""
    A = np.zeros((agents, agents))
    for number in range(cycles):
        length = agents if number == 0 else int(rng.integers(2, agents + 1))
        around = rng.permutation(agents)[:length]
        A[around, np.roll(around, -1)] += rng.uniform(0.1, 1.0)
    return A


def random_switching(seed):
    """Two to six agents, one to four balanced graphs, some of them empty, time constants over three decades."""
    rng = np.random.default_rng(seed)
    agents, graphs = int(rng.integers(2, 7)), int(rng.integers(1, 5))
    scale = 10 ** rng.uniform(-2.0, 1.0)
    adjacencies = [scale * random_balanced_digraph(agents, int(rng.integers(0, 4)), rng) for _ in range(graphs)]
    return BalancedSwitching(adjacencies, rng.uniform(0.1, 2.0, graphs), gain=rng.uniform(0.3, 3.0)), rng


def assert_contraction_holds(seed):
    switching, rng = random_switching(seed)
    found = switching.contraction()
    starts = np.append(np.cumsum([0.0, *switching.dwells[:-1]]), rng.uniform(0.0, switching.period, 2))
    exact = max(np.linalg.norm(switching.flow(start), 2) ** 2 for start in starts)
    assert exact <= found.squared * (1 + ROUNDING)
    assert found.rate <= switching.exact_rate + ROUNDING
    return exact, found.squared


def test_contraction_holds_in_a_random_search():
    """Seeds 0 to 19; the long test goes on to 2499."""
    cases = [assert_contraction_holds(seed) for seed in range(20)]
    # The search is not idle: many cases contract by the bound, and many have no excitation in some direction.
    assert sum(bound < 0.99 for _, bound in cases) > 8
    assert sum(bound == 1.0 for _, bound in cases) > 0


@pytest.mark.long
def test_contraction_holds_in_a_long_random_search():
    for seed in range(20, 2500):
        assert_contraction_holds(seed)


def test_rows_of_a_balanced_laplacian_obey_the_inequality_of_the_proof():
    """``||L x||^2 <= 2 d x^T S x``: what the bound rests on; seeds 0 to 499."""
    for seed in range(500):
        rng = np.random.default_rng(seed)
        agents = int(rng.integers(2, 8))
        A = random_balanced_digraph(agents, int(rng.integers(1, 4)), rng)
        L, x = directed_laplacian(A), rng.standard_normal(agents)
        assert np.sum((L @ x) ** 2) <= 2 * np.max(np.diag(L)) * (x @ L @ x) * (1 + ROUNDING)


def test_two_agents_in_closed_form():
    """Two agents that listen to each other with weight w: disagreement falls with exp(-2 k w t), S = 2 w."""
    w, k, T = 0.3, 2.0, 1.5
    switching = BalancedSwitching([[[0.0, w], [w, 0.0]]], [T], gain=k)
    found = switching.contraction()
    assert found.mu1 == pytest.approx(2 * w * T, rel=1e-12)
    assert switching.exact_rate == pytest.approx(2 * k * w, rel=1e-12)
    # tr int S = 2 w T, dbar = w T: sqrt(2 dbar tr int S) = 2 w T.
    assert found.squared == pytest.approx(1 - 4 * k * w * T / (1 + 2 * k * w * T) ** 2, rel=1e-12)


def test_short_windows_of_constant_weights_lose_nothing():
    """As T tends to 0, ``-ln(q)/(2 T)`` tends to k lambda_min(S); the exact rate of a directed ring is larger."""
    A = np.roll(np.eye(5), 1, axis=1)
    smallest = float(np.linalg.eigvalsh(symmetric_part(A))[0])
    short = BalancedSwitching([A], [1e-7]).contraction().rate
    # The first term left out is of the order k sqrt(2 d tr S) T = 3e-7, twice.
    assert short == pytest.approx(smallest, rel=2e-6)
    assert smallest == pytest.approx(1 - np.cos(2 * np.pi / 5), rel=1e-12)
    assert BalancedSwitching([A], [1.0]).exact_rate == pytest.approx(smallest, rel=1e-9)


def test_undirected_graphs_are_balanced_and_s_is_the_laplacian():
    graph = erdos_renyi_graph(6, 0.5, 4)
    weights = np.linspace(0.5, 2.0, len(graph.edges))
    L = weighted_laplacian(6, graph.edges, weights)
    A = np.diag(np.diag(L)) - L
    U = disagreement_basis(6)
    np.testing.assert_allclose(symmetric_part(A), U.T @ L @ U, atol=1e-12)


def test_a_balanced_graph_keeps_the_mean_and_another_does_not():
    ring = np.roll(np.eye(4), 1, axis=1)
    chain = ring.copy()
    chain[3, 0] = 0.0
    assert is_weight_balanced(ring)
    assert not is_weight_balanced(chain)
    np.testing.assert_allclose(directed_laplacian(ring).sum(axis=0), 0.0)
    with pytest.raises(ValueError, match=r"do not balance: agent 1 takes 1 and gives 0"):
        symmetric_part(chain)


def test_without_excitation_nothing_is_promised():
    found = directed_contraction(0.0, 1.0, 1.0, 1.0, 2.0)
    assert (found.squared, found.rate) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: directed_laplacian([[0.0, 1.0]]), "must be square"),
        (lambda: directed_laplacian([[0.0, -1.0], [1.0, 0.0]]), r"entry \(1, 2\) is -1.0"),
        (lambda: directed_laplacian([[0.0, 1.0], [1.0, 2.0]]), "agent 2 listens to itself"),
        (lambda: BalancedSwitching([np.zeros((2, 2))], [1.0, 2.0]), "1 graphs and 2 dwell times"),
        (lambda: BalancedSwitching([np.zeros((2, 2))], [0.0]), r"dwell\[1\] is 0.0"),
    ],
)
def test_wrong_data_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_agents_that_nothing_joins_have_no_rate():
    """Two circles apart, given in turn: rounding of their eigenvalues certifies nothing."""
    rng = np.random.default_rng(9)
    for _ in range(50):
        first, second = np.zeros((5, 5)), np.zeros((5, 5))
        first[[0, 1, 2], [1, 2, 0]] = rng.uniform(0.1, 2)
        second[[3, 4], [4, 3]] = rng.uniform(0.1, 2)
        assert BalancedSwitching([first, second], rng.uniform(0.1, 1, 2).tolist()).contraction().rate == 0.0

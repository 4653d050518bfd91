"""Graph matrices against their definitions and against networkx."""

import itertools

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid_model.consensus.graphs.connectivity import is_connected
from hybrid_model.consensus.graphs.spanning_trees import TreePartition, spanning_tree
from hybrid_model.consensus.graphs.undirected import (
    complete_edges,
    disagreement_basis,
    incidence,
    laplacian,
    validate_edges,
    weighted_laplacian,
)

K4 = complete_edges(4, ((1, 2), (2, 3), (3, 4), (4, 1)))
ROUNDING = 1e-12  # matrices of size <= 8 with entries of order 1


@st.composite
def connected_graphs(draw):
    """Agents, a shuffled edge list: a random tree plus random further pairs."""
    agents = draw(st.integers(2, 7))
    tree = [(draw(st.integers(1, head - 1)), head) for head in range(2, agents + 1)]
    others = [pair for pair in itertools.combinations(range(1, agents + 1), 2) if pair not in tree]
    more = draw(st.lists(st.sampled_from(others), unique=True)) if others else []
    edges = draw(st.permutations(tree + more))
    flips = draw(st.lists(st.booleans(), min_size=len(edges), max_size=len(edges)))
    return agents, tuple(edge[::-1] if flip else edge for edge, flip in zip(edges, flips, strict=True))


def test_incidence_has_minus_one_at_the_tail_and_plus_one_at_the_head():
    expected = [[-1, 0, 1], [1, -1, 0], [0, 1, -1]]
    np.testing.assert_array_equal(incidence(3, ((1, 2), (2, 3), (3, 1))), expected)


@given(connected_graphs())
@settings(max_examples=50, deadline=None)
def test_laplacians_agree_with_networkx(graph):
    agents, edges = graph
    weights = np.arange(1.0, len(edges) + 1)
    reference = nx.Graph()
    reference.add_nodes_from(range(1, agents + 1))
    reference.add_weighted_edges_from((i, j, w) for (i, j), w in zip(edges, weights, strict=True))
    order = range(1, agents + 1)
    np.testing.assert_allclose(
        weighted_laplacian(agents, edges, weights), nx.laplacian_matrix(reference, order).toarray(), atol=ROUNDING
    )
    unweighted = nx.laplacian_matrix(reference, order, weight=None).toarray()
    np.testing.assert_allclose(laplacian(agents, edges), unweighted, atol=ROUNDING)


@given(connected_graphs())
@settings(max_examples=50, deadline=None)
def test_edge_laplacian_has_the_nonzero_spectrum_of_the_laplacian(graph):
    agents, edges = graph
    D = incidence(agents, edges)
    edge_spectrum = np.linalg.eigvalsh(D.T @ D)
    node_spectrum = np.linalg.eigvalsh(laplacian(agents, edges))
    np.testing.assert_allclose(edge_spectrum[-(agents - 1) :], node_spectrum[1:], atol=1e-10)


@given(connected_graphs())
@settings(max_examples=50, deadline=None)
def test_partition_fulfils_the_identities_of_the_paper(graph):
    agents, edges = graph
    tree = TreePartition(agents, edges)
    D = incidence(agents, edges)
    np.testing.assert_allclose(tree.incidence_tree @ tree.Z, tree.incidence_cycle, atol=ROUNDING)
    np.testing.assert_allclose(tree.incidence_tree @ tree.R, D[:, tree.order], atol=ROUNDING)
    np.testing.assert_allclose(tree.incidence_tree @ tree.R_by_edge, D, atol=ROUNDING)
    np.testing.assert_allclose(
        tree.Gamma @ np.diag(tree.Lambda) @ tree.Gamma.T, tree.edge_laplacian_tree, atol=ROUNDING
    )
    np.testing.assert_allclose(tree.Gamma.T @ tree.Gamma, np.eye(agents - 1), atol=ROUNDING)
    x = np.linspace(-1.0, 2.0, agents) ** 2
    assert np.linalg.norm(D.T @ x) <= tree.rho * np.linalg.norm(tree.psi @ x) * (1 + ROUNDING)


def test_rho_is_attained():
    tree = TreePartition(4, K4)
    left, _, _ = np.linalg.svd(tree.R)
    x = np.linalg.pinv(tree.incidence_tree.T) @ left[:, 0]
    edge_norm = np.linalg.norm(incidence(4, K4).T @ x)
    assert edge_norm == pytest.approx(tree.rho * np.linalg.norm(tree.psi @ x), rel=ROUNDING)


def test_complete_graph_on_four_agents_has_the_published_reference_rho_of_scenario_a():
    tree = TreePartition(4, K4)
    assert K4[4:] == ((1, 3), (2, 4))
    assert tree.tree == (1, 2, 3)
    assert tree.cycle == (4, 5, 6)
    assert tree.rho == pytest.approx(2.613126, abs=5e-7)  # printed with six decimals
    # Edge Laplacian of a path with three edges: 2 - 2 cos(i pi/4).
    np.testing.assert_allclose(tree.Lambda, 2 - 2 * np.cos(np.arange(1, 4) * np.pi / 4), rtol=ROUNDING)


def test_a_tree_has_no_cycle_edges_and_rho_one():
    tree = TreePartition(3, ((1, 2), (2, 3)))
    assert tree.cycle == ()
    assert tree.Z.shape == (2, 0)
    assert tree.rho == pytest.approx(1.0)


def test_spanning_tree_is_the_first_in_edge_order_and_can_be_chosen():
    edges = ((2, 3), (1, 2), (1, 3), (3, 4))
    assert spanning_tree(4, edges) == (1, 2, 4)
    assert TreePartition(4, edges, tree=(1, 3, 4)).cycle == (2,)


@given(connected_graphs())
@settings(max_examples=50, deadline=None)
def test_spanning_tree_equals_greedy_selection(graph):
    agents, edges = graph
    part = {agent: {agent} for agent in range(1, agents + 1)}
    chosen = []
    for number, (i, j) in enumerate(edges, start=1):
        if part[i] is not part[j]:
            chosen.append(number)
            part[i] |= part[j]
            for agent in part[j]:
                part[agent] = part[i]
    assert spanning_tree(agents, edges) == tuple(chosen)


@pytest.mark.parametrize("agents", [2, 3, 8])
def test_disagreement_basis_is_orthonormal_and_orthogonal_to_ones(agents):
    U = disagreement_basis(agents)
    np.testing.assert_allclose(U.T @ U, np.eye(agents - 1), atol=ROUNDING)
    np.testing.assert_allclose(U.sum(axis=0), 0.0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        ((), "edges is empty"),
        (((1, 2), (3, 3)), r"edge 2 is \[3, 3\], a self-loop"),
        (((1, 2), (1, 2)), r"edge 2 is \[1, 2\] and repeats edge 1"),
        (((1, 2), (2, 1)), r"edge 2 is \[2, 1\] and repeats edge 1, \[1, 2\]"),
        (((1, 2), (2, 4)), "names agent 4; agents are numbered from 1 to 3"),
        (((0, 2),), "names agent 0"),
    ],
)
def test_bad_edges_are_named(edges, message):
    with pytest.raises(ValueError, match=message):
        validate_edges(3, edges)


def test_a_graph_that_is_not_connected_has_no_tree():
    edges = ((1, 2), (3, 4))
    assert not is_connected(4, edges)
    with pytest.raises(ValueError, match=r"parts are the agents \[\[1, 2\], \[3, 4\]\]"):
        spanning_tree(4, edges)


@pytest.mark.parametrize("tree", [(1, 2), (1, 2, 2), (1, 2, 4), (1, 2, 3, 4)])
def test_a_choice_that_is_not_a_tree_is_refused(tree):
    edges = ((1, 2), (2, 3), (3, 4), (1, 3))
    with pytest.raises(ValueError, match="not a spanning tree"):
        TreePartition(4, edges, tree=tree)


def test_a_tree_edge_out_of_range_is_named():
    with pytest.raises(ValueError, match="tree names edge 5"):
        TreePartition(3, ((1, 2), (2, 3)), tree=(1, 5))


def test_weights_must_be_one_per_edge():
    with pytest.raises(ValueError, match=r"must be \(2,\), one number per edge"):
        weighted_laplacian(3, ((1, 2), (2, 3)), [1.0])

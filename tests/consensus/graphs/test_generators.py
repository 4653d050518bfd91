"""Families of graphs, connectivity and spanning trees against counting and brute force."""

import itertools

import networkx as nx
import numpy as np
import pytest

from hybrid_model.consensus.graphs.connectivity import components, is_connected
from hybrid_model.consensus.graphs.generators import (
    GraphKind,
    agent_graph,
    complete_graph,
    erdos_renyi_graph,
    geometric_graph,
    graph_of_kind,
    path_graph,
    regular_graph,
    reorient,
    ring_graph,
    small_world_graph,
    star_graph,
)
from hybrid_model.consensus.graphs.spanning_trees import TreePartition, all_spanning_trees, spanning_tree_count
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence, laplacian
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.switching.joint_connectivity import joint_connectivity_window
from hybrid_model.consensus.switching.random_sequences import random_dwell_sequence
from hybrid_model.consensus.switching.sequence import SwitchingSequence

ROUNDING = 1e-10  # eigenvalues of matrices of size <= 9 with entries of order 1

SEEDED = {
    "regular": lambda seed: regular_graph(8, 3, seed),
    "erdos-renyi": lambda seed: erdos_renyi_graph(8, 0.3, seed),
    "geometric": lambda seed: geometric_graph(8, 0.4, seed),
    "small-world": lambda seed: small_world_graph(8, 4, 0.3, seed),
}


@pytest.mark.parametrize(
    ("graph", "spectrum"),
    [
        (path_graph(5), 2 - 2 * np.cos(np.pi * np.arange(5) / 5)),
        (ring_graph(5), 2 - 2 * np.cos(2 * np.pi * np.arange(5) / 5)),
        (star_graph(5), np.array([0, 1, 1, 1, 5])),
        (complete_graph(5), np.array([0, 5, 5, 5, 5])),
    ],
)
def test_spectra_of_the_named_graphs(graph, spectrum):
    """Closed forms, for instance in Chung, Spectral Graph Theory (1997), chapter 1."""
    found = np.linalg.eigvalsh(laplacian(graph.agents, graph.edges))
    np.testing.assert_allclose(found, np.sort(spectrum), atol=ROUNDING)


@pytest.mark.parametrize("name", SEEDED)
def test_seeded_graphs_repeat_differ_and_are_connected(name):
    graphs = [SEEDED[name](seed) for seed in range(20)]
    again = [SEEDED[name](seed) for seed in range(20)]
    assert [graph.edges for graph in graphs] == [graph.edges for graph in again]
    assert len({graph.edges for graph in graphs}) > 1
    assert all(is_connected(graph.agents, graph.edges) for graph in graphs)


def test_regular_graph_has_one_degree_and_small_world_the_edges_of_its_ring():
    graph = regular_graph(8, 3, 1)
    np.testing.assert_array_equal(np.diag(laplacian(8, graph.edges)), 3.0)
    assert len(small_world_graph(10, 4, 0.5, 2).edges) == 20
    assert small_world_graph(6, 2, 0.0, 0).edges == ring_graph(6).edges


def test_geometric_edges_are_the_pairs_within_the_radius():
    graph = geometric_graph(9, 0.45, 3)
    gaps = np.linalg.norm(graph.positions[:, None] - graph.positions[None], axis=2)
    expected = {(i + 1, j + 1) for i, j in itertools.combinations(range(9), 2) if gaps[i, j] <= 0.45}
    assert set(graph.edges) == expected


def test_graphs_that_need_not_be_connected_follow_the_family():
    """Of 200 graphs on 6 agents with p = 0.2 about nine in ten are not connected."""
    graphs = [erdos_renyi_graph(6, 0.2, seed, connected=False) for seed in range(200)]
    assert sum(not is_connected(graph.agents, graph.edges) for graph in graphs) > 100
    mean = np.mean([len(graph.edges) for graph in graphs])
    # 15 pairs: mean 3.0 (a little more without empty graphs), standard deviation of the mean 0.11.
    assert mean == pytest.approx(3.0, abs=0.5)


@pytest.mark.parametrize("kind", GraphKind)
def test_graphs_by_the_name_of_their_family_have_their_agents_and_are_connected(kind):
    graph, again = (graph_of_kind(kind.value, 12, degree=4, seed=5) for _ in range(2))
    assert (graph.agents, graph.edges) == (12, again.edges)
    assert is_connected(graph.agents, graph.edges)
    assert (graph.edges != graph_of_kind(kind, 12, degree=4, seed=6).edges) == kind.is_random


def test_mean_degrees_are_about_what_was_asked_for():
    # Expected n k/2 = 1200 edges with a standard deviation below sqrt(1200); borders cost geometric graphs some.
    for kind, least in (("regular", 1200), ("small-world", 1200), ("erdos-renyi", 1050), ("geometric", 950)):
        assert least <= len(graph_of_kind(kind, 200, degree=12, seed=1).edges) <= (1350 if least < 1200 else 1200)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("torus", 9), "no graph 'torus'; it must be one of path, ring"),
        (("regular", 9, 12), "degree is 12; it must be above 0 and below the number of agents, 9"),
        (("small-world", 9, 2.5), "in a small-world graph it must be whole"),
    ],
)
def test_graphs_by_name_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        graph_of_kind(*arguments)


def test_networkx_graphs_are_numbered_in_the_order_of_their_nodes():
    graph = nx.Graph()
    graph.add_nodes_from(["pump", "tank", "valve"])
    graph.add_edge("valve", "pump", weight=0.5)
    graph.add_edge("tank", "valve")
    found = agent_graph(graph)
    assert found.nodes == ("pump", "tank", "valve")
    assert found.edges == ((1, 3), (2, 3))
    np.testing.assert_array_equal(found.weights, [0.5, 1.0])
    assert found.positions is None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: agent_graph(nx.DiGraph([(0, 1)])), "the graph is directed"),
        (lambda: agent_graph(nx.MultiGraph([(0, 1)])), "the graph is a multigraph"),
        (lambda: agent_graph(nx.Graph([(0, 0)])), "self-loop"),
        (lambda: agent_graph(nx.empty_graph(3)), "edges is empty"),
        (lambda: ring_graph(2), "agents is 2; this graph needs at least 3"),
        (lambda: regular_graph(5, 3, 0), "agents times degree must be even"),
        (lambda: regular_graph(4, 4, 0), "degree must lie between 1 and 3"),
        (lambda: erdos_renyi_graph(4, 1.5, 0), "probability is 1.5"),
        (lambda: erdos_renyi_graph(30, 0.01, 0), "none of 1000 graphs drawn with probability 0.01 and seed 0"),
        (lambda: geometric_graph(4, 0.0, 0), "radius is 0.0"),
        (lambda: small_world_graph(6, 3, 0.1, 0), "neighbours is 3; it must be even"),
        (lambda: reorient(((1, 2),), [True, False]), r"must be \(1,\), one entry for each edge"),
    ],
)
def test_what_cannot_be_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("name", SEEDED)
def test_orientation_changes_signs_only(name):
    """Laplacian, Lambda and rho do not know the direction of an edge; D and Z change the signs of its column."""
    graph = SEEDED[name](5)
    turned = np.random.default_rng(7).random(len(graph.edges)) < 0.5
    edges = reorient(graph.edges, turned)
    signs = np.where(turned, -1.0, 1.0)
    np.testing.assert_array_equal(incidence(8, edges), incidence(8, graph.edges) * signs)
    np.testing.assert_array_equal(laplacian(8, edges), laplacian(8, graph.edges))
    before, after = TreePartition(8, graph.edges), TreePartition(8, edges)
    np.testing.assert_allclose(after.Lambda, before.Lambda, atol=ROUNDING)
    assert after.rho == pytest.approx(before.rho, rel=ROUNDING)
    tree, cycle = np.split(signs[before.order], [7])
    np.testing.assert_allclose(after.Z, tree[:, None] * before.Z * cycle, atol=ROUNDING)


def brute_force_trees(agents, edges):
    for numbers in itertools.combinations(range(1, len(edges) + 1), agents - 1):
        graph = nx.Graph([edges[k - 1] for k in numbers])
        if graph.number_of_nodes() == agents and nx.is_connected(graph):
            yield numbers


@pytest.mark.parametrize("seed", range(12))
def test_all_spanning_trees(seed):
    graph = erdos_renyi_graph(5 + seed % 2, 0.6, seed)
    found = list(all_spanning_trees(graph.agents, graph.edges))
    assert found == list(brute_force_trees(graph.agents, graph.edges))
    assert len(found) == spanning_tree_count(graph.agents, graph.edges)


@pytest.mark.parametrize("agents", [2, 3, 4, 5, 6])
def test_cayleys_formula(agents):
    edges = complete_graph(agents).edges
    assert spanning_tree_count(agents, edges) == agents ** (agents - 2)
    assert sum(1 for _ in all_spanning_trees(agents, edges)) == agents ** (agents - 2)


def test_every_tree_gives_the_same_edge_states():
    """Tree coordinates are coordinates: N, seen through any tree, is one matrix (audit, section 1)."""
    graph = complete_graph(4)
    weights = np.array([1.0, 0.5, 2.0, 0.3, 0.7, 1.1])
    D = incidence(4, graph.edges)
    spectrum = np.linalg.eigvalsh(disagreement_basis(4).T @ (D * weights) @ D.T @ disagreement_basis(4))
    for tree in all_spanning_trees(4, graph.edges):
        part = TreePartition(4, graph.edges, tree)
        M = part.Gamma.T @ (part.R_by_edge * weights) @ part.R_by_edge.T @ part.Gamma
        root = np.sqrt(part.Lambda)
        np.testing.assert_allclose(np.linalg.eigvalsh(root[:, None] * M * root), spectrum, rtol=1e-9)


def test_a_graph_in_parts_has_no_tree():
    edges = ((1, 2), (3, 4))
    assert list(all_spanning_trees(5, edges)) == []
    assert spanning_tree_count(5, edges) == 0
    assert components(5, edges) == [[1, 2], [3, 4], [5]]
    assert not is_connected(5, edges)


RING = ((1, 2), (2, 3), (3, 4), (4, 1))


def test_window_of_joint_connectivity():
    # From t = 0 the union is complete when the second graph begins, at 2 s; from 2 s when the first comes back, at 6 s.
    assert joint_connectivity_window(4, RING, SwitchingCycle(2.0, ((1,), (2, 3), ()), 4)) == pytest.approx(4.0)
    assert joint_connectivity_window(4, RING, NoSwitching(4)) == 0.0
    assert joint_connectivity_window(4, RING, SwitchingCycle(2.0, ((1,), (2,)), 4)) is None
    listed = SwitchingSequence((1.0, 0.5, 3.0, 0.25), ((1,), (2,), (3,), (1, 2, 3)), 4)
    # Waits from 0, 1, 1.5 and 4.5 s: 1.5, 3.5, 3.0 and 0.
    assert joint_connectivity_window(4, RING, listed, horizon=4.75) == pytest.approx(3.5)
    with pytest.raises(ValueError, match="no period"):
        joint_connectivity_window(4, RING, listed)


@pytest.mark.parametrize("seed", range(6))
def test_windows_just_longer_are_connected_and_some_window_just_shorter_is_not(seed):
    switching = random_dwell_sequence(
        ((1,), (2, 4), (3,)), 4, shortest=0.2, longest=1.0, duration=6.0, seed=seed, repeat=True
    )
    window = joint_connectivity_window(4, RING, switching)

    def joined(start, length):
        cuts = [start, *switching.breakpoints(start, start + length).tolist(), start + length]
        seen = np.any([switching.active_at((a + b) / 2) for a, b in itertools.pairwise(cuts)], axis=0)
        return is_connected(4, [edge for edge, on in zip(RING, seen, strict=True) if on])

    starts = np.concatenate([np.linspace(0.0, 6.0, 200), switching.breakpoints(-1e-9, 6.0)])
    assert all(joined(start, window + 1e-6) for start in starts)
    assert not all(joined(start, window - 1e-6) for start in starts)

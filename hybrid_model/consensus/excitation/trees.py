"""Excitation along each spanning tree of the union graph (paper, theorem 2)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import networkx as nx

from hybrid_model.consensus.excitation.persistence import (
    Signal,
    WindowExtremes,
    excitation_horizon,
    signal_factor,
    window_extremes,
)
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["TreeExcitation", "tree_excitations"]

_ZERO = 1e-12
_MOST_TREES = 200


@dataclass(frozen=True)
class TreeExcitation:
    """Excitation along one spanning tree of the union graph, for kappa^m and kappa^M (paper, section 6).

    Parameters
    ----------
    partition : TreePartition
        The tree, in the underlying graph.
    weights : WindowExtremes
        Constants of W_tau, which the theorem names.
    coordinates : WindowExtremes
        Constants of M, for which its proof holds.
    """

    partition: TreePartition
    weights: WindowExtremes
    coordinates: WindowExtremes


def tree_excitations(
    scenario: Scenario, window: float | None = None, most: int = _MOST_TREES
) -> tuple[TreeExcitation, ...]:
    """Constants along each spanning tree whose edges carry weight.

    Parameters
    ----------
    scenario : Scenario
        The network.
    window : float, optional
        T [s]; by default the period.
    most : int
        Trees beyond this number are left out; a complete graph on n agents has ``n**(n - 2)``.

    Raises
    ------
    ValueError
        As `excitation_constants`.
    """
    weights, network, horizon = scenario.edge_weights, scenario.network, excitation_horizon(scenario)
    found = []
    for tree in islice(_carrying_trees(scenario), most):
        partition = TreePartition(network.agents, network.underlying_edges, tree)
        extremes = [
            window_extremes(signal_factor(scenario, signal, partition), weights, window, horizon)
            for signal in (Signal.TREE_WEIGHTS, Signal.TREE_COORDINATES)
        ]
        found.append(TreeExcitation(partition, *extremes))
    return tuple(found)


def _carrying_trees(scenario: Scenario) -> Iterator[tuple[int, ...]]:
    """Edge numbers of the spanning trees of the edges that carry weight within a period or the run."""
    end = scenario.edge_weights.period or scenario.stop_time
    doses = scenario.edge_weights.integral(0.0, end)
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, scenario.network.agents + 1))
    for number, (edge, dose) in enumerate(zip(scenario.network.edges, doses, strict=True), start=1):
        if dose > _ZERO * doses.max():
            graph.add_edge(*edge, number=number, weight=float(number))
    if nx.is_connected(graph):
        for tree in nx.SpanningTreeIterator(graph):
            yield tuple(sorted(number for _, _, number in tree.edges(data="number")))

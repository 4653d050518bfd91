"""The corollary on switching topologies, repaired: a window of twice the longest interval (audit, section 8)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.excitation import Signal, scenario_excitation
from hybrid_model.consensus.scenario_data import Scenario

__all__ = ["RepairedCorollary", "bottleneck_weight", "repaired_corollary", "tree_connectivity"]

_ROUNDING = 1e-12


@dataclass(frozen=True)
class RepairedCorollary:
    """What the corollary's intervals guarantee, without a common spanning tree.

    Parameters
    ----------
    cuts : tuple of float
        Ends of the contiguous intervals [s]; over each of them the union of the graphs has a spanning tree.
    least_weight : float
        wmin > 0: over every interval each edge of some spanning tree has at least this integrated weight.
    window : float
        T = twice the longest interval [s]: every window of that length contains a whole interval.
    guaranteed : float
        ``wmin 2 (1 - cos(pi/n))``, a lower bound on mu1 of N over such windows that knows wmin and n only.
    exact : float
        mu1 of N over such windows.
    """

    cuts: tuple[float, ...]
    least_weight: float
    window: float
    guaranteed: float
    exact: float


def tree_connectivity(agents: int) -> float:
    """``2 (1 - cos(pi/n))``: the least algebraic connectivity of a tree on n agents, that of the path."""
    return 2 * (1 - math.cos(math.pi / agents))


def bottleneck_weight(scenario: Scenario, start: float, end: float) -> float:
    """Largest w such that over ``[start, end]`` [s] each edge of some spanning tree has the integrated weight w.

    0.0 if the union of the graphs over the interval is not connected.
    """
    return _bottleneck(scenario, scenario.edge_weights.integral(start, end))


def _bottleneck(scenario: Scenario, doses: NDArray[np.float64]) -> float:
    network = scenario.network
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, network.agents + 1))
    for edge, dose in zip(network.edges, doses.tolist(), strict=True):
        if dose > _ROUNDING * float(np.max(doses)):
            graph.add_edge(*edge, weight=dose)
    if not nx.is_connected(graph):
        return 0.0
    return float(min(dose for *_, dose in nx.maximum_spanning_tree(graph).edges(data="weight")))


def repaired_corollary(scenario: Scenario) -> RepairedCorollary:
    """Group the intervals between switching instants until each group has a spanning tree, over one period.

    Raises
    ------
    ValueError
        If the weights have no period or are constant, or the union over a whole period is not connected: then no
        grouping helps.
    """
    period = scenario.edge_weights.period
    if not period:
        raise ValueError("the repaired corollary needs switching with a period; these weights have none.")
    if bottleneck_weight(scenario, 0.0, period) == 0.0:
        raise ValueError("the union of the graphs over a whole period is not connected, so no interval has a tree.")
    instants = scenario.switching.breakpoints(0.0, period).tolist()
    cuts = [0.0]
    for instant in instants:
        if bottleneck_weight(scenario, cuts[-1], instant) > 0:
            cuts.append(instant)
    # What is left at the end of the period joins the last interval if it has no tree of its own.
    if len(cuts) > 1 and bottleneck_weight(scenario, cuts[-1], period) == 0.0:
        cuts.pop()
    cuts.append(period)
    least = min(bottleneck_weight(scenario, a, b) for a, b in pairwise(cuts))
    window = 2 * max(b - a for a, b in pairwise(cuts))
    constants = scenario_excitation(scenario, Signal.DISAGREEMENT, window=window)
    return RepairedCorollary(
        tuple(cuts), least, window, least * tree_connectivity(scenario.network.agents), constants.mu1
    )

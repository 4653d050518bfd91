"""Whether agents hang together."""

from collections.abc import Sequence

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from hybrid_model.consensus.graphs.undirected import Edge, weighted_laplacian

__all__ = ["algebraic_connectivity", "components", "is_connected"]


def components(agents: int, edges: Sequence[Edge]) -> list[list[int]]:
    """The connected parts of a graph: agents from 1, each list and the list of lists ascending."""
    graph: nx.Graph[int] = nx.Graph(edges)
    graph.add_nodes_from(range(1, agents + 1))
    return sorted(sorted(part) for part in nx.connected_components(graph))


def is_connected(agents: int, edges: Sequence[Edge]) -> bool:
    """Whether every agent can be reached from every other along the edges."""
    return len(components(agents, edges)) == 1


def algebraic_connectivity(agents: int, edges: Sequence[Edge], weights: ArrayLike | None = None) -> float:
    """Second smallest eigenvalue of the weighted Laplacian: positive if and only if the weighted graph is connected.

    Parameters
    ----------
    agents : int
        n.
    edges : sequence of Edge
        The m edges.
    weights : array_like, shape (m,), optional
        Not negative; 1 for each edge by default.
    """
    values = np.ones(len(edges)) if weights is None else weights
    return float(np.linalg.eigvalsh(weighted_laplacian(agents, edges, values))[1])

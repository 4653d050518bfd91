"""Whether agents hang together."""

from collections.abc import Sequence

import networkx as nx

from hybrid_model.consensus.graphs.undirected import Edge

__all__ = ["components", "is_connected"]


def components(agents: int, edges: Sequence[Edge]) -> list[list[int]]:
    """The connected parts of a graph: agents from 1, each list and the list of lists ascending."""
    graph: nx.Graph[int] = nx.Graph(edges)
    graph.add_nodes_from(range(1, agents + 1))
    return sorted(sorted(part) for part in nx.connected_components(graph))


def is_connected(agents: int, edges: Sequence[Edge]) -> bool:
    """Whether every agent can be reached from every other along the edges."""
    return len(components(agents, edges)) == 1

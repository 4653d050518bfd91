"""Families of graphs by name, and the numbers of any NetworkX graph: the way into this package.

The generators are those of NetworkX; what is added is that agents count from 1, that every edge has a place in one
order, and that a graph which must be connected is drawn again, with the same generator, until it is.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.graphs.undirected import Edge, validate_edges

__all__ = [
    "AgentGraph",
    "GraphKind",
    "agent_graph",
    "complete_graph",
    "erdos_renyi_graph",
    "geometric_graph",
    "graph_of_kind",
    "path_graph",
    "regular_graph",
    "reorient",
    "ring_graph",
    "small_world_graph",
    "star_graph",
]

_MOST_DRAWS = 1000


class GraphKind(enum.Enum):
    """Families of graphs that a name, a number of agents, a degree and a seed decide."""

    PATH = "path"
    RING = "ring"
    STAR = "star"
    COMPLETE = "complete"
    REGULAR = "regular"
    ERDOS_RENYI = "erdos-renyi"
    GEOMETRIC = "geometric"
    SMALL_WORLD = "small-world"

    @property
    def is_random(self) -> bool:
        """Whether degree and seed say anything."""
        return self not in (GraphKind.PATH, GraphKind.RING, GraphKind.STAR, GraphKind.COMPLETE)


@dataclass(frozen=True, eq=False)
class AgentGraph:
    """A graph in numbers, as the functions of this package take it.

    Attributes
    ----------
    agents : int
        Number of agents n; they are called 1 ... n.
    edges : tuple of Edge
        The m edges, each from its tail to its head.
    nodes : tuple
        What agent 1, 2, ... is called in the NetworkX graph.
    weights : ndarray, shape (m,)
        The edges' attribute ``weight``; 1.0 where there is none.
    positions : ndarray, shape (n, 2), or None
        Places of the agents in the plane, of a geometric graph.
    """

    agents: int
    edges: tuple[Edge, ...]
    nodes: tuple[Hashable, ...]
    weights: NDArray[np.float64]
    positions: NDArray[np.float64] | None = None


def agent_graph(graph: nx.Graph) -> AgentGraph:
    """Number the nodes and edges of an undirected NetworkX graph.

    Agents follow the order of the nodes in the graph. Edges run from the lower to the higher number and are in
    lexicographic order, whatever the order in which they were added; `reorient` turns some around.

    Parameters
    ----------
    graph : networkx.Graph
        Without self-loops. Edges may have the attribute ``weight``, nodes a place ``pos``.

    Raises
    ------
    ValueError
        If the graph is directed, has parallel edges, a self-loop, or no edge.
    """
    if graph.is_directed() or graph.is_multigraph():
        kind = "directed" if graph.is_directed() else "a multigraph"
        raise ValueError(f"the graph is {kind}; this package's edges are undirected and single: give a networkx.Graph.")
    nodes = tuple(graph.nodes)
    number = {node: k for k, node in enumerate(nodes, start=1)}
    rows = sorted((*sorted((number[a], number[b])), data.get("weight", 1.0)) for a, b, data in graph.edges(data=True))
    edges = tuple((int(tail), int(head)) for tail, head, _ in rows)
    validate_edges(len(nodes), edges)
    places = nx.get_node_attributes(graph, "pos")
    positions = np.array([places[node] for node in nodes], dtype=float) if len(places) == len(nodes) else None
    return AgentGraph(len(nodes), edges, nodes, np.array([row[2] for row in rows], dtype=float), positions)


def reorient(edges: tuple[Edge, ...], turned: ArrayLike) -> tuple[Edge, ...]:
    """Turn some edges around: nothing but signs in D and Z depends on it.

    Parameters
    ----------
    edges : tuple of Edge
        The m edges.
    turned : array_like of bool, shape (m,)
        Which ones to turn.

    Raises
    ------
    ValueError
        If there is not one entry for each edge.
    """
    mask = np.asarray(turned, dtype=bool)
    if mask.shape != (len(edges),):
        raise ValueError(f"turned has the shape {mask.shape}; it must be ({len(edges)},), one entry for each edge.")
    return tuple((head, tail) if turn else (tail, head) for (tail, head), turn in zip(edges, mask, strict=True))


def path_graph(agents: int) -> AgentGraph:
    """So many `agents` in a row: n - 1 edges."""
    return agent_graph(nx.path_graph(_enough(agents, 2)))


def ring_graph(agents: int) -> AgentGraph:
    """So many `agents` in a circle, at least three: n edges."""
    return agent_graph(nx.cycle_graph(_enough(agents, 3)))


def star_graph(agents: int) -> AgentGraph:
    """Agent 1 of so many `agents` joined to all others: n - 1 edges."""
    return agent_graph(nx.star_graph(_enough(agents, 2) - 1))


def complete_graph(agents: int) -> AgentGraph:
    """Every one of so many `agents` joined to every other: n (n - 1)/2 edges."""
    return agent_graph(nx.complete_graph(_enough(agents, 2)))


def regular_graph(agents: int, degree: int, seed: int, *, connected: bool = True) -> AgentGraph:
    """A random graph in which every agent has the same number of neighbours.

    Parameters
    ----------
    agents, degree : int
        n and k with k < n and n k even.
    seed : int
        Of the random generator.
    connected : bool
        Whether to draw until the graph is connected.

    Raises
    ------
    ValueError
        If there is no such graph, or none of many draws is connected.
    """
    if not 1 <= degree < agents or agents * degree % 2:
        raise ValueError(
            f"there is no graph of {agents} agents with {degree} neighbours each; the degree must lie between 1 and "
            f"{agents - 1}, and agents times degree must be even."
        )
    return _drawn(lambda rng: nx.random_regular_graph(degree, agents, seed=rng), seed, connected, f"degree {degree}")


def erdos_renyi_graph(agents: int, probability: float, seed: int, *, connected: bool = True) -> AgentGraph:
    """Each pair of agents is joined with the same probability, independently.

    Parameters
    ----------
    agents : int
        n, at least 2.
    probability : float
        From 0 to 1.
    seed : int
        Of the random generator.
    connected : bool
        Whether to draw until the graph is connected.

    Raises
    ------
    ValueError
        If a number is out of range, or none of many draws is connected.
    """
    _in_unit_interval("probability", probability)
    count = _enough(agents, 2)
    return _drawn(
        lambda rng: nx.gnp_random_graph(count, probability, seed=rng), seed, connected, f"probability {probability}"
    )


def geometric_graph(agents: int, radius: float, seed: int, *, connected: bool = True) -> AgentGraph:
    """Agents at random places of the unit square; those at most `radius` apart are joined.

    The weights are 1; `AgentGraph.positions` has the places, for weights that depend on the distance.

    Parameters
    ----------
    agents : int
        n, at least 2.
    radius : float
        Positive, in sides of the square.
    seed : int
        Of the random generator.
    connected : bool
        Whether to draw until the graph is connected.

    Raises
    ------
    ValueError
        If a number is out of range, or none of many draws is connected.
    """
    if not radius > 0:
        raise ValueError(f"radius is {radius}; it must be positive.")
    count = _enough(agents, 2)
    return _drawn(lambda rng: nx.random_geometric_graph(count, radius, seed=rng), seed, connected, f"radius {radius}")


def small_world_graph(
    agents: int, neighbours: int, rewiring: float, seed: int, *, connected: bool = True
) -> AgentGraph:
    """A ring in which each agent is joined to its nearest neighbours, with some edges rewired at random.

    D. J. Watts, S. H. Strogatz, Nature 393 (1998) 440-442.

    Parameters
    ----------
    agents : int
        n.
    neighbours : int
        Nearest neighbours of each agent in the ring, even and below n.
    rewiring : float
        Probability, from 0 to 1, that an edge is rewired.
    seed : int
        Of the random generator.
    connected : bool
        Whether to draw until the graph is connected.

    Raises
    ------
    ValueError
        If a number is out of range, or none of many draws is connected.
    """
    _in_unit_interval("rewiring", rewiring)
    if neighbours % 2 or not 2 <= neighbours < agents:
        raise ValueError(f"neighbours is {neighbours}; it must be even and lie between 2 and {agents - 1}.")
    return _drawn(
        lambda rng: nx.watts_strogatz_graph(agents, neighbours, rewiring, seed=rng),
        seed,
        connected,
        f"rewiring {rewiring}",
    )


def graph_of_kind(
    kind: GraphKind | str, agents: int, degree: float = 4, seed: int = 0, *, rewiring: float = 0.1
) -> AgentGraph:
    """A connected graph by the name of its family.

    Parameters
    ----------
    kind : GraphKind or str
        ``"path"``, ``"ring"``, ``"star"``, ``"complete"``, or one that is drawn: ``"regular"``, ``"erdos-renyi"``,
        ``"geometric"``, ``"small-world"``.
    agents : int
        n.
    degree : float
        Neighbours of an agent: of each one in regular graphs, where it is whole, and in the ring of a small world,
        where it is even as well; on the average in Erdos-Renyi graphs, and in geometric ones inside of the square.
    seed : int
        Of the random generator.
    rewiring : float
        Of a small world, see `small_world_graph`.

    Raises
    ------
    ValueError
        If there is no such family or graph.
    """
    names = [known.value for known in GraphKind]
    if kind not in (*GraphKind, *names):
        raise ValueError(f"there is no graph '{kind}'; it must be one of {', '.join(names)}.")
    wanted = GraphKind(kind)
    if wanted.is_random and not 0 < degree < agents:
        raise ValueError(f"degree is {degree:g}; it must be above 0 and below the number of agents, {agents}.")
    if wanted in (GraphKind.REGULAR, GraphKind.SMALL_WORLD) and degree != int(degree):
        raise ValueError(f"degree is {degree}; in a {wanted.value} graph it must be whole.")
    others = max(agents - 1, 1)
    makers: dict[GraphKind, Callable[[], AgentGraph]] = {
        GraphKind.PATH: lambda: path_graph(agents),
        GraphKind.RING: lambda: ring_graph(agents),
        GraphKind.STAR: lambda: star_graph(agents),
        GraphKind.COMPLETE: lambda: complete_graph(agents),
        GraphKind.REGULAR: lambda: regular_graph(agents, int(degree), seed),
        GraphKind.ERDOS_RENYI: lambda: erdos_renyi_graph(agents, min(degree / others, 1.0), seed),
        GraphKind.GEOMETRIC: lambda: geometric_graph(agents, math.sqrt(degree / (math.pi * others)), seed),
        GraphKind.SMALL_WORLD: lambda: small_world_graph(agents, int(degree), rewiring, seed),
    }
    return makers[wanted]()


def _drawn(
    draw: Callable[[np.random.Generator], nx.Graph],
    seed: int,
    connected: bool,
    family: str,
) -> AgentGraph:
    rng = np.random.default_rng(seed)
    for _ in range(_MOST_DRAWS):
        graph = draw(rng)
        if graph.number_of_edges() and (not connected or nx.is_connected(graph)):
            return agent_graph(graph)
    wanted = "connected" if connected else "with an edge"
    raise ValueError(
        f"none of {_MOST_DRAWS} graphs drawn with {family} and seed {seed} is {wanted}; choose a denser family."
    )


def _enough(agents: int, least: int) -> int:
    if agents < least:
        raise ValueError(f"agents is {agents}; this graph needs at least {least}.")
    return agents


def _in_unit_interval(name: str, value: float) -> None:
    if not 0 <= value <= 1:
        raise ValueError(f"{name} is {value}; it must lie between 0 and 1.")

"""Whether agents hang together: the parts of a graph, the union of switching graphs, spanning trees in full number."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from hybrid_model.consensus.graphs.undirected import Edge, validate_edges, weighted_laplacian
from hybrid_model.consensus.weights.switching import Switching

__all__ = [
    "algebraic_connectivity",
    "all_spanning_trees",
    "components",
    "joint_connectivity_window",
    "spanning_tree_count",
    "union_edges",
]


def components(agents: int, edges: Sequence[Edge]) -> list[list[int]]:
    """The connected parts of a graph: agents from 1, each list and the list of lists ascending."""
    graph: nx.Graph[int] = nx.Graph(edges)
    graph.add_nodes_from(range(1, agents + 1))
    return sorted(sorted(part) for part in nx.connected_components(graph))


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


def union_edges(switching: Switching, t0: float, t1: float) -> tuple[int, ...]:
    """Numbers, from 1, of the edges that are active during some part of the time from `t0` to `t1` [s]."""
    cuts = [t0, *switching.breakpoints(t0, t1).tolist(), t1]
    masks = [switching.active_at((a + b) / 2) for a, b in itertools.pairwise(cuts)]
    return tuple(int(edge) + 1 for edge in np.flatnonzero(np.any(masks, axis=0)))


def joint_connectivity_window(
    agents: int, edges: Sequence[Edge], switching: Switching, horizon: float | None = None
) -> float | None:
    """How long one must watch, at worst, until the graphs seen have a connected union.

    Every window longer than the result contains graphs, each for some part of the time, whose union is connected; for
    no shorter length is that so. It is 0 if each graph is connected.

    Parameters
    ----------
    agents, edges
        The network.
    switching : Switching
        Which edges are active when.
    horizon : float, optional
        Windows begin between 0 and this time [s]. Needed for switching without a period; then windows that the end of
        the horizon cuts off are left out, unless none is complete.

    Returns
    -------
    float or None
        In s; None if the union of all graphs is not connected.

    Raises
    ------
    ValueError
        If the switching has no period and no horizon is given.

    Notes
    -----
    A window that begins in an interval sees that interval's graph, so the worst start is the beginning of an interval,
    and the wait ends where the interval begins that completes the union.
    """
    period = switching.period
    if horizon is None and period is None:
        raise ValueError("the switching has no period, so windows do not repeat; say up to which time they are wanted.")
    last = float(horizon if horizon is not None else period or 1.0)
    # Two periods hold every window that begins in the first and is at most one period long.
    end = last if period is None else last + (period or 0.0)
    cuts = [0.0, *switching.breakpoints(0.0, end).tolist(), end]
    masks = [switching.active_at((a + b) / 2) for a, b in itertools.pairwise(cuts)]
    longest: float | None = None
    for first, start in enumerate(cuts[:-1]):
        if start >= last:
            break
        wait = _wait(agents, edges, masks[first:], [cut - start for cut in cuts[first:-1]])
        if wait is None:
            return longest
        longest = max(longest or 0.0, wait)
    return longest


def _wait(agents: int, edges: Sequence[Edge], masks: Sequence[ArrayLike], starts: Sequence[float]) -> float | None:
    seen = np.zeros(len(edges), dtype=bool)
    for mask, start in zip(masks, starts, strict=True):
        seen |= np.asarray(mask, dtype=bool)
        if len(components(agents, [edge for edge, on in zip(edges, seen, strict=True) if on])) == 1:
            return start
    return None


def spanning_tree_count(agents: int, edges: Sequence[Edge]) -> int:
    """Number of spanning trees, by Kirchhoff's matrix-tree theorem: any cofactor of the Laplacian.

    Exact as long as the number is below about 1e15.
    """
    matrix = weighted_laplacian(agents, edges, np.ones(len(edges)))
    return round(float(np.linalg.det(matrix[1:, 1:])))


def all_spanning_trees(agents: int, edges: Sequence[Edge]) -> Iterator[tuple[int, ...]]:
    """All spanning trees as ascending tuples of edge numbers from 1, in lexicographic order; none if not connected.

    The work is proportional to their number, which `spanning_tree_count` tells in advance: ``n**(n - 2)`` for the
    complete graph.
    """
    validate_edges(agents, edges)
    if len(components(agents, edges)) > 1:
        return
    yield from _grow(agents, edges, (), 0)


def _grow(agents: int, edges: Sequence[Edge], chosen: tuple[int, ...], place: int) -> Iterator[tuple[int, ...]]:
    """The trees that contain `chosen` and else only edges from index `place` on; there is at least one."""
    if len(chosen) == agents - 1:
        yield chosen
        return
    parts = components(agents, [edges[k - 1] for k in chosen])
    tail, head = edges[place]
    if not any(tail in part and head in part for part in parts):
        yield from _grow(agents, edges, (*chosen, place + 1), place + 1)
    left = [*(edges[k - 1] for k in chosen), *edges[place + 1 :]]
    if len(components(agents, left)) == 1:
        yield from _grow(agents, edges, chosen, place + 1)

"""Matrices of an undirected graph: incidence, Laplacians, and a basis of the disagreement between agents.

Agents and edges count from 1 at this interface, as in the literature; arrays count from 0 inside. An edge ``(i, j)``
runs from its tail ``i`` (entry -1 of the incidence matrix) to its head ``j`` (entry +1), so ``D.T @ x`` holds
``x_j - x_i``.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Edge",
    "complete_edges",
    "disagreement_basis",
    "incidence",
    "laplacian",
    "validate_edges",
    "weighted_laplacian",
]

Edge = tuple[int, int]


def validate_edges(agents: int, edges: Sequence[Edge]) -> None:
    """Check that `edges` describe a simple graph on the agents 1 ... `agents`.

    Raises
    ------
    ValueError
        If there is no edge, an agent is out of range, or an edge is a self-loop or repeats another, reversed or not.
    """
    if len(edges) == 0:
        raise ValueError("edges is empty; a network needs at least one edge.")
    seen: dict[frozenset[int], int] = {}
    for number, edge in enumerate(edges, start=1):
        tail, head = edge
        for agent in edge:
            if not 1 <= agent <= agents:
                raise ValueError(
                    f"edge {number} is {list(edge)} and names agent {agent}; agents are numbered from 1 to {agents}."
                )
        if tail == head:
            raise ValueError(f"edge {number} is {list(edge)}, a self-loop; an edge must join two different agents.")
        first = seen.setdefault(frozenset(edge), number)
        if first != number:
            raise ValueError(
                f"edge {number} is {list(edge)} and repeats edge {first}, {list(edges[first - 1])}; "
                "edges are undirected, so list each pair of agents once."
            )


def complete_edges(agents: int, first: Sequence[Edge] = ()) -> tuple[Edge, ...]:
    """Edges of the complete graph on `agents` agents: `first`, then the missing pairs in lexicographic order."""
    present = {frozenset(edge) for edge in first}
    pairs = ((i, j) for i in range(1, agents + 1) for j in range(i + 1, agents + 1))
    return (*first, *(pair for pair in pairs if frozenset(pair) not in present))


def incidence(agents: int, edges: Sequence[Edge]) -> NDArray[np.float64]:
    """Incidence matrix D, shape (agents, edges): -1 at the tail and +1 at the head of each edge (paper, section 2.1).

    Raises
    ------
    ValueError
        As `validate_edges`.
    """
    validate_edges(agents, edges)
    tails, heads = (np.asarray(edges) - 1).T
    columns = np.arange(len(edges))
    matrix = np.zeros((agents, len(edges)))
    matrix[tails, columns] = -1.0
    matrix[heads, columns] = 1.0
    return matrix


def laplacian(agents: int, edges: Sequence[Edge]) -> NDArray[np.float64]:
    """Laplacian ``L = D D^T``, shape (agents, agents); paper, section 2.1."""
    D = incidence(agents, edges)
    return D @ D.T


def weighted_laplacian(agents: int, edges: Sequence[Edge], weights: ArrayLike) -> NDArray[np.float64]:
    """Weighted Laplacian ``D diag(weights) D^T``, shape (agents, agents); paper, section 2.1.

    Raises
    ------
    ValueError
        If there is not one weight per edge.
    """
    values = np.asarray(weights, dtype=float)
    if values.shape != (len(edges),):
        raise ValueError(f"weights has the shape {values.shape}; it must be ({len(edges)},), one number per edge.")
    D = incidence(agents, edges)
    return np.asarray((D * values) @ D.T)


def disagreement_basis(agents: int) -> NDArray[np.float64]:
    """Orthonormal basis U, shape (agents, agents - 1), of the vectors whose entries add up to zero.

    Column ``j`` (from 1) compares agent ``j + 1`` with the agents before it. Source: audit, section 1.
    """
    U = np.zeros((agents, agents - 1))
    for j in range(1, agents):
        U[:j, j - 1] = 1.0
        U[j, j - 1] = -j
        U[:, j - 1] /= np.sqrt(j * (j + 1))
    return U

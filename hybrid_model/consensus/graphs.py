"""Matrices of an undirected graph: incidence, Laplacians, and the coordinates along a spanning tree.

Agents and edges count from 1 at this interface, as in the literature; arrays count from 0 inside. An edge ``(i, j)``
runs from its tail ``i`` (entry -1 of the incidence matrix) to its head ``j`` (entry +1), so ``D.T @ x`` holds
``x_j - x_i``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Edge",
    "TreePartition",
    "complete_edges",
    "disagreement_basis",
    "edge_laplacian",
    "incidence",
    "is_connected",
    "laplacian",
    "spanning_tree",
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


def edge_laplacian(agents: int, edges: Sequence[Edge]) -> NDArray[np.float64]:
    """Edge Laplacian ``L_e = D^T D``, shape (edges, edges); paper, section 3."""
    D = incidence(agents, edges)
    return D.T @ D


def is_connected(agents: int, edges: Sequence[Edge]) -> bool:
    """Whether every agent can be reached from every other along the edges."""
    return bool(nx.is_connected(_networkx_graph(agents, edges)))


def spanning_tree(agents: int, edges: Sequence[Edge]) -> tuple[int, ...]:
    """Numbers, from 1, of the edges of the first spanning tree in edge order.

    "First" means that an edge belongs to it if the edges before it leave its ends unconnected.

    Raises
    ------
    ValueError
        If the graph is not connected and so has no spanning tree.
    """
    graph = _networkx_graph(agents, edges)
    if not nx.is_connected(graph):
        parts = [sorted(part) for part in nx.connected_components(graph)]
        raise ValueError(
            f"the graph is not connected: its parts are the agents {parts}; a spanning tree needs edges between them."
        )
    tree = nx.minimum_spanning_edges(graph, algorithm="kruskal", weight="number", data=True)
    return tuple(sorted(data["number"] for _, _, data in tree))


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


@dataclass(frozen=True)
class TreePartition:
    """Edges split into a spanning tree and the remaining (cycle) edges, and the matrices that follow from the split.

    Parameters
    ----------
    agents : int
        Number of agents n.
    edges : tuple of Edge
        All m edges of the connected graph, in the order of the user.
    tree : tuple of int, optional
        Numbers, from 1, of the p = n - 1 tree edges; by default those of `spanning_tree`.

    Raises
    ------
    ValueError
        If the graph is not connected or `tree` is not a spanning tree of it.

    Notes
    -----
    Source: paper, section 3. ``Gamma`` and ``Lambda`` depend on the chosen tree and are a matter of coordinates only
    (audit, section 1).
    """

    agents: int
    edges: tuple[Edge, ...]
    tree: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Fill in the default tree and check the graph."""
        validate_edges(self.agents, self.edges)
        if not self.tree:
            object.__setattr__(self, "tree", spanning_tree(self.agents, self.edges))
        for number in self.tree:
            if not 1 <= number <= len(self.edges):
                raise ValueError(f"tree names edge {number}; edges are numbered from 1 to {len(self.edges)}.")
        tree_graph = _networkx_graph(self.agents, [self.edges[number - 1] for number in self.tree])
        if len(set(self.tree)) < len(self.tree) or not nx.is_tree(tree_graph):
            raise ValueError(
                f"tree is {list(self.tree)}, which is not a spanning tree; "
                f"it must join all {self.agents} agents with {self.agents - 1} edges."
            )

    @property
    def cycle(self) -> tuple[int, ...]:
        """Numbers, from 1, of the edges outside the tree, ascending."""
        return tuple(number for number in range(1, len(self.edges) + 1) if number not in self.tree)

    @property
    def order(self) -> NDArray[np.intp]:
        """Indices, from 0 and shape (m,), that bring edges into the paper's order: tree first, then cycle."""
        return np.asarray((*self.tree, *self.cycle), dtype=np.intp) - 1

    @cached_property
    def incidence_tree(self) -> NDArray[np.float64]:
        """``D_tau``, shape (n, p)."""
        return incidence(self.agents, self.edges)[:, self.order[: self.agents - 1]]

    @cached_property
    def incidence_cycle(self) -> NDArray[np.float64]:
        """``D_c``, shape (n, m - p)."""
        return incidence(self.agents, self.edges)[:, self.order[self.agents - 1 :]]

    @cached_property
    def edge_laplacian_tree(self) -> NDArray[np.float64]:
        """``L_e(tau) = D_tau^T D_tau``, shape (p, p), positive definite."""
        return self.incidence_tree.T @ self.incidence_tree

    @cached_property
    def Z(self) -> NDArray[np.float64]:
        """``L_e(tau)^{-1} D_tau^T D_c``, shape (p, m - p): ``D_c = D_tau Z`` and ``x_c = Z^T x_tau``."""
        return np.asarray(np.linalg.solve(self.edge_laplacian_tree, self.incidence_tree.T @ self.incidence_cycle))

    @cached_property
    def R(self) -> NDArray[np.float64]:
        """``[I_p Z]``, shape (p, m), columns in the paper's order (tree first): ``D = D_tau R``."""
        return np.hstack((np.eye(self.agents - 1), self.Z))

    @cached_property
    def R_by_edge(self) -> NDArray[np.float64]:
        """``R``, shape (p, m), with its columns in the user's order of the edges."""
        matrix = np.empty_like(self.R)
        matrix[:, self.order] = self.R
        return matrix

    @cached_property
    def Lambda(self) -> NDArray[np.float64]:
        """Eigenvalues of ``L_e(tau)``, shape (p,), ascending (the diagonal of the paper's matrix)."""
        return np.asarray(np.linalg.eigh(self.edge_laplacian_tree).eigenvalues)

    @cached_property
    def Gamma(self) -> NDArray[np.float64]:
        """Orthogonal matrix, shape (p, p), with ``L_e(tau) = Gamma diag(Lambda) Gamma^T``."""
        return np.asarray(np.linalg.eigh(self.edge_laplacian_tree).eigenvectors)

    @cached_property
    def psi(self) -> NDArray[np.float64]:
        """``Gamma^T [I_p 0] D^T = Gamma^T D_tau^T``, shape (p, n): ``Upsilon = psi x``."""
        return self.Gamma.T @ self.incidence_tree.T

    @cached_property
    def rho(self) -> float:
        """``sqrt(1 + ||Z||^2)``, the tight factor in ``||x_e|| <= rho ||Upsilon||`` (audit, section 1)."""
        return float(np.linalg.norm(self.R, 2))


def _networkx_graph(agents: int, edges: Sequence[Edge]) -> "nx.Graph[int]":
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, agents + 1))
    graph.add_edges_from((tail, head, {"number": number}) for number, (tail, head) in enumerate(edges, start=1))
    return graph

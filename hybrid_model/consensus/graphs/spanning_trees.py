"""Spanning trees, and coordinates of a connected graph along one of them: the transformations of the paper's section 3.

Edges are numbered from 1 at this interface, in the order of the user; arrays count from 0 inside.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.graphs.connectivity import components, is_connected
from hybrid_model.consensus.graphs.undirected import Edge, incidence, validate_edges, weighted_laplacian

__all__ = ["TreePartition", "all_spanning_trees", "spanning_tree", "spanning_tree_count"]


def spanning_tree(agents: int, edges: Sequence[Edge]) -> tuple[int, ...]:
    """Numbers, from 1, of the edges of the first spanning tree in edge order.

    "First" means that an edge belongs to it if the edges before it leave its ends unconnected.

    Raises
    ------
    ValueError
        If the graph is not connected and so has no spanning tree.
    """
    parts = components(agents, edges)
    if len(parts) > 1:
        raise ValueError(
            f"the graph is not connected: its parts are the agents {parts}; a spanning tree needs edges between them."
        )
    tree = nx.minimum_spanning_edges(_networkx_graph(agents, edges), algorithm="kruskal", weight="number", data=True)
    return tuple(sorted(data["number"] for _, _, data in tree))


def spanning_tree_count(agents: int, edges: Sequence[Edge]) -> int:
    """Number of spanning trees of a graph with so many `agents` and these `edges`.

    By Kirchhoff's matrix-tree theorem: any cofactor of the Laplacian. Exact as long as the number is below about 1e15.
    """
    matrix = weighted_laplacian(agents, edges, np.ones(len(edges)))
    return round(float(np.linalg.det(matrix[1:, 1:])))


def all_spanning_trees(agents: int, edges: Sequence[Edge]) -> Iterator[tuple[int, ...]]:
    """All spanning trees as ascending tuples of edge numbers from 1, in lexicographic order; none if not connected.

    Of a graph with so many `agents` and these `edges`. The work is proportional to their number, which
    `spanning_tree_count` tells in advance: ``n**(n - 2)`` for the complete graph.
    """
    validate_edges(agents, edges)
    if not is_connected(agents, edges):
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
    if is_connected(agents, left):
        yield from _grow(agents, edges, chosen, place + 1)


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
        """``sqrt(1 + ||Z||^2)``, the tight factor in ``||x_e|| <= rho ||Upsilon||`` (audit, section 4)."""
        return float(np.linalg.norm(self.R, 2))


def _networkx_graph(agents: int, edges: Sequence[Edge]) -> "nx.Graph[int]":
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, agents + 1))
    graph.add_edges_from((tail, head, {"number": number}) for number, (tail, head) in enumerate(edges, start=1))
    return graph

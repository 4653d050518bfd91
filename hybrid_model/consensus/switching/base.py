"""What every kind of switching offers, and no switching."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.over_time import OverTime
from hybrid_model.declare.variables import Value

__all__ = ["NoSwitching", "Switching", "SwitchingAutomaton", "masks", "validate_active"]


class SwitchingAutomaton(hm.HybridAutomaton):
    """Lets through the weights of the active ones of an agent's edges."""

    degree = hm.Dimension("number of edges")
    raw = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges if they were always active")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges, zero for the inactive ones")

    @abstractmethod
    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights of the active edges."""


class Switching(OverTime):
    """Which edges may carry weight when."""

    edge_count: int
    """Number of edges of the network."""

    @abstractmethod
    def phase(self, t: float) -> int:
        """Index, from 0, of the graph that is active at `t` [s]; at a switching instant, of the one that begins."""

    @abstractmethod
    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask, shape (edge_count,), of the edges that are active at `t` [s]."""

    @abstractmethod
    def automaton(self, edges: Sequence[int]) -> SwitchingAutomaton | None:
        """Make what lets through the weights of the active ones of `edges` (from 0); None if nothing is held back."""


@dataclass(frozen=True)
class NoSwitching(Switching):
    """All edges active at all times."""

    edge_count: int
    period = 0.0

    def phase(self, t: float) -> int:
        """0, the only phase."""
        return 0

    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask of shape (edge_count,), all true."""
        return np.ones(self.edge_count, dtype=bool)

    def automaton(self, edges: Sequence[int]) -> None:
        """None: nothing is held back."""


def masks(active: Sequence[Sequence[int]], edges: Sequence[int]) -> list[list[float]]:
    """Return, for each graph, 1 for those of the `edges` (from 0) that it lists (from 1), else 0."""
    return [[float(edge + 1 in graph) for edge in edges] for graph in active]


def validate_active(active: tuple[tuple[int, ...], ...], edge_count: int) -> None:
    """Check a list of graphs, each a list of edge numbers; ValueError that names the first wrong one."""
    if not active:
        raise ValueError("active is empty; it must list the active edges of at least one phase.")
    for number, edges in enumerate(active, start=1):
        for edge in edges:
            if not 1 <= edge <= edge_count:
                raise ValueError(f"active phase {number} names edge {edge}; edges are numbered from 1 to {edge_count}.")
        if len(set(edges)) < len(edges):
            raise ValueError(f"active phase {number} is {list(edges)}; each edge may be listed only once.")

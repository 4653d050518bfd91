"""A list of graphs, each with its own dwell time, that repeats or ends with the run."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.weights.row_clock import RowClock
from hybrid_model.consensus.weights.waveform import ALWAYS, require

__all__ = ["SwitchingSequence", "validate_active"]


@dataclass(frozen=True)
class SwitchingSequence:
    """Switching along a list: first the edges ``active[0]`` for the time ``dwells[0]``, then the next; from t = 0.

    Parameters
    ----------
    dwells : tuple of float
        Length of each interval [s], positive.
    active : tuple of tuple of int
        For each interval the edges, counted from 1, that may carry weight. May be empty.
    edge_count : int
        Number of edges of the network.
    repeat : bool
        Whether the list starts anew when it is through. Otherwise it must cover the whole run: a scenario whose stop
        time lies behind its end is refused.

    Raises
    ------
    ValueError
        If the lists are empty or differ in length, a dwell is not a positive number, or an edge number is out of range
        or repeated.
    """

    dwells: tuple[float, ...]
    active: tuple[tuple[int, ...], ...]
    edge_count: int
    repeat: bool = False

    def __post_init__(self) -> None:
        """Check the values."""
        validate_active(self.active, self.edge_count)
        if len(self.dwells) != len(self.active):
            raise ValueError(f"dwell lists {len(self.dwells)} times for {len(self.active)} graphs; give one for each.")
        for number, dwell in enumerate(self.dwells, start=1):
            require(f"dwell[{number}]", dwell, dwell > 0, "must be positive")

    @cached_property
    def clock(self) -> RowClock:
        """Which interval holds a time."""
        starts = (0.0, *itertools.accumulate(self.dwells))
        return RowClock(starts[:-1], starts[-1] if self.repeat else None)

    @property
    def duration(self) -> float:
        """Length of the list [s]."""
        return list(itertools.accumulate(self.dwells))[-1]

    @property
    def period(self) -> float | None:
        """The duration [s] if the list repeats, else None; 0.0 if all graphs are equal."""
        if all(set(edges) == set(self.active[0]) for edges in self.active):
            return 0.0
        return self.duration if self.repeat else None

    @property
    def domain(self) -> tuple[float, float]:
        """From 0 to the duration [s]; all times if the list repeats. Outside, the first or the last graph stays."""
        return ALWAYS if self.repeat else (0.0, self.duration)

    def phase(self, t: float) -> int:
        """Place in the list, from 0, of the graph that is active at `t` [s]."""
        return int(self.clock.place(t))

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Switching instants strictly between `t0` and `t1` [s], ascending."""
        return self.clock.breakpoints(t0, t1)

    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask, shape (edge_count,), of the edges that are active at time `t` [s]."""
        return np.asarray(self._masks[self.phase(t)])

    @cached_property
    def _masks(self) -> NDArray[np.bool_]:
        masks = np.zeros((len(self.active), self.edge_count), dtype=bool)
        for row, edges in zip(masks, self.active, strict=True):
            row[[edge - 1 for edge in edges]] = True
        masks.setflags(write=False)
        return masks


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

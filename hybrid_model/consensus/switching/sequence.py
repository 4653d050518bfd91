"""A list of graphs, each with its own dwell time, that repeats or ends with the run."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import in_turn
from hybrid_model.consensus.clocks.over_time import ALWAYS, require
from hybrid_model.consensus.clocks.rows import RowAutomaton, RowClock
from hybrid_model.consensus.switching.base import Switching, SwitchingAutomaton, masks, validate_active
from hybrid_model.declare.variables import Value

__all__ = ["SequenceSwitching", "SwitchingSequence"]


class SequenceSwitching(RowAutomaton, SwitchingAutomaton):
    """Edges that are active row by row of a table, each row for its own time (paper, section 6)."""

    active = hm.Parameter(1.0, shape=("rows", "degree"), description="1 where an edge is active in a graph, else 0")
    mask = hm.DiscreteState(
        0.0, shape="degree", internal=True, computed=True, description="1 where an edge is active now, else 0"
    )

    def held(self, row: Value, s: hm.Values) -> dict[str, Value]:
        """The active edges."""
        return {"mask": in_turn(row, s.starts.shape[0]) @ s.active}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights of the active edges."""
        return {"weights": s.mask * s.raw}


@dataclass(frozen=True)
class SwitchingSequence(Switching):
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

    def automaton(self, edges: Sequence[int]) -> SequenceSwitching | None:
        """See `Switching.automaton`."""
        if not edges:
            return None
        starts, period = self.clock.starts, self.clock.period or 0.0
        return SequenceSwitching(starts=starts, period=period, active=masks(self.active, edges))

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """See `OverTime.changes`."""
        if self.repeat:
            yield "duration or dwell", end / self.duration * len(self.dwells)

"""Cyclic switching: graphs in turn, each for the same dwell time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import dwell_boundary, dwell_index, in_turn
from hybrid_model.consensus.switching.base import Switching, SwitchingAutomaton, masks, validate_active
from hybrid_model.declare.variables import Value

__all__ = ["PeriodicSwitching", "SwitchingCycle"]


class PeriodicSwitching(SwitchingAutomaton):
    """Edges that are active in turn: row after row of a table, each for a dwell time, for ever (paper, section 7)."""

    phases = hm.Dimension("number of graphs in the cycle")
    interval = hm.DiscreteState(
        0, integer=True, internal=True, computed=True, description="index of the dwell interval"
    )
    dwell = hm.Parameter(1.0, unit="s", description="time that each graph stays")
    active = hm.Parameter(1.0, shape=("phases", "degree"), description="1 where an edge is active in a graph, else 0")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The interval that holds the start time."""
        return {"interval": dwell_index(s.t, s.dwell)}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights of the active edges."""
        return {"weights": (in_turn(s.interval, s.active.shape[0]) @ s.active) * s.raw}

    def next_graph(self, s: hm.Values) -> Value:
        """Time at which the next graph takes over."""
        return dwell_boundary(s.interval, s.dwell)

    def switch(self, s: hm.Values) -> dict[str, Value]:
        """Go on to the next graph."""
        return {"interval": s.interval + 1}

    transitions = (hm.TimeEvent("graph", next_graph, switch, internal=True),)


@dataclass(frozen=True)
class SwitchingCycle(Switching):
    """Cyclic switching: during dwell interval j the edges ``active[j mod phases]`` may carry weight, the others not.

    Parameters
    ----------
    dwell : float
        Length of each dwell interval [s], positive; interval 0 starts at t = 0.
    active : tuple of tuple of int
        One tuple of edge numbers, counted from 1, for each phase of the cycle. A phase may be empty.
    edge_count : int
        Number of edges of the network.

    Raises
    ------
    ValueError
        If the dwell is not a positive number, no phase is given, or an edge number is out of range or repeated.

    Notes
    -----
    Source: paper, section 6 (switching topologies) and section 7 (two trees "in contiguous intervals").
    """

    dwell: float
    active: tuple[tuple[int, ...], ...]
    edge_count: int

    def __post_init__(self) -> None:
        """Check the values."""
        if not (math.isfinite(self.dwell) and self.dwell > 0):
            raise ValueError(f"dwell is {self.dwell}; it must be a positive, finite number of seconds.")
        validate_active(self.active, self.edge_count)

    @property
    def period(self) -> float:
        """Length of the whole cycle [s]; 0.0 if all phases have the same active edges."""
        is_constant = all(set(edges) == set(self.active[0]) for edges in self.active)
        return 0.0 if is_constant else self.dwell * len(self.active)

    def phase(self, t: float) -> int:
        """Index, from 0, of the phase that holds time `t` [s]; at a switching instant, of the phase that begins."""
        return int(dwell_index(t, self.dwell)) % len(self.active)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Switching instants strictly between `t0` and `t1` [s], ascending."""
        times: NDArray[np.float64] = dwell_boundary(
            np.arange(dwell_index(t0, self.dwell), dwell_index(t1, self.dwell)), self.dwell
        )
        return times[(times > t0) & (times < t1)]

    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask, shape (edge_count,), of the edges that are active at time `t` [s]."""
        mask = np.zeros(self.edge_count, dtype=bool)
        mask[[edge - 1 for edge in self.active[self.phase(t)]]] = True
        return mask

    def automaton(self, edges: Sequence[int]) -> PeriodicSwitching | None:
        """See `Switching.automaton`."""
        return PeriodicSwitching(dwell=self.dwell, active=masks(self.active, edges)) if edges else None

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """See `OverTime.changes`."""
        yield "dwell", end / self.dwell

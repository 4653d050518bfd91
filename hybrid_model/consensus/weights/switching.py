"""Switching of the active edges: cyclic with a fixed dwell time, or none; the interface of all kinds."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.weights.clockwork import dwell_boundary, dwell_index
from hybrid_model.consensus.weights.switching_sequence import SwitchingSequence, validate_active
from hybrid_model.consensus.weights.waveform import ALWAYS

__all__ = ["NoSwitching", "PeriodicSwitching", "Switching", "SwitchingSequence", "dwell_boundary", "dwell_index"]


class Switching(Protocol):
    """Which edges may carry weight when."""

    @property
    def edge_count(self) -> int:
        """Number of edges of the network."""

    @property
    def period(self) -> float | None:
        """A period [s]; 0.0 if nothing ever changes, None if there is none."""

    @property
    def domain(self) -> tuple[float, float]:
        """First and last time [s] that the switching is given for."""

    def phase(self, t: float) -> int:
        """Index, from 0, of the graph that is active at `t` [s]."""

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Switching instants strictly between `t0` and `t1` [s], ascending."""

    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask, shape (edge_count,), of the edges that are active at `t` [s]."""


@dataclass(frozen=True)
class PeriodicSwitching:
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

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

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


@dataclass(frozen=True)
class NoSwitching:
    """All edges active at all times, with the interface of `PeriodicSwitching`."""

    edge_count: int

    @property
    def period(self) -> float:
        """0.0: nothing changes."""
        return 0.0

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def phase(self, t: float) -> int:
        """0, the only phase."""
        return 0

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """None: an empty array."""
        return np.empty(0)

    def active_at(self, t: float) -> NDArray[np.bool_]:
        """Mask of shape (edge_count,), all true."""
        return np.ones(self.edge_count, dtype=bool)

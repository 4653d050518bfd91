"""Weights that are constant on pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.clocks.rows import RowClock, check_rows
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.tabulated import TabulatedWeights
from hybrid_model.consensus.weights.waveform import Waveform, each_edge, require_values
from hybrid_model.declare.variables import FloatArray

__all__ = ["PiecewiseWeight"]


@dataclass(frozen=True)
class PiecewiseWeight(Waveform):
    """A weight that is constant on pieces: ``values[k]`` from ``starts[k]`` on.

    Parameters
    ----------
    starts : tuple of float
        Times [s] at which the pieces begin, ascending.
    values : tuple of float
        The weight on each piece, not negative.
    cycle : float, optional
        Time [s] after which the pieces repeat. Without it the last value stays for ever, and the first one holds before
        the first start too.

    Raises
    ------
    ValueError
        If the lists differ in length, a number is out of range or the times do not ascend.
    """

    starts: tuple[float, ...]
    values: tuple[float, ...]
    cycle: float | None = None
    automaton = TabulatedWeights
    carrier = UnitCarrier()
    further_keys: ClassVar[tuple[str, ...]] = ("starts", "values", "cycle")

    def __post_init__(self) -> None:
        """Check the values."""
        check_rows(self.starts, self.cycle, ("starts", "cycle"))
        require_values(self.values, len(self.starts), "starts")

    @cached_property
    def clock(self) -> RowClock:
        """Which piece holds a time."""
        return RowClock(self.starts, self.cycle)

    @property
    def period(self) -> float | None:
        """The cycle [s]; 0.0 if all values are equal; None if the pieces do not repeat."""
        return 0.0 if len(set(self.values)) == 1 else self.cycle

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        return self._levels[self.clock.place(t)]

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which a piece begins."""
        return self.clock.breakpoints(t0, t1)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        flat = np.zeros_like(self._levels)
        return self.clock.primitive(self._levels, flat, t1) - self.clock.primitive(self._levels, flat, t0)

    @cached_property
    def _levels(self) -> NDArray[np.float64]:
        return np.array(self.values, dtype=float)

    def lines(self, begins: FloatArray, middles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values at the beginnings of rows, and slopes in them; see `TabulatedWeights`."""
        return self.amplitude(middles), np.zeros(len(begins))

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """See `OverTime.changes`."""
        if self.cycle is not None:
            yield "cycle", end / self.cycle * len(self.starts)

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """See `Waveform.read`."""
        starts = entries.numbers("starts")
        cycle = entries.number("cycle") if "cycle" in entries else None
        return each_edge(cls, ((starts, values, cycle) for values in entries.rows("values", edges)))

"""Weights known from samples, with straight lines between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.clocks.over_time import ALWAYS
from hybrid_model.consensus.clocks.rows import RowClock, check_rows, on_line
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import shown
from hybrid_model.consensus.weights.sample_files import read_samples
from hybrid_model.consensus.weights.tabulated import TabulatedWeights
from hybrid_model.consensus.weights.waveform import Waveform, each_edge, require_values
from hybrid_model.declare.variables import FloatArray

__all__ = ["LinearCarrier", "SampledWeight"]


@dataclass(frozen=True)
class LinearCarrier:
    """A function that runs straight from sample to sample, see `SampledWeight`."""

    times: tuple[float, ...]
    values: tuple[float, ...]
    repeat: bool

    def __hash__(self) -> int:
        """Taken once: the samples may be many."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((self.times, self.values, self.repeat))

    @property
    def rate(self) -> float:
        """0.0: it does not oscillate between breakpoints."""
        return 0.0

    @property
    def steepness(self) -> float:
        """The largest slope."""
        return float(np.max(np.abs(self.slopes)))

    @cached_property
    def clock(self) -> RowClock:
        """Which pair of samples a time lies between; one row more, without end, behind samples that do not repeat."""
        if self.repeat:
            return RowClock(self.times[:-1], self.times[-1] - self.times[0])
        return RowClock(self.times)

    @cached_property
    def levels(self) -> NDArray[np.float64]:
        """Value at the beginning of each row of the clock."""
        return np.array(self.values[: self.clock.rows], dtype=float)

    @cached_property
    def slopes(self) -> NDArray[np.float64]:
        """Slope [1/s] in each row of the clock."""
        slopes = np.diff(np.array(self.values)) / np.diff(np.array(self.times))
        return slopes if self.repeat else np.append(slopes, 0.0)

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """Value at time `t` [s]."""
        time = np.asarray(t, dtype=float)
        number = self.clock.number(time)
        place = number % self.clock.rows
        return np.asarray(on_line(self.levels[place], self.slopes[place], self.clock.begin(number), time))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral from `t0` to `t1` [s]."""
        primitive = self.clock.primitive
        return primitive(self.levels, self.slopes, t1) - primitive(self.levels, self.slopes, t0)


@dataclass(frozen=True)
class SampledWeight(Waveform):
    """A weight known from samples: a straight line between one sample and the next.

    Parameters
    ----------
    times : tuple of float
        Times [s] of the samples, ascending, at least two.
    values : tuple of float
        The weight at those times, not negative.
    repeat : bool
        Whether the samples repeat with the period ``times[-1] - times[0]``; the weight jumps there if the last sample
        differs from the first. Otherwise the samples must cover the whole run: a scenario refuses to extrapolate.

    Raises
    ------
    ValueError
        If the lists differ in length, a number is out of range or the times do not ascend.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    repeat: bool = False
    automaton = TabulatedWeights
    further_keys: ClassVar[tuple[str, ...]] = ("file", "times", "values", "repeat")

    def __post_init__(self) -> None:
        """Check the values."""
        if len(self.times) < 2:
            raise ValueError(f"times lists {len(self.times)} samples; there must be at least 2.")
        check_rows(self.times, None, ("times", ""))
        require_values(self.values, len(self.times), "times")

    def __hash__(self) -> int:
        """Taken once: the samples may be many."""
        return hash((self.carrier, self._scale))

    @cached_property
    def carrier(self) -> LinearCarrier:
        """The samples, scaled to a largest value of 1: edges whose samples are proportional share it."""
        scale = self._scale or 1.0
        return LinearCarrier(self.times, tuple(value / scale for value in self.values), self.repeat)

    @property
    def period(self) -> float | None:
        """Time from the first sample to the last [s]; 0.0 if all values are equal; None if they do not repeat."""
        if len(set(self.values)) == 1:
            return 0.0
        return self.times[-1] - self.times[0] if self.repeat else None

    @property
    def domain(self) -> tuple[float, float]:
        """From the first sample to the last [s]; all times if they repeat."""
        return ALWAYS if self.repeat else (self.times[0], self.times[-1])

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The largest sample, in the shape of `t` [s]."""
        return np.full(np.shape(t), self._scale)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times of samples strictly between `t0` and `t1` [s], ascending."""
        return self.clock.breakpoints(t0, t1)

    @property
    def clock(self) -> RowClock:
        """Which pair of samples a time lies between."""
        return self.carrier.clock

    def lines(self, begins: FloatArray, middles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values at the beginnings of rows, and slopes in them; see `TabulatedWeights`."""
        place, own = self.clock.place(middles), self.clock.begin(self.clock.number(middles))
        slopes = np.where(middles < own, 0.0, self._scale * self.carrier.slopes[place])
        values = self._scale * self.carrier.levels[place] + slopes * (begins - own)
        return np.maximum(values, 0.0), slopes

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """See `OverTime.changes`."""
        if self.repeat:
            yield "times", end / (self.times[-1] - self.times[0]) * len(self.times)

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """See `Waveform.read`."""
        repeat, source = entries.flag("repeat", default=False), ""
        if "file" in entries:
            for key in ("times", "values"):
                if key in entries:
                    raise entries.error(key, "given beside file", "must be left out if the samples come from a file")
            name = entries.text("file")
            times, columns = read_samples(folder / name, edges)
            source = f"file {shown(name)}, samples"
        else:
            times, columns = entries.numbers("times"), entries.rows("values", edges)
        return each_edge(cls, ((times, values, repeat) for values in columns), source)

    @property
    def _scale(self) -> float:
        return float(max(self.values))

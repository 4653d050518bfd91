"""Weights given by tables: levels that hold for a while, or samples with straight lines between them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.clockwork import not_negative
from hybrid_model.consensus.weights.row_clock import RowClock, check_rows
from hybrid_model.consensus.weights.waveform import ALWAYS, require

__all__ = ["LinearCarrier", "PiecewiseWeight", "SampledWeight"]


@dataclass(frozen=True)
class PiecewiseWeight:
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

    def __post_init__(self) -> None:
        """Check the values."""
        check_rows(self.starts, self.cycle, ("starts", "cycle"))
        _require_values(self.values, len(self.starts), "starts")

    @cached_property
    def clock(self) -> RowClock:
        """Which piece holds a time."""
        return RowClock(self.starts, self.cycle)

    @property
    def carrier(self) -> UnitCarrier:
        """The carrier 1."""
        return UnitCarrier()

    @property
    def period(self) -> float | None:
        """The cycle [s]; 0.0 if all values are equal; None if the pieces do not repeat."""
        return 0.0 if len(set(self.values)) == 1 else self.cycle

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        return self._levels[self.clock.place(t)]

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        return self.amplitude(t)

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
        within = np.maximum(time - self.clock.begin(number), 0.0)
        return np.asarray(not_negative(self.levels[place] + self.slopes[place] * within))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral from `t0` to `t1` [s]."""
        primitive = self.clock.primitive
        return primitive(self.levels, self.slopes, t1) - primitive(self.levels, self.slopes, t0)


@dataclass(frozen=True)
class SampledWeight:
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

    def __post_init__(self) -> None:
        """Check the values."""
        if len(self.times) < 2:
            raise ValueError(f"times lists {len(self.times)} samples; there must be at least 2.")
        check_rows(self.times, None, ("times", ""))
        _require_values(self.values, len(self.times), "times")

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

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`; outside the samples that of the nearest one."""
        return self._scale * self.carrier.value(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times of samples strictly between `t0` and `t1` [s], ascending."""
        return self.carrier.clock.breakpoints(t0, t1)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        return self._scale * self.carrier.integral(t0, t1)

    @property
    def _scale(self) -> float:
        return float(max(self.values))


def _require_values(values: tuple[float, ...], count: int, others: str) -> None:
    if len(values) != count:
        raise ValueError(f"values lists {len(values)} numbers for {count} {others}; give one for each.")
    for number, value in enumerate(values, start=1):
        require(f"values[{number}]", value, value >= 0, "must not be negative")

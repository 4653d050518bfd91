"""The clock of tables: which row of a table holds a time, with rows that repeat or a last row that stays.

Rows have numbers ``k = cycle*rows + row``; row `row` of cycle `cycle` begins at ``starts[row] + cycle*period``. A
period of 0 stands for a table that does not repeat: there is one cycle, its last row has no end, and its first row
holds all times before it as well. `row_number`, `row_begin` and `on_line` are written for floats and for symbols
alike; a time that equals a computed beginning bit for bit lies in the row that begins.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import holding, in_turn, not_negative
from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.declare.variables import Value

__all__ = ["RowAutomaton", "RowClock", "check_rows", "on_line", "row_begin", "row_number"]


def row_number(t: Value, starts: Value, period: Value) -> Value:
    """Number of the row that holds the scalar time `t` [s] in a table with beginnings `starts`, shape (rows,) [s]."""
    rows = starts.shape[0]
    repeats = np.where(period > 0, 1.0, 0.0)
    step = np.where(period > 0, period, 1.0)
    cycle = repeats * holding(t, np.floor((t - starts[0]) / step), lambda k: starts[0] + (k + 1) * step)
    begun = np.sum(np.where(t >= starts + cycle * period, 1.0, 0.0))
    return cycle * rows + np.maximum(begun - 1, 0.0)


def row_begin(k: Value, starts: Value, period: Value) -> Value:
    """Time [s] at which row number `k` begins; infinity behind the last row of a table that does not repeat."""
    rows = starts.shape[0]
    cycle = np.floor(k / rows)
    begin = in_turn(k, rows) @ starts + cycle * period
    return np.where(np.where(period > 0, 0.0, k) >= rows, np.inf, begin)


def on_line(value: Value, slope: Value, since: Value, t: Value) -> Value:
    """What runs straight from `value` at the time `since`, but stays before it and never falls below 0."""
    return not_negative(value + slope * np.maximum(t - since, 0.0))


def check_rows(starts: tuple[float, ...], period: float | None, names: tuple[str, str] = ("starts", "period")) -> None:
    """Check the times of a table, which messages call by the `names`.

    Raises
    ------
    ValueError
        If there is no row, a time is not finite, the starts do not ascend or the period is too short.
    """
    if not starts:
        raise ValueError(f"{names[0]} is empty; it must list the time at which each row begins.")
    for number, (start, before) in enumerate(zip(starts, (-math.inf, *starts), strict=False), start=1):
        require(f"{names[0]}[{number}]", start, start > before, f"must be later than the one before, {before}")
    if period is not None:
        span = starts[-1] - starts[0]
        require(
            names[1], period, period > span, f"must be longer than {span}, from the first of {names[0]} to the last"
        )


@dataclass(frozen=True)
class RowClock:
    """The same clock for arrays of times.

    Parameters
    ----------
    starts : tuple of float
        Times [s] at which the rows of the first cycle begin, ascending.
    period : float or None
        Length of a cycle [s], longer than from the first start to the last; None for a table that does not repeat.

    Raises
    ------
    ValueError
        If there is no row, a time is not finite, the starts do not ascend or the period is too short.
    """

    starts: tuple[float, ...]
    period: float | None = None

    def __post_init__(self) -> None:
        """Check the times."""
        check_rows(self.starts, self.period)

    @property
    def rows(self) -> int:
        """Number of rows of the table."""
        return len(self.starts)

    @cached_property
    def _starts(self) -> NDArray[np.float64]:
        return np.array(self.starts, dtype=float)

    @property
    def _step(self) -> float:
        return self.period or 0.0

    def begin(self, k: ArrayLike) -> NDArray[np.float64]:
        """Beginnings [s] of the rows numbered `k`; infinity behind the last row of a table that does not repeat."""
        number = np.asarray(k, dtype=np.int64)
        times = self._starts[number % self.rows] + (number // self.rows) * self._step
        return times if self.period is not None else np.where(number >= self.rows, np.inf, times)

    def number(self, t: ArrayLike) -> NDArray[np.int64]:
        """Numbers of the rows that hold the times `t` [s]."""
        time = np.asarray(t, dtype=float)
        if self.period is None:
            return np.maximum(np.searchsorted(self._starts, time, side="right") - 1, 0)
        cycle = np.floor((time - self.starts[0]) / self.period).astype(np.int64)
        local = time - cycle * self.period
        guess = cycle * self.rows + np.maximum(np.searchsorted(self._starts, local, side="right") - 1, 0)
        # Rounding puts the guess at most one row off.
        return np.asarray(guess + (time >= self.begin(guess + 1)) - (time < self.begin(guess)))

    def place(self, t: ArrayLike) -> NDArray[np.int64]:
        """Places, from 0, in the table of the rows that hold the times `t` [s]."""
        return np.asarray(self.number(t) % self.rows)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Beginnings of rows strictly between `t0` and `t1` [s], ascending."""
        last = int(self.number(t1))
        times = self.begin(np.arange(min(int(self.number(t0)), last), last + 1))
        return times[(times > t0) & (times < t1)]

    def lengths(self) -> NDArray[np.float64]:
        """Length of each row [s]; infinite for the last row of a table that does not repeat."""
        end = math.inf if self.period is None else self.starts[0] + self.period
        return np.diff(self._starts, append=end)

    def primitive(self, levels: NDArray[np.float64], slopes: NDArray[np.float64], t: Any) -> NDArray[np.float64]:
        """Integral, from the first start to `t` [s], of what is ``levels[row] + slopes[row]*(t - begin)`` in each row.

        Before the first start of a table that does not repeat, the first level holds.
        """
        time = np.asarray(t, dtype=float)
        lengths = self.lengths() if self.period is not None else self.lengths()[:-1]
        areas = lengths * (levels[: len(lengths)] + slopes[: len(lengths)] * lengths / 2)
        before = np.concatenate(([0.0], np.cumsum(areas)))
        number = self.number(time)
        place, within = number % self.rows, time - self.begin(number)
        inside = within * (levels[place] + slopes[place] * np.maximum(within, 0.0) / 2)
        return np.asarray((number // self.rows) * before[-1] + before[place] + inside)


class RowAutomaton(hm.HybridAutomaton):
    """Goes through the rows of a table, over and over or once; subclasses say what they hold of a row.

    What is held is a discrete state, so the flow between two rows costs no search through the table.
    """

    rows = hm.Dimension("number of rows of the table")
    row = hm.DiscreteState(0, integer=True, internal=True, computed=True, description="number of the row in force")
    starts = hm.Parameter(0.0, shape="rows", unit="s", description="times at which the rows begin for the first time")
    period = hm.Parameter(0.0, unit="s", description="time after which the rows repeat; 0 if the last one stays")

    def held(self, row: Value, s: hm.Values) -> dict[str, Value]:
        """The values that are held while row number `row` is in force."""
        return {}

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The row that holds the start time."""
        row = row_number(s.t, s.starts, s.period)
        return {"row": row, **self.held(row, s)}

    def next_row(self, s: hm.Values) -> Value:
        """Time at which the next row begins; infinity if there is none."""
        return row_begin(s.row + 1, s.starts, s.period)

    def move_on(self, s: hm.Values) -> dict[str, Value]:
        """Go on to the next row."""
        return {"row": s.row + 1, **self.held(s.row + 1, s)}

    transitions = (hm.TimeEvent("row", next_row, move_on, internal=True),)

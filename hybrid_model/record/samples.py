"""Samples on hybrid time as plain arrays: from a run, a table, a file, or anybody's program."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.real_numbers import real_array, told
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import DataError
from hybrid_model.record.csv_table import read_table

ELEMENT = re.compile(r"(?P<name>.+)\[(?P<index>\d+(,\d+)*)\]")
"""A column that holds an element of an array: ``w[2]``, ``m[2,1]``, counted from 1."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Values of variables at points of hybrid time.

    Attributes
    ----------
    t, j : ndarray, shape (n,)
        Time in s and number of jumps so far. A jump is two rows with the same t and the next j.
    values : mapping of str to ndarray, shape (n, ...)
        Variable -> its values, row by row.

    Raises
    ------
    DataError
        If lengths differ, something is not a number, or a j is not whole.
    """

    t: FloatArray
    j: npt.NDArray[np.int64]
    values: Mapping[str, FloatArray]

    def __post_init__(self) -> None:
        if not isinstance(self.values, Mapping):
            raise DataError(f"the values are {told(self.values)}: give a mapping, {{'variable': its values}}.")
        t, j = _numbers("t", self.t), _numbers("j", self.j)
        if t.ndim != 1 or j.shape != t.shape:
            raise DataError(f"t has shape {t.shape} and j shape {j.shape}: give two arrays of one length.")
        if not np.all(np.isfinite(j)) or np.any(j != np.round(j)):
            raise DataError("j counts jumps, but holds numbers that are not whole: give 0, 1, 2, ...")
        values = {name: _numbers(name, value) for name, value in self.values.items()}
        for name, value in values.items():
            if value.shape[:1] != t.shape:
                raise DataError(f"{name} has shape {value.shape}, but there are {t.size} samples: give one row each.")
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "j", j.astype(np.int64))
        object.__setattr__(self, "values", values)

    def __len__(self) -> int:
        return int(self.t.size)

    def __repr__(self) -> str:
        span = (
            f" at t from {self.t[0]:g} to {self.t[-1]:g} s, j from {self.j[0]} to {self.j[-1]}" if self.t.size else ""
        )
        return f"Samples({len(self)}{span}: {', '.join(self.values)})"

    def __getitem__(self, name: str) -> FloatArray:
        """Return a variable's values, shape (n, *shape)."""
        if name not in self.values:
            raise DataError(f"the samples have no variable {name!r}; they have {', '.join(self.values)}.")
        return self.values[name]

    def columns(self) -> dict[str, FloatArray]:
        """Return the scalars by name, arrays element by element: ``w[1]``, ``w[2]``; row by row ``m[2,1]``."""
        table: dict[str, FloatArray] = {}
        for name, value in self.values.items():
            if value.ndim == 1:
                table[name] = value
            else:
                for index in np.ndindex(*value.shape[1:]):
                    table[f"{name}[{','.join(str(i + 1) for i in index)}]"] = value[(slice(None), *index)]
        return table

    @classmethod
    def from_columns(cls, t: npt.ArrayLike, j: npt.ArrayLike, columns: Mapping[str, npt.ArrayLike]) -> Samples:
        """Join columns that hold elements of one array; the inverse of `columns`.

        Raises
        ------
        DataError
            If elements of an array are missing.
        """
        groups: dict[str, dict[tuple[int, ...], FloatArray]] = {}
        for column, numbers in columns.items():
            match = ELEMENT.fullmatch(column)
            name = match["name"] if match else column
            index = tuple(int(i) for i in match["index"].split(",")) if match else ()
            groups.setdefault(name, {})[index] = _numbers(column, numbers)
        return cls(_numbers("t", t), np.asarray(j), {name: _joined(name, group) for name, group in groups.items()})

    @classmethod
    def from_dataframe(cls, frame: Any) -> Samples:
        """Take the samples of a pandas DataFrame with index levels, or columns, as `from_csv` reads them from a file.

        Raises
        ------
        DataError
            If there is no time, or a column does not hold numbers.
        """
        table = frame.reset_index() if {"t", "time", "j"} & set(frame.index.names) else frame
        return _from_table({str(name): table[name].to_numpy() for name in table.columns}, "the table")

    @classmethod
    def from_csv(cls, path: str | Path) -> Samples:
        """Read a file of comma-separated values: a line of names, then one line a sample.

        Of the names one is the time in s, ``t`` or, as other programs write, ``time``; ``j`` counts jumps. Without a
        column ``j`` a jump is where a time comes again with other values: its two sides are two lines of one time, and
        a cascade of n jumps is n + 1 lines. Two equal lines are one sample. The other names are variables: ``h``, for
        elements of arrays ``w[1]``, ``w[2]``, ``m[2,1]``. For the numbers see
        `hybrid_model.record.csv_table.read_table`.

        Raises
        ------
        DataError
            If there is no time, or the file is no table of numbers; with file, line and column.
        """
        return _from_table(read_table(path), str(path))

    def to_csv(self, path: str | Path) -> None:
        """Write the samples as comma-separated values, so exactly that `from_csv` gives them back bit by bit."""
        table = self.columns()
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["t", "j", *table])
            for k in range(len(self)):
                writer.writerow([repr(float(self.t[k])), int(self.j[k]), *(repr(float(c[k])) for c in table.values())])


def _from_table(table: Mapping[str, Any], what: str) -> Samples:
    time = next((name for name in ("t", "time") if name in table), None)
    if time is None:
        raise DataError(
            f"{what} has no column t or time; it has {', '.join(table) or 'none'}: the first line names the columns, "
            "one of them the time in s."
        )
    columns = {name: _numbers(name, column) for name, column in table.items() if name not in (time, "j")}
    t = _numbers(time, table[time])
    return Samples.from_columns(t, _numbers("j", table["j"]) if "j" in table else _jumps(t, columns), columns)


def _jumps(t: FloatArray, columns: Mapping[str, FloatArray]) -> npt.NDArray[np.int64]:
    """Count the jumps of a table without a column for them: a time that comes again with other values."""
    changed = np.zeros(max(t.size - 1, 0), dtype=bool)
    for column in columns.values():
        if column.shape[:1] == t.shape:
            other = (column[1:] != column[:-1]) & ~(np.isnan(column[1:]) & np.isnan(column[:-1]))
            changed |= other.any(axis=tuple(range(1, other.ndim)))
    return np.concatenate([np.zeros(min(t.size, 1)), np.cumsum((np.diff(t) == 0.0) & changed)]).astype(np.int64)


def _numbers(name: str, given: npt.ArrayLike | Sequence[str]) -> FloatArray:
    try:
        return real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise DataError(f"{name} does not hold numbers only: {error}.") from error


def _joined(name: str, group: Mapping[tuple[int, ...], FloatArray]) -> FloatArray:
    if () in group and len(group) == 1:
        return group[()]
    lengths = {len(index) for index in group}
    shape = tuple(int(n) for n in np.max(np.array(list(group)), axis=0)) if len(lengths) == 1 else ()
    wanted = [tuple(i + 1 for i in index) for index in np.ndindex(*shape)] if shape else []
    if set(group) != set(wanted):
        raise DataError(f"the columns of {name} are {sorted(group)}: give every element of one array, from 1.")
    return np.stack([group[index] for index in wanted], axis=-1).reshape(-1, *shape)

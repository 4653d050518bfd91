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

from hybrid_model.errors import DataError
from hybrid_model.variables import FloatArray

ELEMENT = re.compile(r"(?P<name>.+)\[(?P<index>\d+(,\d+)*)\]")
"""A column that holds an element of an array: ``w[2]``, ``m[2,1]``, counted from 1."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Values of variables at points of hybrid time.

    Attributes
    ----------
    t, j : ndarray, shape (n,)
        Time in s and number of jumps so far. A jump is two rows with the same t and the next j.
    values : mapping of str to ndarray, shape (n, *shape)
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
        """Take the samples of a pandas DataFrame with index levels, or columns, ``t`` and ``j``.

        Raises
        ------
        DataError
            If t or j is missing, or a column does not hold numbers.
        """
        table = frame.reset_index() if {"t", "j"} & set(frame.index.names) else frame
        return _from_table({str(name): table[name].to_numpy() for name in table.columns}, "the table")

    @classmethod
    def from_csv(cls, path: str | Path) -> Samples:
        """Read a file of comma-separated values with a line of names, two of which are ``t`` and ``j``.

        Raises
        ------
        DataError
            If t or j is missing, a row has another length than the line of names, or something is not a number.
        """
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
        names = [name.strip() for name in rows[0]] if rows else []
        for number, row in enumerate(rows[1:], start=2):
            if len(row) != len(names):
                raise DataError(f"{path}: row {number} has {len(row)} fields, but the line of names has {len(names)}.")
        return _from_table({name: [row[k] for row in rows[1:]] for k, name in enumerate(names)}, str(path))

    def to_csv(self, path: str | Path) -> None:
        """Write the samples as comma-separated values, so exactly that `from_csv` gives them back bit by bit."""
        table = self.columns()
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["t", "j", *table])
            for k in range(len(self)):
                writer.writerow([repr(float(self.t[k])), int(self.j[k]), *(repr(float(c[k])) for c in table.values())])


def _from_table(table: Mapping[str, Any], what: str) -> Samples:
    missing = [name for name in ("t", "j") if name not in table]
    if missing:
        raise DataError(f"{what} has no column {' and no column '.join(missing)}; it has {', '.join(table)}.")
    columns = {name: column for name, column in table.items() if name not in ("t", "j")}
    return Samples.from_columns(_numbers("t", table["t"]), _numbers("j", table["j"]), columns)


def _numbers(name: str, given: npt.ArrayLike | Sequence[str]) -> FloatArray:
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
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

"""A run beside a table of reference: how far each variable is from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import MisfitError
from cosim.tables.input_table import read_columns

WORDS = {"true": 1.0, "false": 0.0}
ROUNDING = 1e-9
"""Part of a time by which rows may differ and still be of one time."""


@dataclass(frozen=True)
class Deviation:
    """How far a variable is from its reference.

    Attributes
    ----------
    name : str
    largest : float
        Largest difference, as a part of the largest value of the reference; 1 for texts that differ.
    t : float
        Where, in s.
    """

    name: str
    largest: float
    t: float


@dataclass(frozen=True)
class Comparison:
    """A run beside a table of reference.

    Attributes
    ----------
    found : list of Deviation
        One a scalar of the table.
    missing : list of str
        Columns of the table that the run has not.
    rows, compared : int
        Of the table, and how many of them lie within the run.
    table, run : tuple of float
        First and last time in s.
    """

    found: list[Deviation]
    missing: list[str]
    rows: int
    compared: int
    table: tuple[float, float]
    run: tuple[float, float]

    @property
    def goes_on(self) -> bool:
        """Whether the table has rows behind the end of the run."""
        return not _is_within(self.table[1], self.run)

    def told(self) -> str:
        """Return in words what was not compared; nothing if the table and the run are of one time."""
        if self.compared < self.rows:
            left = f"{self.rows - self.compared} of its {self.rows} rows are not compared"
            return f"{left}: it goes {_told(self.table)}, and the run {_told(self.run)}"
        if not (_is_within(self.run[0], self.table) and _is_within(self.run[1], self.table)):
            return f"it goes {_told(self.table)} alone, and the run {_told(self.run)}: the rest of that is not compared"
        return ""


def deviations(path: str | Path, times: Sequence[float], signals: Mapping[str, Sequence[Any]]) -> Comparison:
    """Compare a run with a table.

    At each time of the table within the run the run's value is its own there, linear between its rows; where it jumps
    at that time, the side that is nearer.

    Parameters
    ----------
    path : str or Path
        Comma-separated values: ``time``, and names of variables; vectors with their elements separated by blanks.
    times : sequence of float
        Of the run, in s.
    signals : mapping
        Name in the table -> values of the run, for vectors ``name[1]`` and so on.

    Returns
    -------
    Comparison

    Raises
    ------
    MisfitError
        If the file is no table, has text for a number, or has no variable or no time in common with the run.
    """
    told, columns = read_columns(path)
    grid, here = np.array(told), np.array(times)
    ends, span = (float(grid[0]), float(grid[-1])), (float(here[0]), float(here[-1])) if times else (math.nan, math.nan)
    within = np.array([_is_within(float(t), span) for t in told])
    if not within.any():
        raise MisfitError(
            f"{path} and the run have no time in common: it goes {_told(ends)}, and the run "
            f"{_told(span)}. Give a table of that time."
        )
    found: list[Deviation] = []
    missing: list[str] = []
    for name, column in columns.items():
        texts = [text for text, inside in zip(column, within, strict=True) if inside]
        elements = _elements(name, texts, signals)
        missing += [] if elements else [name]
        try:
            found += [_deviation(element, grid[within], of_it, here, signals[element]) for element, of_it in elements]
        except ValueError as error:
            raise MisfitError(f"{path}, column {name}: {error}: give numbers.") from error
    if not found:
        raise MisfitError(f"{path} has none of the columns {', '.join(signals)}: give it one that is called so.")
    return Comparison(found, missing, len(told), int(within.sum()), ends, span)


def _told(span: tuple[float, float]) -> str:
    return f"from {span[0]:.9g} to {span[1]:.9g} s"


def _is_within(t: float, span: tuple[float, float]) -> bool:
    """Return whether a time is not before or behind a span but for rounding."""
    slack = ROUNDING * max(abs(span[0]), abs(span[1]))
    return span[0] - slack <= t <= span[1] + slack


def _elements(name: str, texts: list[str], signals: Mapping[str, Sequence[Any]]) -> list[tuple[str, list[str]]]:
    if name in signals:
        return [(name, texts)]
    elements = [element for element in signals if element.startswith(f"{name}[")]
    rows = [text.split() for text in texts]
    if any(len(row) != len(elements) for row in rows):
        return []
    return [(element, [row[k] for row in rows]) for k, element in enumerate(elements)]


def _deviation(name: str, grid: Any, texts: list[str], here: Any, values: Sequence[Any]) -> Deviation:
    if isinstance(values[0], (str, bytes)):
        shown = [value.hex() if isinstance(value, bytes) else value for value in values]
        at = np.clip(np.searchsorted(here, grid * (1.0 + ROUNDING), side="right") - 1, 0, None)
        wrong = [t for t, k, text in zip(grid, at, texts, strict=True) if shown[k] != text]
        return Deviation(name, float(bool(wrong)), float(wrong[0]) if wrong else float(grid[0]))
    wanted = np.array([WORDS.get(text.lower()) if text.lower() in WORDS else float(text) for text in texts])
    run = np.array([float(value) for value in values])
    low, high = _sides(grid, here, run)
    apart = np.where(
        (low <= wanted) & (wanted <= high) & (low == high), 0.0, np.minimum(abs(low - wanted), abs(high - wanted))
    )
    scale = float(np.max(np.abs(wanted))) or 1.0
    k = int(np.argmax(apart))
    return Deviation(name, float(apart[k]) / scale, float(grid[k]))


def _sides(grid: Any, here: Any, run: Any) -> tuple[Any, Any]:
    """Return the values of a run on both sides of times; between rows it is linear, so both are one."""
    slack = ROUNDING * np.maximum(np.abs(grid), here[-1] - here[0])
    first = np.searchsorted(here, grid - slack, side="left")
    last = np.searchsorted(here, grid + slack, side="right") - 1
    at_row = last >= first
    between = np.interp(grid, here, run)
    first, last = np.clip(first, 0, len(here) - 1), np.clip(last, 0, len(here) - 1)
    return np.where(at_row, run[first], between), np.where(at_row, run[last], between)

"""Inputs of a run from a file of comma-separated values."""

from __future__ import annotations

import bisect
import csv
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from cosim.errors import MisfitError
from cosim.masters.changes import Curve, Given
from cosim.slave import Slave
from cosim.system import System
from hybrid_model import Signal

T = TypeVar("T")


def read_inputs(path: str | Path, system: System) -> dict[str, Given]:
    """Read inputs and tunable parameters over time.

    The first line has ``time`` and names, ``slave.variable``, or ``variable`` where there is one slave; a vector is one
    column with its elements separated by blanks, or a column for each element. Inputs that may change along flows are
    linear between two rows, all else is held from its row on. Two rows of one time are a jump.

    Parameters
    ----------
    path : str or Path
    system : System

    Returns
    -------
    dict
        For masters: ``slave.variable`` -> `Signal` or `Curve`.

    Raises
    ------
    MisfitError
        If it is no such table, with the line and the column; if an input is unknown or does not hold a value.
    """
    times, columns = read_columns(path)
    inputs: dict[str, Given] = {}
    for name, texts in columns.items():
        for full_name, elements in _elements(system, path, name, texts):
            slave, variable = _named(path, system.settable, full_name)
            inputs[full_name] = _given(path, system.slaves[slave], variable, times, elements)
    return inputs


def read_columns(path: str | Path) -> tuple[list[float], dict[str, list[str]]]:
    """Read a table over time as texts: the times in s, which do not fall, and the other columns by name.

    Raises
    ------
    MisfitError
        If it is no such table, with the line.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise MisfitError(f"{path} is no file of comma-separated values in UTF-8: {error}.") from error
    if rows and len(rows[0]) == 1 and ";" in rows[0][0]:
        raise MisfitError(f"{path}: its columns are separated by ';': separate them by ',', and write numbers as 0.5.")
    if len(rows) < 2 or _name(rows[0][0]) not in ("time", "t"):
        raise MisfitError(f"{path} has no line of names that begins with time, and a row below it: give them.")
    names = [_name(field) for field in rows[0]]
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise MisfitError(f"{path}, row {line}: it has {len(row)} fields, but there are {len(names)} names.")
    if len(set(names)) < len(names):
        raise MisfitError(f"{path}: a name is there twice among {', '.join(names)}.")
    times = [_time(path, line, row[0]) for line, row in enumerate(rows[1:], start=2)]
    for line, (before, after) in enumerate(itertools.pairwise(times), start=3):
        if after < before:
            raise MisfitError(f"{path}, row {line}: the time {after:g} s comes after {before:g} s: sort the rows.")
    return times, {name: [row[k] for row in rows[1:]] for k, name in enumerate(names) if k > 0}


def _name(field: str) -> str:
    """Return a name without the blanks around it, and the quotes that blanks kept from being read as such."""
    return field.strip().strip('"')


def _time(path: str | Path, line: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MisfitError(f"{path}, row {line}: the time {text!r} is no finite number.")
    return value


def _elements(system: System, path: str | Path, name: str, texts: Sequence[str]) -> list[tuple[str, Sequence[str]]]:
    """Return the scalars of a column: their full names, and their values as texts."""
    full_name = system.full_name(name)
    elements = _named(path, system.elements, full_name)
    if not elements:
        return [(full_name, texts)]
    rows = [text.split() for text in texts]
    wrong = next((k for k, row in enumerate(rows) if len(row) != len(elements)), None)
    if wrong is not None:
        raise MisfitError(
            f"{path}, row {wrong + 2}: {name} has {len(elements)} elements, but the row gives {len(rows[wrong])}."
        )
    return [(element, [row[k] for row in rows]) for k, element in enumerate(elements)]


def _named(path: str | Path, ask: Callable[[str], T], name: str) -> T:
    """Return what a system says of a name; a refusal names the file."""
    try:
        return ask(name)
    except MisfitError as error:
        raise MisfitError(f"{path}: {error}") from error


def _given(path: str | Path, slave: Slave, name: str, times: Sequence[float], texts: Sequence[str]) -> Given:
    values = [_value(path, row, slave, name, text) for row, text in enumerate(texts, start=2)]
    port = slave.inputs.get(name)
    if port is not None and not port.discrete:
        line = Polyline(tuple(times), tuple(float(value) for value in values))
        return Curve(line, line.jumps)
    steps = Staircase(tuple(times), tuple(values))
    return Signal(steps, steps.jumps)


def _value(path: str | Path, row: int, slave: Slave, name: str, text: str) -> Any:
    try:
        value = slave.parse(name, text.strip() if _is_number(slave, name) else text)
    except MisfitError as error:
        raise MisfitError(f"{path}, row {row}: {error}") from error
    if isinstance(value, float) and not math.isfinite(value):
        raise MisfitError(f"{path}, row {row}: {slave.name}.{name} is set to {value}: give a finite number.")
    return value


def _is_number(slave: Slave, name: str) -> bool:
    port = slave.inputs.get(name)
    return port is None or port.kind != "text"


@dataclass(frozen=True)
class Polyline:
    """A function of time that is linear between points; two points of one time are a jump."""

    times: tuple[float, ...]
    values: tuple[float, ...]

    @property
    def jumps(self) -> list[float]:
        """Times in s of the jumps."""
        points = list(zip(self.times, self.values, strict=True))
        return sorted({s for (s, a), (t, b) in itertools.pairwise(points) if s == t and a != b})

    def __call__(self, t: float) -> float:
        """Return the value at `t` in s, after a jump there; the first before all points, the last after them."""
        k = bisect.bisect_right(self.times, t)
        if k == 0:
            return self.values[0]
        if k == len(self.times) or self.times[k - 1] == t:
            return self.values[k - 1]
        (s, a), (e, b) = (self.times[k - 1], self.values[k - 1]), (self.times[k], self.values[k])
        return a + (b - a) * ((t - s) / (e - s))


@dataclass(frozen=True)
class Staircase:
    """A function of time that holds each value from its time on."""

    times: tuple[float, ...]
    values: tuple[Any, ...]

    @property
    def jumps(self) -> list[float]:
        """Times in s at which it changes."""
        points = list(zip(self.times, self.values, strict=True))
        return sorted({t for (_, a), (t, b) in itertools.pairwise(points) if a != b})

    def __call__(self, t: float) -> Any:
        """Return the value at `t` in s, after a jump there."""
        return self.values[max(bisect.bisect_right(self.times, t) - 1, 0)]

"""Tables of numbers in files of comma-separated values, from anybody's program."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import DataError

UTF16 = (b"\xff\xfe", b"\xfe\xff")
"""Marks with which files of 16-bit characters begin."""
WORDS = {"true": 1.0, "false": 0.0}
SEPARATORS = {";": "semicolons", "\t": "tabs"}


def read_table(path: str | Path) -> dict[str, FloatArray]:
    """Read the columns of a file with a line of names.

    Parameters
    ----------
    path : str or Path
        UTF-8, with or without byte-order mark; fields separated by commas, numbers with a decimal point, ``true`` and
        ``false`` as 1 and 0. Several numbers in one field, separated by blanks, are a vector.

    Returns
    -------
    dict of str to ndarray
        Name -> its numbers, shape (rows,) or (rows, elements).

    Raises
    ------
    DataError
        If the file is no such table; with file, line and column.
    """
    reader = csv.reader(io.StringIO(_text(path), newline=""), strict=True)
    lines: list[int] = []
    rows: list[list[str]] = []
    try:
        for row in reader:
            if row:
                rows.append(row)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise DataError(
            f"{path}, line {reader.line_num}: this is no line of comma-separated values: {error}."
        ) from error
    if not rows:
        return {}
    names = _names(f"{path}, line {lines[0]}", rows[0])
    for line, row in zip(lines[1:], rows[1:], strict=True):
        _require_length(f"{path}, line {line}", row, names)
    return {name: _column(path, lines[1:], [row[k] for row in rows[1:]], k, name) for k, name in enumerate(names)}


def _text(path: str | Path) -> str:
    content = Path(path).read_bytes()
    if content.startswith(UTF16) or b"\0" in content[:1000]:
        raise DataError(f"{path}, line 1, column 1: the file is in UTF-16, or is no text: save it as CSV in UTF-8.")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start]
        line, column = before.count(b"\n") + 1, before.rpartition(b"\n")[2].count(b",") + 1
        raise DataError(
            f"{path}, line {line}, column {column}: this is no UTF-8: save the file as CSV in UTF-8."
        ) from error


def _names(where: str, row: list[str]) -> list[str]:
    names = [name.strip() for name in row]
    for separator, called in SEPARATORS.items():
        if len(names) == 1 and separator in names[0]:
            raise DataError(f"{where}: names are separated by {called}: separate them by commas, with decimal points.")
    for k, name in enumerate(names):
        if not name:
            raise DataError(f"{where}, column {k + 1}: {_missing_name(k, names)}")
        if name in names[:k]:
            raise DataError(f"{where}, column {k + 1}: the name {name} is there twice: give each column its own.")
    return names


def _missing_name(k: int, names: list[str]) -> str:
    if k == len(names) - 1:
        return "the line ends with a comma: remove it, in every line."
    return "the column has no name: give it one."


def _require_length(where: str, row: list[str], names: list[str]) -> None:
    if len(row) == len(names):
        return
    told = f"the line has {len(row)} fields, but the line of names has {len(names)}"
    if len(row) == len(names) + 1 and not row[-1].strip():
        raise DataError(f"{where}, column {len(row)}: {told}: remove the comma at its end.")
    raise DataError(f"{where}, column {min(len(row), len(names)) + 1}: {told}: give one field for each name.")


def _column(path: str | Path, lines: list[int], fields: list[str], k: int, name: str) -> FloatArray:
    rows = [
        _numbers(f"{path}, line {line}, column {k + 1} ({name})", field)
        for line, field in zip(lines, fields, strict=True)
    ]
    for line, row in zip(lines, rows, strict=True):
        if len(row) != len(rows[0]):
            raise DataError(
                f"{path}, line {line}, column {k + 1} ({name}): the field holds {len(row)} numbers, but that of the "
                f"first row {len(rows[0])}: give as many in every line."
            )
    table = np.array(rows, dtype=np.float64)
    return table if table.shape[1:] > (1,) else table.ravel()


def _numbers(where: str, field: str) -> list[float]:
    if not field.strip():
        raise DataError(f"{where}: the field is empty: give a number.")
    try:
        return [WORDS[part.lower()] if part.lower() in WORDS else float(part) for part in field.split()]
    except ValueError as error:
        raise DataError(f"{where}: {told(field.strip())} is not a number: give one with a decimal point.") from error

"""Rows of a run in a file of comma-separated values, written as they come: what is there is readable at any moment."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.errors import CosimError
from cosim.result import CosimResult


class Columns:
    """The columns of a table: a vector is one of them, its elements separated by blanks, as fmpy and fmusim write it.

    Parameters
    ----------
    names : sequence of str
        Of scalars.
    arrays : mapping
        Name of a scalar -> that of the array that it is an element of.
    rename : mapping
        Name of a column -> how it is written, where it is another.
    """

    def __init__(self, names: Sequence[str], arrays: Mapping[str, str], rename: Mapping[str, str]) -> None:
        self._groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            self._groups.setdefault(arrays.get(name) or name, []).append(k)
        self.names = [rename.get(column, column) for column in self._groups]

    def cells(self, values: Sequence[Any]) -> list[Any]:
        """Return the fields of a row."""
        return [
            " ".join(str(_cell(values[k])) for k in group) if len(group) > 1 else _cell(values[group[0]])
            for group in self._groups.values()
        ]


class RowFile:
    """A file that each row of a run is added to when it is known, by a whole line: whatever ends the process next.

    Parameters
    ----------
    path : str or Path
        It is written anew with the first row, and its folder made if there is none: a call that is refused before
        leaves the results of an earlier one.
    columns : Columns
    """

    def __init__(self, path: str | Path, columns: Columns) -> None:
        self._path, self._columns = Path(path), columns
        self._file: io.FileIO | None = None
        self._lines = io.StringIO()
        self._writer = csv.writer(self._lines)
        self._written = 0

    def take(self, result: CosimResult) -> None:
        """Add the last row of a result.

        Raises
        ------
        CosimError
            If it cannot be written, as on a full disk; the file ends with a whole line all the same.
        OSError
            If there can be no such file.
        """
        if self._file is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = io.FileIO(self._path, "wb")
            self._writer.writerow(["time", *self._columns.names])
        row = [values[-1] for values in result.signals.values()]
        self._writer.writerow([result.times[-1], *self._columns.cells(row)])
        self._write(self._file, result.times[-1])

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _write(self, file: io.FileIO, t: float) -> None:
        content = self._lines.getvalue().encode()
        self._lines.seek(0)
        self._lines.truncate()
        done = 0
        try:
            while done < len(content):
                done += file.write(content[done:]) or 0
        except OSError as error:
            whole = content[:done].rfind(b"\n") + 1
            os.ftruncate(file.fileno(), self._written + whole)
            raise CosimError(
                f"{self._path} cannot be written any further at t = {t:.9g} s: {error.strerror}. What is there can be "
                "read: make room, or write it elsewhere."
            ) from error
        self._written += done


def _cell(value: Any) -> Any:
    return int(value) if isinstance(value, bool) else value.hex() if isinstance(value, bytes) else value

"""The table of a sweep in an SQLite file: the study, and a row for each run that is done."""

from __future__ import annotations

import json
import math
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.study import Study

try:
    import fcntl
except ImportError:  # not on Windows: there two sweeps into one file are not told apart
    fcntl = None  # type: ignore[assignment]

__all__ = ["SweepTable"]

_APPLICATION = 0x48465357
"""In the header of the file: what kind of database it is."""


class SweepTable:
    """The rows of a sweep, in the file that they are kept in.

    A row is in the file for good once it has been written, whatever becomes of the process. While a sweep runs, others
    may read.

    Parameters
    ----------
    path : path
        The file. With a study it is made if it is not there.
    study : Study, optional
        What the file must be about; default: whatever it is.

    Raises
    ------
    SweepError
        If the file is no table of a sweep, or that of another study.
    """

    def __init__(self, path: str | os.PathLike[str], study: Study | None = None) -> None:
        self.path = Path(path)
        self._lock: Any = None
        if study is None and not self.path.is_file():
            raise SweepError(f"there is no file {self.path}.")
        try:
            self._database = sqlite3.connect(self.path, timeout=60.0, isolation_level=None)
            self.study = self._opened(study)
        except sqlite3.Error as error:
            raise SweepError(f"{self.path} cannot be used as the table of a sweep: {error}.") from error

    def _opened(self, study: Study | None) -> Study:
        if self._one("PRAGMA application_id") == 0 and self._one("SELECT count(*) FROM sqlite_master") == 0:
            if study is None:
                raise SweepError(f"{self.path} is no table of a sweep.")
            self._create(study)
        if self._one("PRAGMA application_id") != _APPLICATION:
            raise SweepError(f"{self.path} is a database, but not the table of a sweep: name another file.")
        kept = json.loads(self._one("SELECT value FROM study"))
        if study is not None:
            given = json.loads(json.dumps(study.as_dict()))
            other = next((key for key in given if kept.get(key) != given[key]), None)
            if other is not None:
                raise SweepError(
                    f"{self.path} holds another sweep, with another entry '{other}'. Name another file, on the command "
                    "line by --table, or delete it."
                )
        return study or Study.from_dict(kept)

    def _create(self, study: Study) -> None:
        columns = "".join(f", {_quoted(name)}" for name in study.columns)
        # Readers are not kept out while rows are written, and each transaction is one append.
        self._database.execute("PRAGMA journal_mode=WAL")
        self._database.execute("BEGIN IMMEDIATE")
        self._database.execute("CREATE TABLE IF NOT EXISTS study (value TEXT NOT NULL)")
        self._database.execute(f"CREATE TABLE IF NOT EXISTS runs (run INTEGER PRIMARY KEY{columns})")
        self._database.execute("DELETE FROM study")
        self._database.execute("INSERT INTO study VALUES (?)", (json.dumps(study.as_dict()),))
        self._database.execute(f"PRAGMA application_id={_APPLICATION}")
        self._database.execute("COMMIT")

    def __enter__(self) -> Self:
        """The table itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file, and leave nothing beside it."""
        # Who only reads must not wait for who writes.
        if self._lock is not None:
            with suppress(sqlite3.Error):
                self._database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        self._database.close()
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def claim(self) -> None:
        """Keep other processes from running the same sweep, until the table is closed or this process ends.

        Raises
        ------
        SweepError
            If another one runs it.
        """
        if fcntl is None or self._lock is not None:
            return
        # A lock of another kind than SQLite's own. The file is closed after the database: closing it ends those too.
        lock = self.path.open("rb")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            lock.close()
            raise SweepError(f"another process runs the sweep in {self.path}: let it end, or end it.") from error
        self._lock = lock

    # What is there.

    def __len__(self) -> int:
        """Number of runs that are done."""
        return int(self._one("SELECT count(*) FROM runs"))

    @property
    def failures(self) -> int:
        """Number of runs that are done and have failed."""
        return int(self._one("SELECT count(*) FROM runs WHERE failure IS NOT NULL"))

    def missing(self) -> list[int]:
        """Numbers of the runs that are not done, ascending."""
        done = {run for (run,) in self._database.execute("SELECT run FROM runs")}
        return [run for run in range(len(self.study)) if run not in done]

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """The rows in order of the runs: the run's number, and the columns of the study; lists as JSON."""
        with closing(self._database.cursor()) as cursor:
            yield from cursor.execute("SELECT * FROM runs ORDER BY run")

    def column(self, name: str) -> NDArray[Any]:
        """A column of all rows in order of the runs: floats, NaN where there is none; or texts.

        Raises
        ------
        SweepError
            If there is no such column.
        """
        if name not in ("run", *self.study.columns):
            raise SweepError(f"the sweep has no column '{name}'; it has run, {', '.join(self.study.columns)}.")
        values = [value for (value,) in self._database.execute(f"SELECT {_quoted(name)} FROM runs ORDER BY run")]
        if any(isinstance(value, str) for value in values):
            return np.array(values, dtype=object)
        return np.array([math.nan if value is None else value for value in values], dtype=float)

    # Writing.

    def write(self, rows: Iterable[tuple[int, Mapping[str, Any]]]) -> None:
        """Add rows: the number of each run, and column -> value; columns that a row lacks are empty."""
        names = self.study.columns
        marks = ", ".join("?" * (len(names) + 1))
        table = [
            (run, *(_cell(value) for value in (({**row, **self.study.values(run)}).get(name) for name in names)))
            for run, row in rows
        ]
        self._database.execute("BEGIN IMMEDIATE")
        self._database.executemany(f"INSERT OR IGNORE INTO runs VALUES ({marks})", table)
        self._database.execute("COMMIT")

    def _one(self, question: str) -> Any:
        found = self._database.execute(question).fetchone()
        return None if found is None else found[0]


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _cell(value: Any) -> Any:
    """A value as SQLite holds it."""
    if isinstance(value, list | tuple | dict):
        return json.dumps(value)
    if isinstance(value, bool | np.bool_):
        return int(value)
    if isinstance(value, np.generic):
        return value.item()
    return value

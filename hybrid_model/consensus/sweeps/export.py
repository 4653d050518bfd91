"""The table of a sweep in other forms."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import Any

from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.table import SweepTable

__all__ = ["write_csv", "write_parquet"]


def write_csv(table: SweepTable, path: str | os.PathLike[str]) -> None:
    """Write the rows that are done as comma-separated values, in order of the runs; what is missing is empty.

    Numbers have all their digits. What is in another file of that name is replaced once all is written.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(path.name + ".part")
    with fresh.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", *table.study.columns])
        writer.writerows(table.rows())
    fresh.replace(path)


def write_parquet(table: SweepTable, path: str | os.PathLike[str]) -> None:
    """Write the rows that are done as a Parquet file, in order of the runs.

    A column is of whole numbers, of floats or of text, whichever its values are; columns with several kinds are text.

    Raises
    ------
    SweepError
        If PyArrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise SweepError(
            'a Parquet file needs PyArrow: install it with pip install "hybrid-fmu[parquet]", or write CSV.'
        ) from error
    rows = list(table.rows())
    columns: dict[str, Any] = {}
    for place, name in enumerate(["run", *table.study.columns]):
        values = [row[place] for row in rows]
        kinds = {type(value) for value in values if value is not None}
        if len(kinds) > 1 and not kinds <= {int, float}:
            values = [None if value is None else str(value) for value in values]
        elif kinds == {int, float}:
            values = [None if value is None else float(value) for value in values]
        columns[name] = pyarrow.array(values)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(path.name + ".part")
    pyarrow.parquet.write_table(pyarrow.table(columns), fresh)
    fresh.replace(path)

"""Samples of weights out of a file: CSV, or NumPy's npz."""

import csv
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.messages import ScenarioError, shown

__all__ = ["read_samples"]

Samples = tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]


def read_samples(path: Path, edge_count: int) -> Samples:
    """Read times and, for each edge, the weights at those times.

    Parameters
    ----------
    path : Path
        A file of comma-separated values (``.csv``): one row a sample, first the time [s], then one number that stands
        for all edges, or one for each edge; a first row of names is skipped. Or an ``.npz`` file with the arrays ``t``,
        shape (samples,), and ``w``, shape (samples,) or (samples, edges).
    edge_count : int
        Number of edges.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has another suffix, or does not hold such numbers; the message names the file and
        the row.
    """
    readers = {".csv": _read_csv, ".npz": _read_npz}
    if "\0" in str(path):
        raise ScenarioError(f"the file of samples {shown(str(path))} cannot be read: its name holds a null character.")
    if path.suffix not in readers:
        raise ScenarioError(f"the file of samples {path} ends in '{path.suffix}'; it must be a .csv or .npz file.")
    try:
        times, weights = readers[path.suffix](path)
    except UnicodeDecodeError as error:
        raise ScenarioError(
            f"the file of samples {path} is not a text in UTF-8: byte {error.start} cannot be decoded."
        ) from error
    except OSError as error:
        raise ScenarioError(f"the file of samples {path} cannot be read: {error.strerror or error}.") from error
    if weights.shape[1] not in (1, edge_count):
        raise ScenarioError(
            f"the file of samples {path} has weights for {weights.shape[1]} edges, but the network has {edge_count}; "
            "give one column of weights for each edge, or a single one for all."
        )
    columns = [tuple(column) for column in weights.T.tolist()]
    return tuple(times.tolist()), tuple(columns * (edge_count if len(columns) == 1 else 1))


def _read_csv(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows: list[list[float]] = []
    with path.open(newline="", encoding="utf-8-sig") as file:
        for number, cells in enumerate(_csv_rows(file, path), start=1):
            if not cells:
                continue
            try:
                rows.append([float(cell) for cell in cells])
            except ValueError:
                if number == 1:
                    continue
                raise ScenarioError(
                    f"the file of samples {path} has no numbers in row {number}: {shown(cells)}."
                ) from None
            if len(rows[-1]) != len(rows[0]) or len(cells) < 2:
                raise ScenarioError(
                    f"the file of samples {path} has {len(cells)} cells in row {number}; each row must hold the time "
                    "and the same number of weights, at least one."
                )
    if not rows:
        raise ScenarioError(f"the file of samples {path} holds no rows of numbers.")
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def _csv_rows(file: TextIO, path: Path) -> Iterator[list[str]]:
    try:
        yield from csv.reader(file)
    except csv.Error as error:
        raise ScenarioError(f"the file of samples {path} is not a table of comma-separated values: {error}.") from error


def _read_npz(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        arrays = np.load(path, allow_pickle=False)
        if not isinstance(arrays, np.lib.npyio.NpzFile):
            raise ValueError("it holds a single array")
        with arrays:
            found = {name: arrays[name] for name in ("t", "w") if name in arrays}
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, NotImplementedError) as error:
        raise ScenarioError(f"the file of samples {path} is not an npz file of numbers: {error}.") from error
    for name in ("t", "w"):
        if name not in found:
            raise ScenarioError(f"the file of samples {path} has no array '{name}'; it must hold 't' and 'w'.")
        if found[name].dtype.kind not in "fiu":
            raise ScenarioError(
                f"the file of samples {path}: '{name}' holds {found[name].dtype}; it must hold real numbers."
            )
    times, weights = found["t"].astype(float), found["w"].astype(float)
    if weights.ndim > 0 and len(weights) == 0:
        raise ScenarioError(f"the file of samples {path} has no samples; it must hold at least 2.")
    columns = weights.reshape(len(weights), -1) if weights.ndim in (1, 2) else weights
    if times.ndim != 1 or columns.ndim != 2 or len(times) != len(columns):
        raise ScenarioError(
            f"the file of samples {path} has 't' of shape {times.shape} and 'w' of shape {weights.shape}; they must be "
            "(samples,) and (samples, edges)."
        )
    return times, columns

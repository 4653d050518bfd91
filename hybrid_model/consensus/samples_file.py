"""Samples of weights out of a file: CSV, or NumPy's npz."""

import csv
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.tables import ScenarioError

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
    if path.suffix not in readers:
        raise ScenarioError(f"the file of samples {path} ends in '{path.suffix}'; it must be a .csv or .npz file.")
    try:
        times, weights = readers[path.suffix](path)
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
    with path.open(newline="", encoding="utf-8") as file:
        for number, cells in enumerate(csv.reader(file), start=1):
            if not cells:
                continue
            try:
                rows.append([float(cell) for cell in cells])
            except ValueError:
                if number == 1:
                    continue
                raise ScenarioError(f"the file of samples {path} has no numbers in row {number}: {cells}.") from None
            if len(rows[-1]) != len(rows[0]) or len(cells) < 2:
                raise ScenarioError(
                    f"the file of samples {path} has {len(cells)} cells in row {number}; each row must hold the time "
                    "and the same number of weights, at least one."
                )
    if not rows:
        raise ScenarioError(f"the file of samples {path} holds no rows of numbers.")
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def _read_npz(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            missing = [name for name in ("t", "w") if name not in arrays]
            if missing:
                raise ScenarioError(
                    f"the file of samples {path} has no array '{missing[0]}'; it must hold 't' and 'w'."
                )
            times, weights = np.asarray(arrays["t"], dtype=float), np.asarray(arrays["w"], dtype=float)
    except (zipfile.BadZipFile, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(f"the file of samples {path} is not an npz file of numbers: {error}.") from error
    columns = weights.reshape(len(weights), -1) if weights.ndim in (1, 2) else weights
    if times.ndim != 1 or columns.ndim != 2 or len(times) != len(columns):
        raise ScenarioError(
            f"the file of samples {path} has 't' of shape {times.shape} and 'w' of shape {weights.shape}; they must be "
            "(samples,) and (samples, edges)."
        )
    return times, columns

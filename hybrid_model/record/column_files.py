"""Columns of numbers in files of other programs; the name of the file decides in which form.

``.csv``; ``.npz`` of NumPy; ``.mat`` of MATLAB and Octave (level 5); ``.nc``, netCDF-3, which xarray reads. A jump is
two rows of one time.
"""

from __future__ import annotations

import csv
import os
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.errors import DataError

LONGEST_NAME = 63
"""Letters of a name in MATLAB."""

Columns = Mapping[str, npt.NDArray[Any]]


def write_columns(
    path: str | Path, columns: Columns, units: Mapping[str, str] | None = None, about: Mapping[str, str] | None = None
) -> None:
    """Write columns of one length to a file, all at once or not at all.

    Parameters
    ----------
    path : str or Path
        Ends in one of `ENDINGS`; its folder is made.
    columns : mapping
        Name -> numbers, shape (rows,); the time first.
    units : mapping, optional
        Name of a column -> its unit, for ``.mat`` and ``.nc``.
    about : mapping, optional
        Texts about the run, for ``.mat`` and ``.nc``.

    Raises
    ------
    DataError
        For a name with another ending.
    OSError
        With the name of the file, as on a full disk.
    """
    path = Path(path)
    require_ending(path)
    with replaced(path) as part:
        _WRITERS[path.suffix.lower()](part, columns, units or {}, about or {})


def require_ending(path: str | Path) -> None:
    """Refuse a name that says no form, before a run rather than after it.

    Raises
    ------
    DataError
        With the endings that there are.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise DataError(
            f"{path} ends in {ending!r}: tables are written as {', '.join(ENDINGS)}; give one of these endings."
        )


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a path beside a file, whose folder is made, that takes its place when all went well, and else goes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        # Whoever writes knows the part, or no name at all.
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        part.unlink(missing_ok=True)


def matlab_names(names: Mapping[str, Any] | list[str]) -> dict[str, str]:
    """Return column -> name of a variable in MATLAB: letters, digits and underscores, each name once."""
    found: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "x"
        plain = (plain if plain[0].isalpha() else f"x{plain}")[:LONGEST_NAME]
        number = 1
        while plain in found.values():
            number += 1
            plain = f"{plain[: LONGEST_NAME - 4]}_{number}"
        found[name] = plain
    return found


def _csv(path: Path, columns: Columns, units: Mapping[str, str], about: Mapping[str, str]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


def _npz(path: Path, columns: Columns, units: Mapping[str, str], about: Mapping[str, str]) -> None:
    # Not `np.savez`, which takes names as arguments and so has none called `file`.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, column in columns.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, column, allow_pickle=False)


def _mat(path: Path, columns: Columns, units: Mapping[str, str], about: Mapping[str, str]) -> None:
    from scipy.io import savemat

    names = matlab_names(columns)
    content: dict[str, Any] = {plain: np.asarray(columns[name], dtype=float) for name, plain in names.items()}
    told = {plain: [name, units.get(name, "")] for name, plain in names.items()}
    free = next(f"info{k or ''}" for k in range(len(names) + 1) if f"info{k or ''}" not in content)
    content[free] = {**about, "columns": {plain: {"name": name, "unit": unit} for plain, (name, unit) in told.items()}}
    with path.open("wb") as file:
        savemat(file, content, long_field_names=True, oned_as="column", do_compression=True)


def _netcdf(path: Path, columns: Columns, units: Mapping[str, str], about: Mapping[str, str]) -> None:
    from scipy.io import netcdf_file

    with netcdf_file(path, "w", version=2) as file:
        for name, text in about.items():
            setattr(file, name, text.encode())
        file.createDimension("sample", len(next(iter(columns.values()))))
        for name, column in columns.items():
            variable = file.createVariable(name.replace("/", "_"), "d", ("sample",))
            variable[:] = column
            variable.units = units.get(name, "").encode()


_WRITERS = {".csv": _csv, ".npz": _npz, ".mat": _mat, ".nc": _netcdf}
ENDINGS = tuple(_WRITERS)
"""Of the files that `write_columns` writes."""

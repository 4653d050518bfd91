"""An FMU's binary in this process, over fmpy; what fails leaves this process as it was."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from fmpy import read_model_description

from fmu.check.archive import Archive

Fmu = TypeVar("Fmu")


def read_description(path: str | Path, *, validate: bool = True) -> Any:
    """Return fmpy's description of an FMU whose archive is safe to extract.

    Parameters
    ----------
    path : str or Path
    validate : bool
        Whether to hold the description against its schema.

    Raises
    ------
    ArchiveError
        If the archive must not be extracted.
    Exception
        Whatever fmpy raises for a description that it cannot read.
    """
    with Archive(path):
        return read_model_description(str(path), validate=validate)


def load_binary(make: Callable[..., Fmu], folder: Path, **arguments: Any) -> Fmu:
    """Return an object of fmpy with the FMU's binary loaded.

    Parameters
    ----------
    make : type
        ``FMU2Slave``, ``FMU2Model``, ``FMU3Slave`` or ``FMU3Model`` of fmpy.
    folder : Path
        The FMU, unpacked.
    **arguments
        ``guid``, ``modelIdentifier`` and ``instanceName``.

    Raises
    ------
    Exception
        Of fmpy, if there is no binary for this machine or it cannot be loaded.
    """
    # fmpy goes to the binary's folder to load it, and stays there if that fails.
    with _working_folder_kept():
        return make(unzipDirectory=str(folder), **arguments)


@contextlib.contextmanager
def _working_folder_kept() -> Iterator[None]:
    here = os.getcwd()
    try:
        yield
    finally:
        os.chdir(here)

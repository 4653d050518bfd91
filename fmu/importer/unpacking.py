"""An FMU on disk, where its binary and its resources are found."""

from __future__ import annotations

import os
from pathlib import Path

from fmu.archives.reading import Archive

_RESOURCES = "resources"
_FOR_OTHERS = ("documentation", "sources")
"""What people read and compilers take: a binary has its own files in its resources (FMI 3.0.2 section 2.5)."""


def unpack(archive: Archive, folder: Path) -> Path:
    """Write what an archive's binaries may use below an existing folder, and return it.

    There is a folder for resources then, whether it holds any or not: packers drop empty folders, and FMUs look for it.

    Parameters
    ----------
    archive : Archive
        Found safe to extract.
    folder : Path

    Raises
    ------
    ArchiveError
        If the bytes of a file are damaged.
    """
    archive.extract(folder, _FOR_OTHERS)
    (folder / _RESOURCES).mkdir(exist_ok=True)
    return folder


def resource_location(folder: Path, major: int) -> str:
    """Return where an FMU finds its resources, in the form of its version of the standard.

    Parameters
    ----------
    folder : Path
        The FMU, unpacked.
    major : int
        Version of the standard: 2 has a URI, 3 an absolute path that ends in a separator.
    """
    place = (folder / _RESOURCES).resolve()
    return f"{place}{os.sep}" if major == 3 else place.as_uri()

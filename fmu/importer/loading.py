"""An FMU's binary in this process, over fmpy; what fails leaves this process as it was."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from fmpy import platform, platform_tuple, read_model_description, sharedLibraryExtension
from fmpy.model_description import ValidationError
from lxml import etree

from fmu.archives.reading import Archive, ArchiveError
from fmu.importer.plain_xml import PlainXmlError, require_plain

Fmu = TypeVar("Fmu")
DESCRIPTION = "modelDescription.xml"


class LoadError(ValueError):
    """An FMU cannot be loaded on this machine."""


class DescriptionError(LoadError):
    """The description of an FMU cannot be read; the message says why."""


UNREADABLE = (ArchiveError, PlainXmlError, LoadError, ValidationError, OSError)
"""What `read_description` raises."""


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
    PlainXmlError
        If its description has a DOCTYPE, or is not in UTF-8.
    LoadError
        If it is of another version, such as 1.0, which fmpy reads as far as it fits.
    DescriptionError
        If fmpy cannot read it.
    ValidationError
        Of fmpy, if it does not fit its schema.
    OSError
        If there is no such file.
    """
    with Archive(path) as archive:
        if DESCRIPTION in archive.names:
            text = archive.read(DESCRIPTION)
            require_plain(text, DESCRIPTION)
            if version := _other_version(text):
                raise LoadError(f"It is of FMI {version}, and FMI 2.0 and 3.0 are run here: export it as one of them.")
        try:
            return read_model_description(str(path), validate=validate)
        except ValidationError:
            raise
        except Exception as error:  # of no class of its own, or of whatever meets what does not fit
            raise DescriptionError(_told(error)) from error


def _told(error: Exception) -> str:
    if isinstance(error, (KeyError, IndexError, TypeError, AttributeError)):
        return f"its {DESCRIPTION} does not fit FMI's schema, and `hybrid-fmu validate` says where ({error!r})."
    return str(error)


def _other_version(description: bytes) -> str:
    """The version of a description of neither FMI 2 nor 3; nothing for these, without a version, or if it is no XML."""
    try:
        version = str(etree.fromstring(description).get("fmiVersion", ""))
    except etree.XMLSyntaxError:
        return ""
    return version if version.partition(".")[0] not in ("", "2", "3") else ""


def major_of(description: Any) -> int | None:
    """Return the version of the standard, 2 or 3, of a description; None for any other."""
    version = str(description.fmiVersion)
    return 2 if version == "2.0" else 3 if version.startswith("3.") else None


def load_binary(make: Callable[..., Fmu], folder: Path, major: int, **arguments: Any) -> Fmu:
    """Return an object of fmpy with the FMU's binary loaded.

    Parameters
    ----------
    make : type
        ``FMU2Slave``, ``FMU2Model``, ``FMU3Slave`` or ``FMU3Model`` of fmpy.
    folder : Path
        The FMU, unpacked.
    major : int
        Version of the standard.
    **arguments
        ``guid``, ``modelIdentifier`` and ``instanceName``.

    Raises
    ------
    LoadError
        If there is no binary for this machine.
    Exception
        Of fmpy, if it cannot be loaded.
    """
    _require_binary(folder, major == 3, arguments["modelIdentifier"])
    # fmpy goes to the binary's folder to load it, and stays there if that fails.
    with _working_folder_kept():
        return make(unzipDirectory=str(folder), **arguments)


def _require_binary(folder: Path, fmi3: bool, identifier: str) -> None:
    wanted, places = platform_tuple if fmi3 else platform, folder / "binaries"
    if not (places / wanted / f"{identifier}{sharedLibraryExtension}").is_file():
        others = sorted(place.name for place in places.iterdir()) if places.is_dir() else []
        raise LoadError(
            f"there is no binaries/{wanted}/{identifier}{sharedLibraryExtension} in it; it has binaries for "
            f"{', '.join(others) or 'no platform'}. Export or build it for this one."
        )


@contextlib.contextmanager
def _working_folder_kept() -> Iterator[None]:
    here = os.getcwd()
    try:
        yield
    finally:
        os.chdir(here)

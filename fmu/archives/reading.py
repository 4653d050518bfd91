"""The archive of an FMU: looked at before anything is written, then extracted.

This module and `fmu.archives.checks` need only the standard library and nothing of the exporter, so that importers
may use them too.
"""

from __future__ import annotations

import operator
import struct
import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO

from fmu.archives.checks import LIMITS, ArchiveLimits, is_folder, name_of, problems_of, remarks_of

BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    NotImplementedError,
    EOFError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
    IndexError,
)
"""What `zipfile` raises on damaged archives."""

_CHUNK = 1 << 20


class ArchiveError(ValueError):
    """An archive must not be extracted; the message says why.

    Attributes
    ----------
    problems : tuple of tuple of str
        Rule and sentence of each problem.
    """

    def __init__(self, problems: tuple[tuple[str, str], ...]) -> None:
        super().__init__(" ".join(sentence for _, sentence in problems[:5]))
        self.problems = problems


class Archive:
    """An archive that has been found safe to extract.

    Parameters
    ----------
    path : str or Path
        The FMU, or another archive that `limits` say.
    limits : ArchiveLimits

    Attributes
    ----------
    prefixed : bool
        Whether bytes precede the archive.
    remarks : tuple of tuple of str
        Rule and sentence of what is wrong, but harmless here: backslashes, entries that are there twice and equal.

    Raises
    ------
    ArchiveError
        If the file is no archive, or holds a name, a link, a size or a coding that an FMU must not have.
    OSError
        If the file cannot be read.
    """

    def __init__(self, path: str | Path, limits: ArchiveLimits = LIMITS) -> None:
        self._kind = limits.kind
        self._file: IO[bytes] = Path(path).open("rb")  # noqa: SIM115 - `__exit__` closes it
        try:
            self._zip = _opened(self._file, limits.kind)
            problems = tuple(problems_of(self._zip, limits)) or tuple(self._differences())
            if problems:
                raise ArchiveError(problems)
            self.remarks = tuple(remarks_of(self._zip))
        except BaseException:
            self._file.close()
            raise
        self.prefixed = bool(self._zip.infolist()) and min(m.header_offset for m in self._zip.infolist()) > 0
        self._members = {name_of(member): member for member in self._zip.infolist() if not is_folder(member)}
        self._folders = [name_of(member) for member in self._zip.infolist() if is_folder(member)]

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()
        self._file.close()

    @property
    def names(self) -> list[str]:
        """Names of the files, in the archive's order."""
        return list(self._members)

    def size(self, name: str) -> int:
        """Return the unpacked size of a file in bytes."""
        return self._members[name].file_size

    def read(self, name: str) -> bytes:
        """Return what a file holds.

        Raises
        ------
        ArchiveError
            If its bytes are damaged.
        """
        return b"".join(self._chunks(self._members[name]))

    def extract(self, folder: Path, without: Collection[str] = ()) -> Path:
        """Write all files and folders, empty ones too, below an existing folder, and return it.

        Parameters
        ----------
        folder : Path
        without : collection of str
            Folders at the top of the archive that are left in it.

        Raises
        ------
        ArchiveError
            If the bytes of a file are damaged.
        """
        for name in self._folders:
            if name.split("/", 1)[0] in without:
                continue
            folder.joinpath(*name.removesuffix("/").split("/")).mkdir(parents=True, exist_ok=True)
        for name, member in self._members.items():
            if name.split("/", 1)[0] in without:
                continue
            target = folder.joinpath(*name.split("/"))
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as file:
                for chunk in self._chunks(member):
                    file.write(chunk)
        return folder

    def _differences(self) -> Iterator[tuple[str, str]]:
        """Yield the files that are there twice with different contents."""
        first: dict[str, zipfile.ZipInfo] = {}
        for member in self._zip.infolist():
            name = name_of(member)
            other = first.setdefault(name, member)
            if other is member or is_folder(member):
                continue
            same = other.file_size == member.file_size and all(
                map(operator.eq, self._chunks(other), self._chunks(member))
            )
            if not same:
                yield (
                    "duplicate",
                    f"The member {name[:120]!r} is there twice with different contents, and readers differ in which "
                    "one they take.",
                )

    def _chunks(self, info: zipfile.ZipInfo) -> Iterator[bytes]:
        name = name_of(info)
        try:
            with self._zip.open(info) as member:
                # zipfile stops at the announced size, which has been held against the limits, and checks the sum.
                while chunk := member.read(_CHUNK):
                    yield chunk
        except BROKEN as error:
            raise ArchiveError(
                (("damaged", f"The member {name!r} is damaged: {error}. Pack the {self._kind} anew."),)
            ) from error


def _opened(file: IO[bytes], kind: str) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(file)
    except BROKEN as error:
        raise ArchiveError(
            (("zip", f"The file is not a readable ZIP archive: {error}. Pack the {kind} anew."),)
        ) from error

"""Write FMU archives: all at once or not at all, and the same bytes from the same content."""

from __future__ import annotations

import os
import secrets
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from fmu.errors import BuildError

ARCHIVE_DATE = (1980, 1, 1, 0, 0, 0)


def package(
    content: Path | Mapping[str, bytes | Path], fmu_path: Path, description: str = "modelDescription.xml"
) -> Path:
    """Write an FMU archive with fixed dates and sorted names, all at once or not at all.

    Parameters
    ----------
    content : Path or mapping of str to bytes or Path
        A folder, or the members' names (with ``/``) and what they hold: bytes, or the path of a file.
    fmu_path : Path
        The archive to write.  What was there stays until the new one is complete.
    description : str
        The member that it must have at its top.

    Returns
    -------
    Path
        The archive, that is `fmu_path`.

    Raises
    ------
    BuildError
        If ``modelDescription.xml`` is missing, a name is not a plain relative path, two names differ in case only,
        a file cannot be read or the archive cannot be written.
    """
    try:
        members = _entries(content)
    except OSError as error:
        raise BuildError(
            f"'{error.filename}' cannot be read for the FMU '{fmu_path.name}': {error.strerror}. "
            "Remedy: check that the file exists and may be read."
        ) from error
    _check_names(list(members))
    if description not in members:
        raise BuildError(
            f"The FMU '{fmu_path.name}' has no {description}; every FMU needs one at its top. "
            "Remedy: add the model description to the content."
        )
    with (
        replacing(fmu_path) as temporary,
        # The highest level takes twice as long and saves three bytes in a thousand.
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive,
    ):
        for name in sorted(members):
            entry = zipfile.ZipInfo(name, ARCHIVE_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            archive.writestr(entry, members[name])
    return fmu_path


def check_target(path: Path) -> None:
    """Refuse a file that cannot be written, before a long build rather than after it.

    Makes the folder if it does not exist.

    Parameters
    ----------
    path : Path
        The file to be written later.

    Raises
    ------
    BuildError
        If it is a folder, or its folder cannot be made or written to.
    """
    if path.is_dir():
        raise BuildError(f"'{path}' is a folder, and an FMU is a file. Remedy: give the name of a file in it.")
    with replacing(path, keep=False):
        pass


@contextmanager
def replacing(target: Path, *, mode: int = 0o666, keep: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside the target that replaces it on success and disappears on failure.

    Parameters
    ----------
    target : Path
        File to write; its folder is made if it does not exist.
    mode : int
        Permissions, less those that the process's mask takes away.
    keep : bool
        Whether the file replaces the target in the end.

    Yields
    ------
    Path
        An empty file.

    Raises
    ------
    BuildError
        If the file cannot be made or written, or cannot take the target's place.
    """
    # Not derived from the target's name, which may be as long as the system allows.
    temporary = target.parent / f".hybrid-fmu-{secrets.token_hex(8)}.part"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
    except OSError as error:
        raise _unwritable(target, error) from error
    try:
        yield temporary
        if keep:
            try:
                os.replace(temporary, target)
            except OSError as error:
                raise _unwritable(target, error) from error
    except OSError as error:
        # Where a disk is full the system names no file.
        if error.filename is None and error.strerror:
            raise _unwritable(target, error) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def _unwritable(target: Path, error: OSError) -> BuildError:
    return BuildError(
        f"The file '{target}' cannot be written: {error.strerror}. Remedy: choose a folder where you may write files."
    )


def _entries(content: Path | Mapping[str, bytes | Path]) -> dict[str, bytes]:
    """Return the bytes of each archive member by its name."""
    if isinstance(content, Path):
        if not content.is_dir():
            raise BuildError(f"The folder '{content}' to be packaged does not exist. Remedy: export into it first.")
        files = [path for path in content.rglob("*") if path.is_file()]
        return {path.relative_to(content).as_posix(): path.read_bytes() for path in files}
    return {name: item.read_bytes() if isinstance(item, Path) else item for name, item in content.items()}


def _check_names(names: list[str]) -> None:
    seen: dict[str, str] = {}
    for name in names:
        parts = name.split("/")
        if name == "" or "\\" in name or ":" in name or any(part in ("", ".", "..") for part in parts):
            raise BuildError(
                f"The archive member '{name}' is not a plain relative path; an FMU must stay within its folder. "
                "Remedy: use names like 'binaries/x86_64-linux/Model.so'."
            )
        other = seen.setdefault(name.casefold(), name)
        if other != name:
            raise BuildError(
                f"The archive members '{other}' and '{name}' differ in case only; they are one file on Windows and "
                "macOS. Remedy: rename one of them."
            )

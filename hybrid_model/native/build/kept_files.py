"""Files that take long to make, kept in the user's cache under a name that says what they were made from.

A file's name holds the digest of its key and the digest of its content. Each is written under another name and then
renamed: whoever looks sees a whole file or none, whatever else runs or was killed. A file whose content is not that of
its name is deleted and made again. Without a cache that can be written, files live as long as the process.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import os
import secrets
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from hybrid_model.native.build.cache_folder import is_private, trusted_folder
from hybrid_model.native.build.scratch import PREFIX, ScratchFolder, locked, remove_abandoned

LIMIT = 512 * 2**20
"""Bytes that the cache holds at most: in each of its folders an equal share, or a single larger file."""
_FOLDERS = "0123456789abcdef"
_DIGITS = 32
_ABANDONED = 3600.0
"""Age in s at which an unfinished file has no writer any more."""


def kept(name: str, key: str, make: Callable[[Path], None]) -> Path:
    """Return a file from the cache, made if it is not there.

    Parameters
    ----------
    name : str
        The file's name ends with it.
    key : str
        All that the content follows from.
    make : callable
        Writes the file to a path that is not in the cache yet. What it raises is passed on.

    Returns
    -------
    Path
        The file, not to be changed. Other processes may delete it once it is the one unused for longest.
    """
    [found] = _find([(name, key)])
    if found is not None:
        return found[0]
    with ScratchFolder() as scratch:
        fresh = Path(scratch).resolve() / name
        make(fresh)
        return keep(name, key, fresh.read_bytes())


def kept_content(name: str, key: str) -> bytes | None:
    """Return the content of a file that was kept, or None if there is none."""
    return kept_contents([(name, key)])[0]


def kept_contents(wanted: Sequence[tuple[str, str]]) -> list[bytes | None]:
    """Return the contents of files that were kept, by names and keys, and None for each that was not."""
    return [None if found is None else found[1] for found in _find(wanted)]


def keep(name: str, key: str, content: bytes) -> Path:
    """Keep a file, in the cache if that is possible, else for as long as the process runs."""
    digest = _key_digest(name, key)
    folder, final = _shared(trusted_folder(), digest[0]), f"{digest}-{_digest(content)}-{name}"
    if folder is not None:
        # Whatever is wrong with it, a full disk or another's lock, this process can go on.
        with suppress(OSError):
            return _stored(content, folder, final)
    return _stored(content, _Own.folder(), final)


def _find(wanted: Sequence[tuple[str, str]]) -> list[tuple[Path, bytes] | None]:
    """Look for files; who may write to the cache is asked once for all of them, and each folder listed once."""
    digests = [_key_digest(name, key) for name, key in wanted]
    root = trusted_folder()
    shared = {digit: _shared(root, digit) for digit in {digest[0] for digest in digests}}
    names = functools.cache(_names)

    def find(digest: str) -> tuple[Path, bytes] | None:
        for folder in (shared[digest[0]], _Own.made()):
            found = _found(folder, names(folder).get(digest, [])) if folder else None
            if found is not None:
                return found
        return None

    return [find(digest) for digest in digests]


def _key_digest(name: str, key: str) -> str:
    return _digest(f"{name}\0{key}".encode())


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGITS]


def _shared(root: Path | None, digit: str) -> Path | None:
    """Return the folder of the cache for digests that begin so, or None if the cache cannot be used."""
    if root is None:
        return None
    folder = root / digit
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        return folder if is_private(folder) else None
    except OSError:
        return None


def _names(folder: Path) -> dict[str, list[str]]:
    """Return the names of a folder's files by the digests of their keys."""
    names: dict[str, list[str]] = {}
    with suppress(OSError):
        for name in os.listdir(folder):
            names.setdefault(name[:_DIGITS], []).append(name)
    return names


def _found(folder: Path, names: Sequence[str]) -> tuple[Path, bytes] | None:
    """Return the whole file among those of a key, and its content; damaged ones are deleted."""
    for path in (folder / name for name in names):
        # It may vanish at any time, and a read-only cache has no times of use.
        with suppress(OSError):
            content = path.read_bytes() if is_private(path) else b""
            if _digest(content) == path.name.split("-")[1]:
                with suppress(OSError):
                    os.utime(path)
                return path, content
            path.unlink()
    return None


def _stored(content: bytes, folder: Path, name: str) -> Path:
    path, temporary = folder / name, folder / f".{secrets.token_hex(8)}"
    try:
        temporary.write_bytes(content)
        temporary.chmod(0o700)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    _bound(folder, path)
    return path


def _bound(folder: Path, newest: Path) -> None:
    """Delete what was not used for longest beyond a folder's share of `LIMIT`, and what writers left unfinished."""
    files = []
    for entry in os.scandir(folder):
        with suppress(OSError):
            status = entry.stat(follow_symlinks=False)
            if entry.name.startswith("."):
                if time.time() - status.st_mtime > _ABANDONED:
                    os.unlink(entry.path)
            elif entry.name != newest.name:
                files.append((status.st_mtime, status.st_size, entry.path))
    total = newest.stat().st_size
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > LIMIT // len(_FOLDERS):
            with suppress(OSError):
                os.unlink(path)


class _Own:
    """The folder of files that only this process has."""

    _lock = threading.Lock()
    _folder: tuple[int, Path] | None = None

    @classmethod
    def made(cls) -> Path | None:
        # A forked process makes one of its own, and leaves its parent's alone.
        return cls._folder[1] if cls._folder is not None and cls._folder[0] == os.getpid() else None

    @classmethod
    def folder(cls) -> Path:
        with cls._lock:
            made = cls.made()
            if made is None:
                remove_abandoned()
                made = Path(tempfile.mkdtemp(prefix=PREFIX)).resolve()
                locked(made)
                cls._folder = os.getpid(), made
                atexit.register(_remove, os.getpid(), made)
            return made


def _remove(process: int, folder: Path) -> None:
    if process == os.getpid():
        shutil.rmtree(folder, ignore_errors=True)

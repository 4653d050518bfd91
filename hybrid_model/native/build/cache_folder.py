"""Where compiled files are kept, and whether what lies there may be loaded.

A library that is loaded does what it likes: a folder in which others can write is no place to load from.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

VARIABLE = "HYBRID_FMU_CACHE"
"""Environment variable that names another folder than the one of `cache_root`."""


def cache_root() -> Path:
    """Return the folder for all that is kept between processes; whatever is in it may be deleted at any time.

    It is the environment variable ``HYBRID_FMU_CACHE`` if that is set, else the folder ``hybrid-fmu`` in the user's
    folder for caches: ``XDG_CACHE_HOME`` or ``~/.cache``, on macOS ``~/Library/Caches``, on Windows ``LOCALAPPDATA``.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(chosen).absolute()
    if sys.platform == "win32":
        root = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        root = Path.home() / "Library" / "Caches"
    else:
        root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root).absolute() / "hybrid-fmu"


def zig_folder() -> Path:
    """Return the folder where zig keeps the C libraries of the platforms that it has built for.

    It is the environment variable ``ZIG_GLOBAL_CACHE_DIR`` if that is set, else ``zig`` in `cache_root`.
    """
    if os.environ.get("ZIG_GLOBAL_CACHE_DIR"):
        return Path(os.environ["ZIG_GLOBAL_CACHE_DIR"]).absolute()
    return cache_root() / "zig"


def trusted_folder() -> Path | None:
    """Return the folder of compiled files, made if need be, or None if there is none that is safe to load from.

    Safe is a folder in which nobody else may write, below folders in which not everybody may replace it.
    """
    try:
        folder = cache_root() / "built"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder = folder.resolve()
        safe = is_private(folder) and all(_keeps_names(parent) for parent in folder.parents)
    except (OSError, RuntimeError):
        # RuntimeError: there is no home folder.
        return None
    return folder if safe else None


def is_private(path: Path) -> bool:
    """Return whether a file or folder belongs to this user or the system's, and nobody else may write to it."""
    if sys.platform == "win32":
        # Folders of a user are closed to others by access lists, which the mode does not show.
        return True
    status = path.stat()
    return status.st_uid in (os.geteuid(), 0) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _keeps_names(folder: Path) -> bool:
    """Return whether what lies in a folder cannot be replaced by anybody: not open to all, or each keeps their own."""
    if sys.platform == "win32":
        return True
    mode = folder.stat().st_mode
    return not mode & stat.S_IWOTH or bool(mode & stat.S_ISVTX)

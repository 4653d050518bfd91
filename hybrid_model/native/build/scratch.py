"""Temporary folders of processes that may be killed: what one leaves behind, the next one that makes one removes.

Each is locked by its process, and the system frees the locks of processes that are gone, however they ended.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
import tempfile
import time
import weakref
from contextlib import suppress
from pathlib import Path

PREFIX = "hybrid-fmu-scratch-"
YOUNG = 60.0
"""Age in s below which a folder may not be locked yet."""
UNLOCKED = 86400.0
"""Age in s from which a folder is nobody's where folders cannot be locked."""


class ScratchFolder(tempfile.TemporaryDirectory[str]):
    """A temporary folder, as `tempfile.TemporaryDirectory` makes it, that is removed even if the process is killed.

    That is done by whoever makes the next one, of the same user.
    """

    def __init__(self) -> None:
        remove_abandoned()
        super().__init__(prefix=PREFIX)
        lock = locked(Path(self.name))
        self._free = None if lock is None else weakref.finalize(self, os.close, lock)

    def cleanup(self) -> None:
        """Remove the folder."""
        super().cleanup()
        if self._free is not None:
            self._free()


def locked(folder: Path) -> int | None:
    """Lock a folder for as long as the process lives; return the lock, or None if another has it or there are none."""
    if sys.platform == "win32":
        return None
    import fcntl

    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock


def remove_abandoned() -> None:
    """Remove the folders of this user's processes that were killed."""
    with suppress(OSError):
        for entry in os.scandir(tempfile.gettempdir()):
            if entry.name.startswith(PREFIX):
                with suppress(OSError):
                    _remove_if_abandoned(Path(entry.path))


def _remove_if_abandoned(folder: Path) -> None:
    status = folder.lstat()
    age = time.time() - status.st_mtime
    if not stat.S_ISDIR(status.st_mode) or age < YOUNG:
        return
    if sys.platform == "win32":
        if age > UNLOCKED:
            shutil.rmtree(folder, ignore_errors=True)
        return
    lock = locked(folder) if status.st_uid == os.geteuid() else None
    if lock is not None:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)

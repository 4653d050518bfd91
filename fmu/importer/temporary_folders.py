"""Temporary folders that are gone when this process is, however it ends.

Native code of strangers may end a process at any line, by a signal or by `exit`: then no clean-up of Python runs. So a
small process waits for the end of this one, which it sees at the end of its input, and removes what is left.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

_SWEEP = "import shutil, sys; sys.stdin.read(); shutil.rmtree(sys.argv[1], ignore_errors=True)"


def temporary_folder() -> Path:
    """Make a folder of its own; whoever is done with it may remove it earlier."""
    return Path(tempfile.mkdtemp(dir=_root(os.getpid())))


@functools.cache
def _root(process: int) -> str:
    # By process: what a fork makes is its own to remove.
    root = tempfile.mkdtemp(prefix="hybrid-fmu-")
    sweeper = None
    with contextlib.suppress(OSError):  # where no process can be started, a crash leaves its folders behind
        sweeper = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _SWEEP, root],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # an interrupt from the keyboard is for this process alone
        )
    atexit.register(_end, process, root, sweeper)
    return root


def _end(process: int, root: str, sweeper: subprocess.Popen[bytes] | None) -> None:
    if process != os.getpid():
        return
    shutil.rmtree(root, ignore_errors=True)
    if sweeper is not None and sweeper.stdin is not None:
        sweeper.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):  # a fork may hold its input open
            sweeper.wait(1.0)

"""Run compilers, many at a time, so that an error or an interrupt stops all of them and leaves nothing behind.

Compilers are called with argument lists, never through a shell, with the process's environment and folder left as
they are.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hybrid_model.errors import BuildError
from hybrid_model.native.build.cache_folder import zig_folder
from hybrid_model.native.build.compiler import not_started

REPORT_LINES, REPORT_COLUMNS = 40, 300
"""What is shown of a compiler's report: its first errors are what matters."""


@dataclass(frozen=True)
class Task:
    """One call of a compiler: the command, the folder to run in, and what it is for, as in "failed to ...".

    `label` is told to people when the task is done.
    """

    command: tuple[str, ...]
    folder: Path
    purpose: str
    label: str = ""


def run_all(tasks: Sequence[Task], scratch: Path, progress: Callable[[str], None] | None = None) -> None:
    """Run tasks, as many at a time as there are processors; the first failure or an interrupt stops all of them.

    Parameters
    ----------
    tasks : sequence of Task
        In no particular order.
    scratch : Path
        Folder for the compilers' temporary files, deleted by the caller.
    progress : callable, optional
        Told the labels of tasks as they end.

    Raises
    ------
    BuildError
        If a compiler cannot be started or fails.
    """
    jobs = _Jobs(_environment(scratch))
    with ThreadPoolExecutor(max(1, min(len(tasks), _processors()))) as pool:
        try:
            labels = {pool.submit(jobs.run, task): task.label for task in tasks}
            for done in as_completed(labels):
                done.result()
                if progress is not None and labels[done]:
                    progress(labels[done])
        except BaseException:
            jobs.stop()
            raise


class _Jobs:
    """Processes that can be stopped together with the processes that they start."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._stopped = False

    def run(self, task: Task) -> None:
        with self._lock:
            if self._stopped:
                return
            process = self._start(task)
            self._running.add(process)
        try:
            out, errors = process.communicate()
        finally:
            with self._lock:
                self._running.discard(process)
        if process.returncode != 0:
            raise BuildError(
                f"The compiler '{task.command[0]}' failed to {task.purpose} (status {process.returncode}). "
                f"Remedy: correct what its report says:\n{_shortened(errors.strip() or out.strip())}"
            )

    def stop(self) -> None:
        with self._lock:
            self._stopped = True
            for process in self._running:
                if sys.platform == "win32":
                    process.kill()
                else:
                    # Its group, because compilers start other programs, which would go on writing files.
                    with suppress(ProcessLookupError):
                        os.killpg(process.pid, signal.SIGKILL)

    def _start(self, task: Task) -> subprocess.Popen[str]:
        try:
            return subprocess.Popen(
                task.command,
                cwd=task.folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                process_group=0,
            )
        except OSError as error:
            raise not_started(task.command[0], error) from error


def _environment(scratch: Path) -> dict[str, str]:
    """Return the environment for compilers: temporary files in one folder, plain language, no hidden options."""
    kept = zig_folder()
    try:
        kept.mkdir(parents=True, exist_ok=True)
        usable = os.access(kept, os.W_OK)
    except OSError:
        usable = False
    own = {
        **dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(scratch)),
        "LC_ALL": "C",
        # What depends on the model is not worth keeping.
        "ZIG_LOCAL_CACHE_DIR": str(scratch / "zig"),
        "ZIG_GLOBAL_CACHE_DIR": str(kept if usable else scratch / "zig"),
    }
    # The linker would write this one into libraries.
    return {name: value for name, value in os.environ.items() if name != "LD_RUN_PATH"} | own


def _processors() -> int:
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _shortened(report: str) -> str:
    lines = [line if len(line) <= REPORT_COLUMNS else f"{line[:REPORT_COLUMNS]} ..." for line in report.splitlines()]
    more = len(lines) - REPORT_LINES
    return "\n".join(lines if more <= 0 else [*lines[:REPORT_LINES], f"... and {more} more lines"])

"""C compilers: which one there is, and running it many times at once.

Compilers are called with argument lists, never through a shell, with the process's environment and folder left as
they are.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fmu.errors import BuildError

REPORT_LINES, REPORT_COLUMNS = 40, 300
"""What is shown of a compiler's report: its first errors are what matters."""

IMPORTANT_VARIABLES = ("PATH", "CPATH", "C_INCLUDE_PATH", "GCC_EXEC_PREFIX", "COMPILER_PATH", "SDKROOT")
"""Of the environment: what can change a compiler's results."""


def find_compiler() -> list[str]:
    """Find a C compiler for this machine.

    Returns
    -------
    list of str
        The command to which arguments are appended: the value of the environment variable ``CC`` if it is set,
        else the first of ``cc``, ``gcc``, ``clang`` on the path, else the C compiler of the package ziglang.

    Raises
    ------
    BuildError
        If ``CC`` names no executable, or if there is no compiler at all.
    """
    chosen = os.environ.get("CC", "").split()
    if chosen:
        if shutil.which(chosen[0]) is None:
            raise BuildError(
                f"The environment variable CC is '{' '.join(chosen)}', but there is no program '{chosen[0]}'. "
                "Remedy: let CC name an installed C compiler, or unset it."
            )
        return chosen
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            return [path]
    if importlib.util.find_spec("ziglang") is not None:
        return zig_compiler()
    raise BuildError(
        "No C compiler was found: neither CC nor cc, gcc, clang, nor the package ziglang. "
        "Remedy: install a C compiler (for example the package gcc of the system), or: pip install ziglang."
    )


def zig_compiler() -> list[str]:
    """Return the command of the C compiler that builds for all platforms.

    Raises
    ------
    BuildError
        If the package ziglang is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError(
            "Building for other platforms than this machine's needs the package ziglang, which is not installed. "
            "Remedy: pip install 'hybrid-fmu[zig]', or: pip install ziglang."
        )
    return [sys.executable, "-m", "ziglang", "cc"]


def is_zig(command: Sequence[str]) -> bool:
    """Return whether a compiler's command is that of zig, which has a target for each platform."""
    return "cc" in command[1:] and any(part == "ziglang" or Path(part).stem == "zig" for part in command)


def cache_folder() -> Path:
    """Return the folder where zig keeps the C libraries of the platforms that it has built for.

    It is the environment variable ``ZIG_GLOBAL_CACHE_DIR`` if that is set, else the folder ``hybrid-fmu/zig`` in the
    user's folder for caches. Whatever is in it may be deleted; the next build then takes longer.
    """
    if os.environ.get("ZIG_GLOBAL_CACHE_DIR"):
        return Path(os.environ["ZIG_GLOBAL_CACHE_DIR"]).absolute()
    if sys.platform == "win32":
        root = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        root = Path.home() / "Library" / "Caches"
    else:
        root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root).absolute() / "hybrid-fmu" / "zig"


def compiler_identity(command: Sequence[str]) -> str:
    """Return a text that changes when a compiler does: its command, files, version and environment."""
    program = shutil.which(command[0])
    if program is None:
        raise BuildError(
            f"There is no compiler '{command[0]}'. Remedy: check the environment variable CC or the command given."
        )
    status = os.stat(program)
    variables = tuple((name, os.environ.get(name, "")) for name in IMPORTANT_VARIABLES)
    return _identity(tuple(command), os.path.realpath(program), status.st_size, status.st_mtime_ns, variables)


@functools.lru_cache(maxsize=64)
def _identity(command: tuple[str, ...], *parts: object) -> str:
    try:
        done = subprocess.run([*command, "--version"], capture_output=True, stdin=subprocess.DEVNULL, check=False)
    except OSError as error:
        raise _not_started(command[0], error) from error
    return repr((command, parts, done.stdout))


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
            raise _not_started(task.command[0], error) from error


def _not_started(program: str, error: OSError) -> BuildError:
    return BuildError(
        f"The compiler '{program}' could not be started: {error.strerror}. Remedy: check the environment variable CC."
    )


def _environment(scratch: Path) -> dict[str, str]:
    """Return the environment for compilers: temporary files in one folder, plain language, no hidden options."""
    kept = cache_folder()
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

"""One experiment in a child process with limits: a crash, a hang or a flood is a finding, not an end."""

from __future__ import annotations

import contextlib
import json
import math
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu.validate.child.calls import PLACE_BYTES
from fmu.validate.findings import Finding, Severity, error, note, quoted, warning

LIFE_CYCLE = "FMI 2.0.4 sections 3.2 and 4.2; FMI 3.0.2 sections 2.3, 3.2 and 4.2"
_ROOT = Path(__file__).resolve().parents[3]
_BEGIN = "import sys; sys.path.insert(0, sys.argv[1]); "
_FORKS = _BEGIN + "from fmu.validate.child.forks import serve; serve()"
_ONE = _BEGIN + "from fmu.validate.child.experiments import main; sys.exit(main(sys.argv[2]))"


@dataclass(frozen=True)
class RunLimits:
    """Limits of one child process.

    Attributes
    ----------
    seconds : float
        Time of the clock and of the processor, in s.
    bad_step_seconds : float
        Time for one step that no importer sends, in s.
    memory, file_bytes : int
        Memory and largest file, in bytes.
    """

    seconds: float = 20.0
    bad_step_seconds: float = 2.0
    memory: int = 2 << 30
    file_bytes: int = 64 << 20


def run_experiment(plan: dict[str, Any], limits: RunLimits, children: Children) -> Iterator[Finding]:
    """Make the experiment of a plan, and yield what it finds and how its process ends.

    Parameters
    ----------
    plan : dict
        From `fmu.validate.smoke.plan.plan_of`, with the name of the experiment.
    limits : RunLimits
    children : Children
        Where its process comes from.
    """
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        place, findings, work = folder / "place", folder / "findings", folder / "work"
        place.write_bytes(bytes(PLACE_BYTES))
        findings.touch()
        work.mkdir()
        bounds = {
            "memory": limits.memory,
            "cpu": math.ceil(limits.seconds) + 1,
            "file_bytes": limits.file_bytes,
            "bad_step_seconds": min(limits.seconds, limits.bad_step_seconds),
        }
        plan = {**plan, **bounds, "place": str(place), "findings": str(findings)}
        (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
        status = children.run(folder, limits.seconds)
        lines = _lines(findings)
        done = any(line.get("done") for line in lines)
        at = place.read_bytes().rstrip(b"\0").decode("utf-8", "replace")
        for line in lines:
            if not line.get("done"):
                kind, message = Severity(line["severity"]), str(line.get("message", ""))
                yield Finding(kind, str(line["rule"]), message, line.get("reference") or LIFE_CYCLE)
        yield from _ending(status, done, at, limits, _tail(folder / "stderr"))
        printed = _tail(folder / "stdout")
        if printed:
            yield warning(
                "run.stdout", f"It prints to stdout, which is the host's: {quoted(printed)}. Log by the callback."
            )
        left = sorted(path.name for path in work.iterdir())
        if left:
            yield warning("run.files", f"It leaves {quoted(left[0])} in the working folder, which is the host's.")


class Children:
    """Where child processes come from: forks of one that has everything imported, or, without `fork`, each by itself.

    Used as a context; the process is started when the first child is wanted.
    """

    def __init__(self) -> None:
        self._parent: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *error: object) -> None:
        if self._parent is not None:
            self._parent.communicate()

    def run(self, folder: Path, seconds: float) -> int | None:
        """Make the experiment of a folder; return its exit status, or None if its time ran out."""
        if sys.platform == "win32":
            return _run_alone(folder, seconds)
        parent = self._parent = self._parent or subprocess.Popen(
            [sys.executable, "-I", "-c", _FORKS, str(_ROOT)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,
        )
        assert parent.stdin is not None
        assert parent.stdout is not None
        parent.stdin.write(f"{folder}\n".encode())
        pid = int(parent.stdout.readline())
        in_time = bool(select.select([parent.stdout], [], [], seconds)[0])
        # What the child has started shares its group.
        if not in_time:
            _end_group(pid)
        answer = parent.stdout.readline()
        _end_group(pid)
        if not answer:  # the child has ended its parent
            parent.wait()
            self._parent = None
        return int(answer or -signal.SIGKILL) if in_time else None


def _end_group(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _run_alone(folder: Path, seconds: float) -> int | None:
    command = [sys.executable, "-I", "-c", _ONE, str(_ROOT), str(folder / "plan.json")]
    with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
        process = subprocess.Popen(
            command, cwd=folder / "work", stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
        try:
            return process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None
        finally:
            process.kill()
            process.wait()


def _lines(path: Path) -> list[dict[str, Any]]:
    lines = []
    for text in path.read_text(encoding="utf-8", errors="replace").splitlines():
        with contextlib.suppress(ValueError):
            line = json.loads(text)
            if isinstance(line, dict) and (line.get("done") or line.get("severity") in ("error", "warning", "note")):
                lines.append(line)
    return lines


def _tail(path: Path, limit: int = 2000) -> str:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - limit))
        return file.read(limit).decode("utf-8", "replace").strip()


def _ending(status: int | None, done: bool, at: str, limits: RunLimits, said: str) -> Iterator[Finding]:
    times_up = hasattr(signal, "SIGXCPU") and status == -signal.SIGXCPU
    step_over = hasattr(signal, "SIGALRM") and status == -signal.SIGALRM
    last = f" It last printed {quoted(said[-300:], 300)} to stderr." if said else ""
    if status is None or times_up or step_over:
        seconds = limits.bad_step_seconds if step_over else limits.seconds
        yield error(
            "run.hang",
            f"It hangs in {at}: no answer within {min(seconds, limits.seconds):g} s. Each call must end.{last}",
            LIFE_CYCLE,
        )
    elif status < 0:
        name = next((known.name for known in signal.Signals if known == -status), f"signal {-status}")
        yield error(
            "run.crash",
            f"It crashes with {name} in {at} (limit of memory: {limits.memory >> 20} MiB).{last}",
            LIFE_CYCLE,
        )
    elif status != 0 or not done:
        yield error(
            "run.exit", f"The process ends with status {status} in {at}. An FMU must not exit.{last}", LIFE_CYCLE
        )
    elif said:
        yield note("run.stderr", f"It prints to stderr: {quoted(said)}.")

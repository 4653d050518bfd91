"""Run an FMU shortly, each experiment in a child process with limits: a crash or hang is a finding, not an end."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu.check.child.calls import PLACE_BYTES
from fmu.check.child.experiments import POINTS
from fmu.check.description import Description, Variable, true
from fmu.check.findings import Finding, Severity, error, note, quoted, warning
from fmu.check.platforms import EXTENSIONS, parts_of, runs_here, this_machine

LIFE_CYCLE = "FMI 2.0.4 sections 3.2 and 4.2; FMI 3.0.2 sections 2.3, 3.2 and 4.2"
_ROOT = Path(__file__).resolve().parents[2]
_START = """\
import sys
sys.path.insert(0, sys.argv[1])
from fmu.check.child.experiments import main
sys.exit(main(sys.argv[2]))
"""
_LARGEST_ARRAY = 1_000_000
_JACOBIAN = 20
"""Rows and columns of the Jacobian that are asked for."""
_DIRECTIONAL = ("providesDirectionalDerivative", "providesDirectionalDerivatives")


@dataclass(frozen=True)
class RunLimits:
    """Limits of one child process: time in s of the clock and the processor, memory and largest file in bytes."""

    seconds: float = 20.0
    memory: int = 2 << 30
    file_bytes: int = 64 << 20


def run_fmu(folder: Path, description: Description, limits: RunLimits) -> tuple[tuple[str, ...], list[Finding]]:
    """Run each interface type of an extracted FMU.

    Parameters
    ----------
    folder : Path
        The FMU, extracted.
    description : Description
    limits : RunLimits

    Returns
    -------
    tuple of str
        Interface types that were run.
    list of Finding
    """
    executed, findings = [], []
    for kind, attributes in description.interfaces.items():
        binary = _binary(folder, attributes.get("modelIdentifier", ""))
        if binary is None:
            machine = "-".join(this_machine())
            findings.append(
                note("run.platform", f"{kind} was not run: there is no binary for this machine, {machine}.")
            )
            continue
        if true(attributes, "needsExecutionTool"):
            findings.append(
                note("run.tool", f"{kind} was not run: it needs its tool at run time (needsExecutionTool).")
            )
            continue
        executed.append(kind)
        for experiment in _experiments(kind, attributes):
            plan = _plan(folder, binary, description, kind, experiment, limits)
            findings += list(_child(plan, f"{kind}, {experiment.replace('_', ' ')}", limits))
    large = [v for v in description.variables if (description.size(v) or 0) > _LARGEST_ARRAY]
    if large:
        findings.append(note("run.large", f"The array {quoted(large[0].name)} is too large to be read in the run."))
    return tuple(executed), findings


def _binary(folder: Path, identifier: str) -> Path | None:
    places = folder / "binaries"
    for place in sorted(places.iterdir()) if places.is_dir() else []:
        parts = parts_of(place.name)
        if parts is not None and runs_here(place.name) and not parts[2]:
            file = place / f"{identifier}{EXTENSIONS[parts[1]]}"
            if file.is_file():
                return file
    return None


def _experiments(kind: str, attributes: Any) -> list[str]:
    experiments = ["life_cycle", "token"]
    if true(attributes, "canGetAndSetFMUstate") or true(attributes, "canGetAndSetFMUState"):
        experiments.append("state")
    if kind == "CoSimulation":
        experiments.append("bad_steps")
    directional = any(true(attributes, name) for name in _DIRECTIONAL)
    if kind != "ScheduledExecution" and (directional or attributes.get("maxOutputDerivativeOrder", "0") != "0"):
        experiments.append("derivatives")
    return experiments


def _plan(
    folder: Path, binary: Path, description: Description, kind: str, experiment: str, limits: RunLimits
) -> dict[str, Any]:
    attributes = description.interfaces[kind]
    start, stop, step, points = _times(description, attributes)
    resources = folder / "resources"
    # FMI 3 wants a separator at the end of the path.
    place = "" if not resources.is_dir() else f"{resources}{os.sep}" if description.major == 3 else str(resources)
    states = [description.referred(unknown.reference) for unknown in description.structure["derivatives"]]
    indicators = [description.referred(unknown.reference) for unknown in description.structure["indicators"]]
    return {
        "major": description.major,
        "kind": kind,
        "experiment": experiment,
        "binary": str(binary),
        "resources": place,
        "token": description.token,
        "variables": [_entry(description, kind, variable) for variable in description.variables],
        "event_mode": kind == "CoSimulation" and true(attributes, "hasEventMode"),
        "variable_step": true(attributes, "canHandleVariableCommunicationStepSize"),
        "once": true(attributes, "canBeInstantiatedOnlyOncePerProcess"),
        "serialize": true(attributes, "canSerializeFMUstate") or true(attributes, "canSerializeFMUState"),
        "completed_step": (
            not true(attributes, "completedIntegratorStepNotNeeded")
            if description.major == 2
            else true(attributes, "needsCompletedIntegratorStep")
        ),
        "states": sum(description.size(state) or 0 for state in states if state is not None),
        "indicators": (
            description.number_of_indicators
            if description.major == 2
            else sum(description.size(indicator) or 0 for indicator in indicators if indicator is not None)
        ),
        "jacobian": _jacobian(description) if any(true(attributes, name) for name in _DIRECTIONAL) else [],
        "adjoint": true(attributes, "providesAdjointDerivatives"),
        "output_derivatives": _differentiable_outputs(description, attributes),
        "start": start,
        "stop": stop,
        "step": step,
        "points": points,
        # Short enough for stiff models to stay finite over the few steps.
        "euler_step": (stop - start) / 1000.0,
        "memory": limits.memory,
        "cpu": math.ceil(limits.seconds) + 1,
        "file_bytes": limits.file_bytes,
    }


def _entry(description: Description, kind: str, variable: Variable) -> list[Any]:
    size = description.size(variable)
    fits = size is not None and size <= _LARGEST_ARRAY
    settable = (
        variable.start is not None
        and variable.variability != "constant"
        and variable.initial in ("exact", "approx")
        and variable.causality not in ("independent", "structuralParameter")
        and variable.type not in ("Clock", "Binary")
        and not variable.clocks
    )
    # Clocks and clocked variables can be read in Event Mode only, while the clock is active.
    readable = fits and variable.type != "Clock" and not variable.clocks
    start = list(variable.start or ()) if settable and fits else None
    return [variable.name, variable.reference, variable.type, size if fits else 0, variable.causality, start, readable]


def _jacobian(description: Description) -> list[list[Any]]:
    """Return some unknowns, each with its value reference and those of the inputs and states it depends on."""
    derivatives = [description.referred(u.reference) for u in description.structure["derivatives"]]
    states = {d.derivative for d in derivatives if d is not None and d.derivative is not None}
    rows: list[list[Any]] = []
    for unknown in (*description.structure["derivatives"], *description.structure["outputs"]):
        variable = description.referred(unknown.reference)
        if variable is None or not _is_smooth_scalar(variable):
            continue
        knowns = []
        for number in unknown.dependencies or ():
            known = description.referred(number)
            if known is not None and (number in states or known.causality == "input") and _is_smooth_scalar(known):
                knowns.append(known.reference)
        if knowns:
            rows.append([variable.name, variable.reference, knowns[:_JACOBIAN]])
    return rows[:_JACOBIAN]


def _differentiable_outputs(description: Description, attributes: Any) -> list[int]:
    if attributes.get("maxOutputDerivativeOrder", "0") == "0":
        return []
    outputs = [v for v in description.variables if v.causality == "output" and _is_smooth_scalar(v)]
    return [variable.reference for variable in outputs[:_JACOBIAN]]


def _is_smooth_scalar(variable: Variable) -> bool:
    double = variable.type in ("Real", "Float64") and not variable.dimensions and not variable.clocks
    return double and variable.variability == "continuous"


def _times(description: Description, attributes: Any) -> tuple[float, float, float, int]:
    """Return start, stop, step and number of communication points."""
    given = {
        name: float(text.replace("INF", "inf"))
        for name, text in description.experiment.items()
        if name.endswith(("Time", "Size"))
    }
    start = given.get("startTime", 0.0)
    stop = given.get("stopTime", start + 1.0)
    if not (math.isfinite(start) and math.isfinite(stop) and stop > start):
        start, stop = 0.0, 1.0
    fixed = float(attributes.get("fixedInternalStepSize", "nan").replace("INF", "inf"))
    step = given.get("stepSize", fixed if math.isfinite(fixed) else (stop - start) / 20.0)
    if not 0.0 < step <= stop - start:
        step = (stop - start) / 20.0
    return start, stop, step, max(1, min(POINTS, math.floor((stop - start) / step * (1.0 + 1e-9))))


def _child(plan: dict[str, Any], where: str, limits: RunLimits) -> Iterator[Finding]:
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        place, findings, work = folder / "place", folder / "findings", folder / "work"
        place.write_bytes(bytes(PLACE_BYTES))
        findings.touch()
        work.mkdir()
        plan = {**plan, "place": str(place), "findings": str(findings)}
        (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
        status = _run(folder, work, limits)
        lines = _lines(findings)
        done = any(line.get("done") for line in lines)
        at = place.read_bytes().rstrip(b"\0").decode("utf-8", "replace")
        for line in lines:
            if not line.get("done"):
                message = f"{where}: {line.get('message', '')}"
                yield Finding(Severity(line["severity"]), str(line["rule"]), message, LIFE_CYCLE)
        yield from _ending(status, done, at, where, limits, _tail(folder / "stderr"))
        printed = _tail(folder / "stdout")
        if printed:
            yield warning(
                "run.stdout",
                f"{where}: it prints to stdout, which is the host's: {quoted(printed)}. Log by the callback.",
            )
        left = sorted(path.name for path in work.iterdir())
        if left:
            yield warning(
                "run.files", f"{where}: it leaves {quoted(left[0])} in the working folder, which is the host's."
            )


def _run(folder: Path, work: Path, limits: RunLimits) -> int | None:
    """Return the exit status of the child, or None if its time ran out."""
    command = [sys.executable, "-I", "-c", _START, str(_ROOT), str(folder / "plan.json")]
    with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
        process = subprocess.Popen(
            command, cwd=work, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
        try:
            return process.wait(limits.seconds)
        except subprocess.TimeoutExpired:
            return None
        finally:
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the child and what it started: they share its session's group."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    elif process.poll() is None:
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


def _ending(status: int | None, done: bool, at: str, where: str, limits: RunLimits, said: str) -> Iterator[Finding]:
    times_up = hasattr(signal, "SIGXCPU") and status == -signal.SIGXCPU
    if status is None or times_up:
        yield error(
            "run.hang",
            f"{where}: it hangs in {at}: no answer within {limits.seconds:g} s. Each call must end.",
            LIFE_CYCLE,
        )
    elif status < 0:
        name = signal.Signals(-status).name if -status in signal.Signals._value2member_map_ else f"signal {-status}"
        yield error(
            "run.crash",
            f"{where}: it crashes with {name} in {at} (limit of memory: {limits.memory >> 20} MiB).",
            LIFE_CYCLE,
        )
    elif status != 0 or not done:
        last = f": {quoted(said[-300:], 300)}" if said else ""
        yield error(
            "run.exit",
            f"{where}: the process ends with status {status} in {at}{last}. An FMU must not exit.",
            LIFE_CYCLE,
        )
    elif said:
        yield note("run.stderr", f"{where}: it prints to stderr: {quoted(said)}.")

"""The experiments of the smoke run; each is made in a process of its own."""

from __future__ import annotations

import json
import math
import signal
import sys
from pathlib import Path
from typing import Any

from fmu.validate.child.calls import OK, WARNING, Recorder, Stopped
from fmu.validate.child.claims import element_dependencies, evaluation, input_derivatives, output_orders
from fmu.validate.child.comparison import Whole, compare
from fmu.validate.child.dependencies import dependencies
from fmu.validate.child.fmi2 import Fmi2
from fmu.validate.child.fmi3 import Fmi3
from fmu.validate.child.interface_types import instantiate, run_of
from fmu.validate.child.perturbation import moved_starts, moved_states
from fmu.validate.child.run import Run
from fmu.validate.child.slopes import slopes
from fmu.validate.child.start_values import start_values

POINTS = 400
"""Communication points of a run at most."""


def life_cycle(fmu: Any, recorder: Recorder) -> None:
    """Instantiate, run, reset, run again: equal results; terminate, free."""
    instantiate(fmu, recorder)
    first = _whole(fmu, recorder)
    fmu.do("Reset")
    second = _whole(fmu, recorder)
    compare(fmu, "run.reset", "after a reset", first, second)
    fmu.do("Terminate") if not second[2] else None
    fmu.free()
    if not fmu.plan["once"]:
        instantiate(fmu, recorder)
        third = _whole(fmu, recorder)
        compare(fmu, "run.repeat", "in a second instance", first, third)
        fmu.free()


def state(fmu: Any, recorder: Recorder) -> None:
    """Get, run, set, run: equal results, also by way of bytes."""
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.begin()
    half = fmu.plan["points"] // 2
    rest = fmu.plan["points"] - half
    run.advance(half)
    if run.ended:
        recorder.find("note", "run.state", "The state was not checked, since the run ends early.")
        fmu.free()
        return
    saved, mark = fmu.save(), run.mark()
    here, onward = run.read_all(), run.advance(rest)
    _back(fmu, run, saved, mark)
    compare(
        fmu,
        "run.state",
        "after the state was set again",
        (here, onward, False),
        (run.read_all(), run.advance(rest), False),
    )
    if fmu.plan["serialize"]:
        content = fmu.serialize(saved)
        if fmu.serialize(saved) != content:
            recorder.find(
                "warning",
                "run.serialize",
                "Serialising one state twice gives different bytes: addresses may be among them.",
            )
        copy = fmu.deserialize(content)
        _back(fmu, run, copy, mark)
        found = (run.read_all(), run.advance(rest), False)
        compare(fmu, "run.serialize", "after the state was set from bytes", (here, onward, False), found)
        fmu.release(copy)
    fmu.release(saved)
    fmu.free()


def token(fmu: Any, recorder: Recorder) -> None:
    """A wrong token is refused."""
    if fmu.instantiate(fmu.plan["token"] + "-wrong"):
        name = "GUID" if fmu.major == 2 else "instantiation token"
        recorder.find(
            "error",
            "run.token",
            f"A wrong {name} is accepted: by it an importer learns that description and binary differ.",
        )


def bad_steps(fmu: Any, recorder: Recorder) -> None:
    """Steps of NaN and of negative length are refused, in bounded time."""
    for h, name in ((math.nan, "NaN"), (-fmu.plan["step"], "a negative length")):
        instantiate(fmu, recorder)
        run = run_of(fmu, recorder)
        run.begin()
        if run.ended:
            fmu.free()
            return
        step = _limited_step(fmu, run.t, h)
        if step.status in (OK, WARNING):
            recorder.find(
                "error",
                "run.bad_step",
                f"doStep({run.t!r}, {h!r}), a step of {name}, returns {fmu.status(step.status)}.",
            )
        fmu.free()


def _limited_step(fmu: Any, t: float, h: float) -> Any:
    """Do a step; where the system has alarms, one ends this process if the step takes too long."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, fmu.plan["bad_step_seconds"])
    try:
        return fmu.step(t, h)
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def derivatives(fmu: Any, recorder: Recorder) -> None:
    """Directional derivatives are numbers, equal after another call, and the adjoint ones are their transpose."""
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.begin()
    run.advance(1)
    for unknown, reference, knowns in fmu.plan["jacobian"] if not run.ended else ():
        if not fmu.plan["directional"]:
            row = fmu.directional([reference], knowns, [1.0], adjoint=True)
            run.require_numbers(f"An adjoint derivative of {unknown!r}", row)
            continue
        row = [fmu.directional([reference], [known], [1.0])[0] for known in knowns]
        if any(math.isnan(slope) for slope in row):
            text = f"A directional derivative of {unknown!r} is NaN: {row[:10]}."
            recorder.find("warning", "run.derivative", text)
        elif not _homogeneous(fmu, reference, knowns, row):
            text = f"Seeds twice as large do not double the directional derivative of {unknown!r}: it must be linear."
            recorder.find("error", "run.derivative", text)
        elif fmu.plan["adjoint"]:
            column = fmu.directional([reference], knowns, [1.0], adjoint=True)
            if not all(_close(one, other, row) for one, other in zip(column, row, strict=True)):
                text = f"The adjoint derivatives of {unknown!r} are {column[:10]}, the directional ones {row[:10]}."
                recorder.find("error", "run.derivative", text)
    if fmu.plan["output_derivatives"] and not run.ended:
        slopes = fmu.output_derivatives(fmu.plan["output_derivatives"])
        run.require_numbers("An output derivative", slopes)
    fmu.free()


def _homogeneous(fmu: Any, reference: int, knowns: list[int], row: list[float]) -> bool:
    # Differences to one side, which the standard allows, do not add up where the model has a kink.
    one, two = (fmu.directional([reference], knowns, [seed] * len(knowns))[0] for seed in (1.0, 2.0))
    return _close(two, 2.0 * one, row)


def _close(first: float, second: float, row: list[float]) -> bool:
    """Tell whether two sums over a row of the Jacobian are equal up to what differences of a solver's values give."""
    return math.isclose(first, second, rel_tol=1e-3, abs_tol=1e-3 * sum(map(abs, row)) + 1e-6)


EXPERIMENTS = {
    "life_cycle": life_cycle,
    "state": state,
    "token": token,
    "bad_steps": bad_steps,
    "derivatives": derivatives,
    "start_values": start_values,
    "output_orders": output_orders,
    "input_derivatives": input_derivatives,
    "evaluation": evaluation,
    "element_dependencies": element_dependencies,
    "dependencies": dependencies,
    "moved_states": moved_states,
    "moved_starts": moved_starts,
    "slopes": slopes,
}


def _whole(fmu: Any, recorder: Recorder) -> Whole:
    run = run_of(fmu, recorder)
    run.begin()
    values = run.read_all()
    run.point()
    return values, run.advance(fmu.plan["points"]), run.ended


def _back(fmu: Any, run: Run, saved: Any, mark: tuple[Any, ...]) -> None:
    fmu.restore(saved)
    run.back(mark)


def main(plan_path: str) -> int:
    """Make the experiment of a plan."""
    plan = json.loads(Path(plan_path).read_text(encoding="utf-8"))
    _limit(plan["memory"], plan["cpu"], plan["file_bytes"])
    recorder = Recorder(plan["place"], plan["findings"])
    try:
        fmu = (Fmi2 if plan["major"] == 2 else Fmi3)(plan, recorder)
        EXPERIMENTS[plan["experiment"]](fmu, recorder)
    except Stopped:
        pass
    except MemoryError:
        recorder.find("error", "run.memory", "The process is out of memory.")
    recorder.at("leaving the process")
    recorder.done()
    return 0


def _limit(memory: int, cpu: int, file_bytes: int) -> None:
    if sys.platform == "win32":
        return
    import resource

    wanted = {"RLIMIT_AS": memory, "RLIMIT_CPU": cpu, "RLIMIT_FSIZE": file_bytes, "RLIMIT_CORE": 0}
    for name, limit in wanted.items():
        hard = resource.getrlimit(getattr(resource, name))[1]
        bound = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        try:
            resource.setrlimit(getattr(resource, name), (bound, bound))
        except (ValueError, OSError):  # macOS refuses limits of the address space
            continue

"""Values moved a little: states are where the description says, and unknowns move only with their dependencies.

Directional derivatives are the FMU's own word, where it has them at all; values are what importers get.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from fmu.validate.child.calls import Recorder, Variable
from fmu.validate.child.dependencies import STRUCTURE
from fmu.validate.child.interface_types import instantiate, run_of

ORDER = "FMI 2.0.4 sections 2.2.7 and 2.2.8; FMI 3.0.2 sections 2.4.7 and 2.4.8: attribute derivative"
_SMALL, _LARGE = 1e-6, 1e-4
"""Change of a value, of its size: to tell values apart, and to see what depends on it."""
_EQUAL, _NOISE = 1e-9, 1e-7
"""Relative difference of what is one value, and change of an unknown that says nothing."""


def moved_states(fmu: Any, recorder: Recorder) -> None:
    """In Continuous-Time Mode states are moved one by one; no unknown may follow that leaves them out."""
    instantiate(fmu, recorder)
    run: Any = run_of(fmu, recorder)
    run.begin()
    run.advance(1)
    fmu.lenient = True  # a state beside the solution may be refused
    if not run.ended:
        states = [Variable(*entry) for entry in fmu.plan["state_entries"]]
        complete = states and sum(state.size for state in states) == len(run.x)
        if complete and _in_order(fmu, recorder, run, states):
            _move_states(fmu, recorder, run, states)
        _move_each(fmu, recorder, run.t, "input")
    fmu.free()


def moved_starts(fmu: Any, recorder: Recorder) -> None:
    """In Initialization Mode start values are moved one by one; no unknown may follow that leaves them out."""
    fmu.lenient = True  # not each FMU computes there
    instantiate(fmu, recorder)
    for variable in fmu.variables:
        if variable.start is not None:
            fmu.set(variable)
    fmu.enter_initialization()
    _move_each(fmu, recorder, float(fmu.plan["start"]), "start")
    fmu.free()


def _in_order(fmu: Any, recorder: Recorder, run: Any, states: list[Variable]) -> bool:
    """Give each state a value of its own, and read it by the variable that the description names; tell if all agree."""
    sizes = [_size(x, nominal) for x, nominal in zip(run.x, run.nominals, strict=True)]
    moved = [x + _SMALL * size * (1.0 + k / len(sizes)) for k, (x, size) in enumerate(zip(run.x, sizes, strict=True))]
    fmu.set_states(run.t, moved)
    found = [value for state in states for value in fmu.get(state)[0]]
    fmu.set_states(run.t, run.x)
    agree = True
    owners = [state for state in states for _ in range(state.size)]
    for owner, derivative, expected, value in zip(owners, fmu.plan["derivative_names"], moved, found, strict=True):
        if math.isclose(value, expected, rel_tol=_EQUAL):
            continue
        agree = False
        others = [o.name for o, other in zip(owners, moved, strict=True) if math.isclose(value, other, rel_tol=_EQUAL)]
        hint = f", which is the one of {others[0]!r}" if others else ""
        recorder.find(
            "error",
            "run.derivative_of",
            f"{derivative!r} is the derivative of {owner.name!r} by the description, but where that state is "
            f"set to {expected!r}, {owner.name!r} reads {value!r}{hint}: correct the attribute 'derivative' or the "
            "order of the derivatives.",
            ORDER,
        )
    return agree


def _move_states(fmu: Any, recorder: Recorder, run: Any, states: list[Variable]) -> None:
    first = 0
    for state in states:
        moved, further = list(run.x), list(run.x)
        for k in range(first, first + state.size):
            moved[k] += _LARGE * _size(run.x[k], run.nominals[k])
            further[k] += 2.0 * _LARGE * _size(run.x[k], run.nominals[k])
        first += state.size
        rows = [row for row in fmu.plan["moved"] if state.reference in row["left_out"]]
        _compare(
            fmu, recorder, run.t, state, rows, *(partial(fmu.set_states, run.t, x) for x in (run.x, moved, further))
        )


def _move_each(fmu: Any, recorder: Recorder, t: float, group: str) -> None:
    """Move the planned variables of a group, which are set by name."""
    for entry in fmu.plan[f"moved_{group}s"]:
        known = Variable(*entry)
        rows = [row for row in fmu.plan["moved"] if known.reference in row["left_out"]]
        if not rows:
            continue
        values = fmu.get(known)[0]
        moved, further = ([v + times * _LARGE * _size(v, 1.0) for v in values] for times in (1.0, 2.0))
        _compare(fmu, recorder, t, known, rows, *(partial(fmu.put, known, place) for place in (values, moved, further)))


def _compare(
    fmu: Any,
    recorder: Recorder,
    t: float,
    known: Variable,
    rows: list[dict[str, Any]],
    put_back: Callable[[], object],
    move: Callable[[], object],
    move_further: Callable[[], object],
) -> None:
    """Report the unknowns that move with a known, as far as it does: what a solver iterates to does not."""
    unknowns = [Variable(*row["unknown"]) for row in rows]
    if not unknowns:
        return
    readings = []
    for change in (put_back, move, put_back, move_further, put_back):
        change()
        readings.append([fmu.get(unknown)[0] for unknown in unknowns])
    for unknown, before, after, again, later, _ in zip(unknowns, *readings, strict=True):
        followed = [k for k in range(len(before)) if _follows(before[k], after[k], later[k])]
        if before == again and followed:
            place = followed[0]
            recorder.find(
                "error",
                "run.dependency",
                f"The dependencies of {unknown.name!r} leave out {known.name!r}, but at t = {t!r} it goes from "
                f"{before[place]!r} to {after[place]!r} when {known.name!r} alone is moved: list every known that an "
                "unknown depends on.",
                STRUCTURE,
            )


def _follows(before: float, after: float, later: float) -> bool:
    """Tell whether a value moves, and nearly twice as far for twice the move of what it may depend on."""
    moved = math.isfinite(before) and math.isfinite(after) and not math.isclose(before, after, rel_tol=_NOISE)
    return moved and math.isclose(later - before, 2.0 * (after - before), rel_tol=0.2)


def _size(value: float, nominal: float) -> float:
    return max(abs(value), nominal) if math.isfinite(value) else nominal

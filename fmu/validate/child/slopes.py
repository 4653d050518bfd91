"""Co-Simulation gives no states to set: there a derivative is known by what grows with it."""

from __future__ import annotations

import itertools
import math
from typing import Any

from fmu.validate.child.calls import Recorder, Variable
from fmu.validate.child.interface_types import instantiate, run_of
from fmu.validate.child.perturbation import ORDER

_POINTS = 20
_MISFIT, _FIT = 0.5, 0.01
"""Part of a growth that the named state's derivative leaves open, and that the right state's may."""


def slopes(fmu: Any, recorder: Recorder) -> None:
    """Hold the growth of states against the integrals of derivatives, by the trapezoidal rule.

    Events and long steps spoil the rule: so a derivative is only called wrong where another state grows by it.
    """
    pairs = [(Variable(*derivative), Variable(*state)) for derivative, state in fmu.plan["derivative_pairs"]]
    states = [state for _, state in pairs]
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.begin()
    fmu.lenient = True
    rows = [_row(fmu, run.t, pairs)]
    for _ in range(min(_POINTS, fmu.plan["points"])):
        run.advance(1)
        if run.ended:
            break
        rows.append(_row(fmu, run.t, pairs))
    for number, (derivative, state) in enumerate(pairs):
        misfits = [_misfit(rows, number, other) for other in range(len(pairs))]
        best = min(range(len(pairs)), key=misfits.__getitem__)
        # Two states at rest tell nothing: their misfits are infinite.
        if len(rows) > 3 and math.isfinite(misfits[number]) and misfits[number] > _MISFIT and misfits[best] < _FIT:
            recorder.find(
                "error",
                "run.derivative_of",
                f"{derivative.name!r} is the derivative of {state.name!r} by the description, but from "
                f"t = {rows[0][0]!r} to {rows[-1][0]!r} {states[best].name!r} grows by its integral and {state.name!r} "
                "does not: correct the attribute 'derivative'.",
                ORDER,
            )
    fmu.free()


Row = tuple[float, list[float], list[float]]


def _row(fmu: Any, t: float, pairs: list[tuple[Variable, Variable]]) -> Row:
    return t, [fmu.get(derivative)[0][0] for derivative, _ in pairs], [fmu.get(state)[0][0] for _, state in pairs]


def _misfit(rows: list[Row], derivative: int, state: int) -> float:
    """Return the part of a state's growth that the integral of a derivative does not give."""
    wrong = grown = 0.0
    for (t, slopes_before, before), (later, slopes_after, after) in itertools.pairwise(rows):
        growth = after[state] - before[state]
        integral = (later - t) * (slopes_before[derivative] + slopes_after[derivative]) / 2.0
        wrong += abs(growth - integral)
        grown += max(abs(growth), abs(integral))
    return wrong / grown if grown > 0.0 else math.inf

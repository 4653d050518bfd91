"""What a child process is told of an FMU: variables, flags, times."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

from fmu.importer.unpacking import resource_location
from fmu.standard.capabilities import Capability
from fmu.validate.child.experiments import POINTS
from fmu.validate.reading.description import Description, Unknown, Variable

LARGEST_ARRAY = 1_000_000
"""Elements of an array that is read."""
_JACOBIAN = 20
"""Rows and columns of the Jacobian that are asked for."""


def plan_of(folder: Path, binary: Path, description: Description, kind: str) -> dict[str, Any]:
    """Return what the experiments on an interface type of an extracted FMU need to know, as JSON takes it."""
    can = partial(description.can, kind)
    directional, adjoint = can(Capability.DIRECTIONAL_DERIVATIVES), can(Capability.ADJOINT_DERIVATIVES)
    start, stop, step, points = _times(description, description.interfaces[kind])
    states = [description.referred(unknown.reference) for unknown in description.structure["derivatives"]]
    indicators = [description.referred(unknown.reference) for unknown in description.structure["indicators"]]
    return {
        "major": description.major,
        "kind": kind,
        "binary": str(binary),
        "resources": resource_location(folder, description.major),
        "token": description.token,
        "variables": [entry(description, variable) for variable in description.variables],
        "clocks": any(variable.type == "Clock" for variable in description.variables),
        "event_mode": kind == "CoSimulation" and can(Capability.EVENT_MODE),
        "variable_step": can(Capability.VARIABLE_STEP),
        "once": can(Capability.ONCE_PER_PROCESS),
        "serialize": can(Capability.SERIALIZATION),
        "completed_step": can(Capability.COMPLETED_STEP),
        "states": sum(description.size(state) or 0 for state in states if state is not None),
        "indicators": (
            description.number_of_indicators
            if description.major == 2
            else sum(description.size(indicator) or 0 for indicator in indicators if indicator is not None)
        ),
        "jacobian": _jacobian(description) if directional or adjoint else [],
        "directional": directional,
        "adjoint": adjoint,
        "output_derivatives": _differentiable_outputs(description) if can(Capability.OUTPUT_DERIVATIVES) else [],
        "start": start,
        "stop": stop,
        "step": step,
        "points": points,
        "longest_step": (stop - start) / 1000.0,
    }


def entry(description: Description, variable: Variable) -> list[Any]:
    """Return a variable as the child process reads it."""
    size = description.size(variable)
    fits = size is not None and size <= LARGEST_ARRAY
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
    knowns = smooth_knowns(description)
    rows: list[list[Any]] = []
    for unknown, variable in smooth_unknowns(description):
        # Without dependencies an unknown depends on all knowns.
        listed = knowns if unknown.dependencies is None else unknown.dependencies
        references = [knowns[number].reference for number in listed if number in knowns]
        if references:
            rows.append([variable.name, variable.reference, references[:_JACOBIAN]])
    return rows[:_JACOBIAN]


def smooth_unknowns(description: Description) -> list[tuple[Unknown, Variable]]:
    """Return the state derivatives and outputs that are smooth scalars."""
    found = []
    for unknown in (*description.structure["derivatives"], *description.structure["outputs"]):
        variable = description.referred(unknown.reference)
        if variable is not None and is_smooth_scalar(variable):
            found.append((unknown, variable))
    return found


def smooth_knowns(description: Description) -> dict[int, Variable]:
    """Return the inputs and continuous states that are smooth scalars, by what the model structure calls them."""
    derivatives = [description.referred(u.reference) for u in description.structure["derivatives"]]
    states = {d.derivative for d in derivatives if d is not None and d.derivative is not None}
    numbered = ((k if description.major == 2 else v.reference, v) for k, v in enumerate(description.variables, 1))
    return {n: v for n, v in numbered if (n in states or v.causality == "input") and is_smooth_scalar(v)}


def _differentiable_outputs(description: Description) -> list[int]:
    outputs = [v for v in description.variables if v.causality == "output" and is_smooth_scalar(v)]
    return [variable.reference for variable in outputs[:_JACOBIAN]]


def is_smooth_scalar(variable: Variable) -> bool:
    """Return whether a variable is a scalar that can have derivatives."""
    double = variable.type in ("Real", "Float64") and not variable.dimensions and not variable.clocks
    return double and variable.variability == "continuous"


def _times(description: Description, attributes: Any) -> tuple[float, float, float, int]:
    """Return start, stop, step and number of communication points."""
    given = {name: float(text) for name, text in description.experiment.items() if name.endswith(("Time", "Size"))}
    start = given.get("startTime", 0.0)
    stop = given.get("stopTime", start + 1.0)
    if not (math.isfinite(start) and math.isfinite(stop) and stop > start):
        start, stop = 0.0, 1.0
    fixed = float(attributes.get("fixedInternalStepSize", "nan"))
    step = given.get("stepSize", fixed if math.isfinite(fixed) else (stop - start) / 20.0)
    if not 0.0 < step <= stop - start:
        step = (stop - start) / 20.0
    return start, stop, step, max(1, min(POINTS, math.floor((stop - start) / step * (1.0 + 1e-9))))

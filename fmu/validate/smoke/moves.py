"""What is moved to see whether dependencies are told in full, and what is looked at then."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fmu.standard.value_types import FLOATS
from fmu.validate.reading.description import Description, Unknown, Variable
from fmu.validate.smoke.plan import entry, is_smooth_scalar

_UNKNOWNS, _KNOWNS, _ELEMENTS = 100, 100, 100
"""Unknowns that are read, knowns that are moved, and elements of each."""


def moves(description: Description, kind: str) -> dict[str, dict[str, Any]]:
    """Return what each experiment on moved values, if there are any, changes in the plan, by its name."""
    experiments: dict[str, dict[str, Any]] = {}
    derivatives = [v for u in description.structure["derivatives"] if (v := description.referred(u.reference))]
    states = [s for d in derivatives if d.derivative is not None and (s := description.referred(d.derivative))]
    inputs = [v for v in description.variables if v.causality == "input" and v.variability == "continuous"]
    if kind == "ModelExchange" and states and len(states) == len(derivatives):
        rows = _rows(description, ("derivatives", "outputs"), [*states, *inputs])
        experiments["moved states"] = {
            "experiment": "moved_states",
            "state_entries": [entry(description, state) for state in states],
            "derivative_names": [d.name for d in derivatives for _ in range(description.size(d) or 0)],
            "moved": rows,
            "moved_inputs": _entries(description, inputs),
        }
    pairs = [
        [entry(description, derivative), entry(description, state)]
        for derivative in description.variables
        if (state := _state_of(description, derivative)) is not None
    ]
    if kind == "CoSimulation" and len(pairs) > 1:
        experiments["growth of states"] = {"experiment": "slopes", "derivative_pairs": pairs[:_UNKNOWNS]}
    starts = [
        v
        for v in description.variables
        if v.start is not None
        and v.variability != "constant"
        and (v.initial == "exact" or v.causality == "input")
        and v.causality in ("input", "parameter", "output", "local")
    ]
    rows = _rows(description, ("initial",), starts)
    # Only these: in Initialization Mode others follow further equations, as those that start a discrete state.
    if kind != "ScheduledExecution" and rows:
        experiments["moved start values"] = {
            "experiment": "moved_starts",
            "moved": rows,
            "moved_starts": _entries(description, starts),
        }
    return experiments


def _state_of(description: Description, derivative: Variable) -> Variable | None:
    """Return the scalar state of which a scalar variable is the derivative."""
    state = None if derivative.derivative is None else description.referred(derivative.derivative)
    return state if state is not None and is_smooth_scalar(state) and is_smooth_scalar(derivative) else None


def _rows(description: Description, names: Iterable[str], knowns: list[Variable]) -> list[dict[str, Any]]:
    """Return unknowns, each with the value references of the knowns that its dependencies leave out."""
    rows = []
    for unknown in (unknown for name in names for unknown in description.structure[name]):
        variable = description.referred(unknown.reference)
        if variable is None or unknown.dependencies is None or not _fits(description, variable):
            continue
        listed = _listed(description, unknown)
        # An unknown that is a known itself has itself, whether that is said or not.
        left_out = {v.reference for v in knowns if _fits(description, v) and v.name != variable.name} - listed
        if left_out:
            rows.append({"unknown": entry(description, variable), "left_out": sorted(left_out)})
    return rows[:_UNKNOWNS]


def _listed(description: Description, unknown: Unknown) -> set[int]:
    """Return the value references of the dependencies; those of discrete variables in FMI 2 may stand for others."""
    found = (description.referred(reference) for reference in unknown.dependencies or ())
    return {variable.reference for variable in found if variable is not None}


def _fits(description: Description, variable: Variable) -> bool:
    size = description.size(variable)
    return variable.type in FLOATS and not variable.clocks and size is not None and 0 < size <= _ELEMENTS


def _entries(description: Description, variables: list[Variable]) -> list[list[Any]]:
    return [entry(description, variable) for variable in variables if _fits(description, variable)][:_KNOWNS]

"""Which claims of a description are held against the binary, and what a child process is told of them."""

from __future__ import annotations

from typing import Any

from fmu.standard.capabilities import Capability
from fmu.validate.reading.description import Description, Variable
from fmu.validate.smoke.plan import LARGEST_ARRAY, entry, is_smooth_scalar, smooth_knowns, smooth_unknowns

_ORDERS = 10
"""Orders of output derivatives that are asked for."""
_UNKNOWNS = 5
"""Unknowns whose dependencies are asked for element by element."""
_LEFT_OUT, _SEEDED = 40, 1000
"""Unknowns that are asked for knowns they leave out, and knowns that are seeded at a time."""


def claims(description: Description, kind: str) -> dict[str, dict[str, Any]]:
    """Return what each experiment on a claim, if there is something to ask for, changes in the plan, by its name."""
    experiments: dict[str, dict[str, Any]] = {}
    values, parameters = _exact(description)
    if values or parameters:
        experiments["start values"] = {
            "experiment": "start_values",
            "exact": values,
            "exact_parameters": parameters,
        }
    order = int(description.interfaces[kind].get("maxOutputDerivativeOrder", "0"))
    outputs = [v for v in description.variables if v.causality == "output" and is_smooth_scalar(v)]
    if kind == "CoSimulation" and order > 1 and outputs:
        experiments["orders of output derivatives"] = {
            "experiment": "output_orders",
            "output_order": order,
            "output_orders": min(order, _ORDERS),
            "claim_output": entry(description, outputs[0]),
        }
    inputs = [v for v in description.variables if v.causality == "input" and is_smooth_scalar(v)]
    if kind == "CoSimulation" and description.can(kind, Capability.INPUT_DERIVATIVES) and inputs:
        experiments["input derivatives"] = {
            "experiment": "input_derivatives",
            "claim_input": entry(description, inputs[0]),
        }
    has_events = kind == "ModelExchange" or (kind == "CoSimulation" and description.can(kind, Capability.EVENT_MODE))
    if has_events and description.can(kind, Capability.EVALUATION):
        experiments["evaluation of discrete states"] = {"experiment": "evaluation"}
    unknowns = _unknowns(description)
    if description.can(kind, Capability.ELEMENT_DEPENDENCIES) and unknowns:
        experiments["dependencies of elements"] = {
            "experiment": "element_dependencies",
            "claim_unknowns": [entry(description, unknown) for unknown in unknowns],
        }
    directional = kind != "ScheduledExecution" and description.can(kind, Capability.DIRECTIONAL_DERIVATIVES)
    left_out = _left_out(description) if directional else []
    if left_out:
        experiments["dependencies"] = {"experiment": "dependencies", "left_out": left_out}
    return experiments


def _exact(description: Description) -> tuple[list[list[Any]], list[list[Any]]]:
    """Return what starts at a value that the binary holds: what an instance can change, and parameters with constants.

    First of the one come states and outputs, which every FMU of FMI 2 gives in Initialization Mode.
    """
    values, parameters = [], []
    states = {variable.reference for variable in smooth_knowns(description).values()}
    for variable in description.variables:
        size = description.size(variable)
        if (
            variable.start is None
            or variable.initial != "exact"
            or variable.causality in ("input", "independent")
            or variable.type in ("Clock", "Binary", "String")
            or variable.clocks
            or size is None
            or size > LARGEST_ARRAY
        ):
            continue
        if variable.variability == "constant" or variable.causality in ("parameter", "structuralParameter"):
            parameters.append(variable)
        else:
            values.append(variable)
    values.sort(key=lambda variable: not (variable.causality == "output" or variable.reference in states))
    first, second = (
        [[*entry(description, v)[:5], list(v.start or ()), True] for v in group] for group in (values, parameters)
    )
    return first, second


def _unknowns(description: Description) -> list[Variable]:
    found = [
        description.referred(unknown.reference)
        for name in ("outputs", "derivatives")
        for unknown in description.structure[name]
    ]
    return [variable for variable in found if variable is not None and variable.type != "Clock"][:_UNKNOWNS]


def _left_out(description: Description) -> list[list[Any]]:
    """Return unknowns, each with its value reference and names and references of the knowns that it leaves out."""
    rows: list[list[Any]] = []
    knowns = smooth_knowns(description)
    for unknown, variable in smooth_unknowns(description):
        if unknown.dependencies is None or len(rows) >= _LEFT_OUT:
            continue
        # In FMI 2 a known has several names; an output that is a state has itself.
        listed = [description.referred(number) for number in unknown.dependencies]
        same = {variable.reference, *(v.reference for v in listed if v is not None and is_smooth_scalar(v))}
        others = {v.reference: v.name for v in knowns.values() if v.reference not in same}
        if others:
            pairs = [[name, reference] for reference, name in others.items()]
            rows.append([variable.name, variable.reference, pairs[:_SEEDED]])
    return rows

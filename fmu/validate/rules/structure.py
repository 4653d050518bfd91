"""Rules for the model structure: what is listed, and what it depends on."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.standard.value_types import FLOATS
from fmu.validate.findings import Finding, error, quoted, warning
from fmu.validate.reading.description import Description, Unknown, Variable

STRUCTURE = "FMI 2.0.4 section 2.2.8; FMI 3.0.2 section 2.4.8"
_TITLES = {
    "outputs": "Outputs",
    "derivatives": "state derivatives",
    "initial": "InitialUnknowns",
    "clocked": "clocked states",
    "indicators": "event indicators",
}


def structure_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the model structure."""
    for name, unknowns in description.structure.items():
        seen: set[int] = set()
        for unknown in unknowns:
            variable = description.referred(unknown.reference)
            if variable is None:
                yield error(
                    "structure.reference",
                    f"The {_TITLES[name]} list {unknown.reference} (line {unknown.line}), which is no variable.",
                    STRUCTURE,
                )
                continue
            if unknown.reference in seen:
                yield error(
                    "structure.twice",
                    f"The {_TITLES[name]} list {quoted(variable.name)} twice (line {unknown.line}).",
                    STRUCTURE,
                )
            seen.add(unknown.reference)
            yield from _dependencies(description, name, unknown, variable)
            yield from _entry(description, name, unknown, variable)
    yield from _completeness(description)


def _dependencies(description: Description, name: str, unknown: Unknown, variable: Variable) -> Iterator[Finding]:
    where = f"{quoted(variable.name)} in the {_TITLES[name]} (line {unknown.line})"
    known = unknown.dependencies or ()
    if len(set(known)) != len(known):
        yield error("structure.dependency", f"The dependencies of {where} name a variable twice.", STRUCTURE)
    for reference in known:
        source = description.referred(reference)
        if source is None:
            yield error(
                "structure.dependency",
                f"The dependencies of {where} name {reference}, which is no variable.",
                STRUCTURE,
            )
        elif not _is_known(description, name, source):
            # Without state derivatives, as co-simulation may be, it may be a state that is not listed.
            hidden = not description.structure["derivatives"] and source.variability == "continuous"
            yield (warning if hidden and "ModelExchange" not in description.interfaces else error)(
                "structure.dependency",
                f"The dependencies of {where} name {quoted(source.name)}, a {source.variability} "
                f"{source.causality} variable, "
                "which is not among the knowns: name the inputs, states and parameters it depends on.",
                STRUCTURE,
            )
    if unknown.kinds is not None and name == "initial" and not set(unknown.kinds) <= {"dependent", "constant"}:
        yield error(
            "structure.kind",
            f"The dependencies of {where} are of kind {', '.join(sorted(set(unknown.kinds)))}; in the "
            "initialisation only "
            "'dependent' and 'constant' are allowed.",
            STRUCTURE,
        )


def _is_known(description: Description, name: str, source: Variable) -> bool:
    if source.causality in ("input", "independent", "parameter", "structuralParameter"):
        return True
    if source.variability == "constant" or source.causality == "calculatedParameter":
        return False
    if name == "initial":
        return source.initial == "exact" or source.variability == "discrete"
    # Continuous states, and the discrete ones, which no attribute tells apart from other discrete variables.
    return source.variability == "discrete" or source.name in _states(description)


def _states(description: Description) -> set[str]:
    if "_states" not in description.__dict__:
        names: set[str] = set()
        for unknown in description.structure["derivatives"]:
            derivative = description.referred(unknown.reference)
            if derivative is not None and derivative.derivative is not None:
                state = description.referred(derivative.derivative)
                names |= {state.name} if state is not None else set()
                if state is not None and description.major == 2:
                    names |= {
                        v.name for v in description.variables if (v.type, v.reference) == (state.type, state.reference)
                    }
        object.__setattr__(description, "_states", names)
    found: set[str] = description.__dict__["_states"]
    return found


def _entry(description: Description, name: str, unknown: Unknown, variable: Variable) -> Iterator[Finding]:
    where = f"{quoted(variable.name)} (line {unknown.line})"
    if name == "outputs" and variable.causality != "output":
        yield error(
            "structure.output", f"The Outputs list {where}, which is a {variable.causality} variable.", STRUCTURE
        )
    elif name in ("derivatives", "indicators") and (
        variable.type not in FLOATS or variable.variability != "continuous"
    ):
        yield error(
            "structure.continuous",
            f"The {_TITLES[name]} list {where}, which is {variable.variability} {variable.type}: it must be a "
            "continuous float.",
            STRUCTURE,
        )
    elif name == "derivatives" and variable.derivative is None:
        yield error(
            "structure.derivative",
            f"The state derivatives list {where}, which names no state by 'derivative'.",
            STRUCTURE,
        )
    elif name == "clocked" and (variable.previous is None or not variable.clocks or variable.type == "Clock"):
        yield error(
            "structure.clocked", f"The clocked states list {where}, which lacks 'previous' or 'clocks'.", STRUCTURE
        )


def _completeness(description: Description) -> Iterator[Finding]:
    listed = {unknown.reference for unknown in description.structure["outputs"]}
    for position, variable in enumerate(description.variables, 1):
        reference = position if description.major == 2 else variable.reference
        if variable.causality == "output" and reference not in listed:
            yield error(
                "structure.output", f"The output {quoted(variable.name)} is not listed in the Outputs.", STRUCTURE
            )
    if "ModelExchange" not in description.interfaces:
        return
    listed = {unknown.reference for unknown in description.structure["derivatives"]}
    for position, variable in enumerate(description.variables, 1):
        reference = position if description.major == 2 else variable.reference
        if variable.derivative is not None and variable.variability == "continuous" and reference not in listed:
            yield warning(
                "structure.derivative",
                f"The variable {quoted(variable.name)} is a derivative but not listed: importers take its "
                "state for no state.",
                STRUCTURE,
            )

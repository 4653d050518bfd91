"""Rules for the variables of a description that a schema cannot hold."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from fmu.standard.value_types import FLOATS, INTEGERS
from fmu.validate.findings import Finding, error, quoted, warning
from fmu.validate.reading.description import Description, Variable

ATTRIBUTES = "FMI 2.0.4 section 2.2.7; FMI 3.0.2 section 2.4.7"
NAMES = "FMI 2.0.4 section 2.2.9; FMI 3.0.2 section 2.4.7.5.1"

# Linear-time forms of the standard's grammar; possessive matching is not needed since the parts exclude each other.
_PLAIN = r"[A-Za-z_][A-Za-z0-9_]*"
_QUOTED = r"'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ \"]|\\['\"?\\abfnrtv])+'"
_PART = rf"(?:{_PLAIN}|{_QUOTED})(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
STRUCTURED = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)")


def variable_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the variables."""
    yield from _names(description)
    for variable in description.variables:
        yield from _start(description, variable)
        yield from _bounds(description, variable)
        yield from _references(description, variable)
        yield from _dimensions(description, variable)
    yield from (_alias_sets(description) if description.major == 2 else _independent(description))


def _names(description: Description) -> Iterator[Finding]:
    taken: set[str] = set()
    for variable in description.variables:
        for name in (variable.name, *variable.aliases):
            shown = quoted(name)
            if name in taken:
                yield error(
                    "variable.name", f"The name {shown} is taken twice (line {variable.line}): rename one.", NAMES
                )
            taken.add(name)
            if description.naming == "structured" and not STRUCTURED.fullmatch(name):
                yield error(
                    "variable.name",
                    f"The name {shown} (line {variable.line}) does not follow the naming convention 'structured': "
                    "quote its parts by ', or declare the convention 'flat'.",
                    NAMES,
                )
            elif not name or any(c in "\r\n\t" for c in name):
                yield error(
                    "variable.name",
                    f"The name {shown} (line {variable.line}) is empty or holds a line break or tab.",
                    NAMES,
                )


def _start(description: Description, variable: Variable) -> Iterator[Finding]:
    shown = f"{quoted(variable.name)} (line {variable.line})"
    if variable.start is None:
        if variable.causality == "structuralParameter":
            yield error(
                "variable.start", f"The structural parameter {shown} has no start value, which it needs.", ATTRIBUTES
            )
        return
    if variable.causality == "independent" or (variable.initial == "calculated" and variable.type != "Clock"):
        yield error(
            "variable.start", f"The variable {shown} is calculated or independent: remove its start value.", ATTRIBUTES
        )
    size = description.size(variable)
    if size is not None and len(variable.start) not in (1, size):
        yield error(
            "variable.start",
            f"The array {shown} has {size} elements but {len(variable.start)} start values: give {size}.",
            ATTRIBUTES,
        )
    numbers = _numbers(variable, variable.start)
    if numbers is None:
        yield error("variable.start", f"The start value of {shown} is no {variable.type}: correct it.", ATTRIBUTES)
    elif any(math.isnan(number) for number in numbers):
        yield warning("variable.start", f"The start value of {shown} is NaN: give a number.", ATTRIBUTES)
    if variable.type == "Enumeration" and numbers:
        allowed = description.items.get(variable.attributes.get("declaredType", ""))
        if allowed and any(number not in allowed for number in numbers):
            yield error(
                "variable.start",
                f"The start value {variable.start[0]} of {shown} is no item of its type; it has {allowed}.",
                ATTRIBUTES,
            )


def _numbers(variable: Variable, texts: tuple[str, ...]) -> list[float] | None:
    if variable.type not in (*FLOATS, *INTEGERS):
        return []
    try:
        return [float(text) for text in texts]
    except ValueError:
        return None


def _bounds(description: Description, variable: Variable) -> Iterator[Finding]:
    if variable.type not in (*FLOATS, *INTEGERS):
        return
    shown = f"{quoted(variable.name)} (line {variable.line})"
    low, high, nominal = (_number(description.attribute(variable, name)) for name in ("min", "max", "nominal"))
    if low is not None and high is not None and low > high:
        yield error(
            "variable.bounds", f"The variable {shown} has min {low:g} above max {high:g}: exchange them.", ATTRIBUTES
        )
    elif variable.start is not None:
        for number in _numbers(variable, variable.start) or []:
            if (low is not None and number < low) or (high is not None and number > high):
                yield error(
                    "variable.bounds",
                    f"The start value {number:g} of {shown} is outside [{low}, {high}]: min <= start <= max must hold.",
                    ATTRIBUTES,
                )
                break
    if nominal is not None and not nominal > 0.0:
        yield error(
            "variable.nominal", f"The nominal value {nominal:g} of {shown} is not positive: give its size.", ATTRIBUTES
        )


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def _references(description: Description, variable: Variable) -> Iterator[Finding]:
    shown = f"{quoted(variable.name)} (line {variable.line})"
    declared = variable.attributes.get("declaredType")
    if declared is not None:
        found = description.types.get(declared)
        if found is None:
            yield error(
                "variable.type",
                f"The variable {shown} has the type {quoted(declared)}, which is not defined.",
                ATTRIBUTES,
            )
        elif found[0] != variable.type:
            yield error(
                "variable.type",
                f"The variable {shown} is {variable.type}, its type {quoted(declared)} is {found[0]}.",
                ATTRIBUTES,
            )
    if variable.derivative is not None:
        state = description.referred(variable.derivative)
        if state is None:
            yield error(
                "variable.derivative",
                f"The variable {shown} is the derivative of {variable.derivative}, which is nothing.",
                ATTRIBUTES,
            )
        elif state is variable:
            yield error("variable.derivative", f"The variable {shown} is the derivative of itself.", ATTRIBUTES)
        elif state.type not in FLOATS or state.variability != "continuous" or variable.variability != "continuous":
            yield error(
                "variable.derivative",
                f"The variable {shown} is the derivative of {quoted(state.name)}: both must be continuous "
                f"floating point numbers (they are {variable.variability} {variable.type}, {state.variability} "
                f"{state.type}).",
                ATTRIBUTES,
            )
        elif description.size(state) != description.size(variable):
            yield error(
                "variable.derivative",
                f"The variable {shown} and its state {quoted(state.name)} differ in size.",
                ATTRIBUTES,
            )
    if variable.attributes.get("reinit") in ("true", "1") and variable.variability != "continuous":
        yield error(
            "variable.reinit", f"The variable {shown} has reinit but is {variable.variability}, no state.", ATTRIBUTES
        )


def _dimensions(description: Description, variable: Variable) -> Iterator[Finding]:
    shown = f"{quoted(variable.name)} (line {variable.line})"
    if variable.dimensions and variable.causality == "structuralParameter":
        yield error("variable.dimension", f"The structural parameter {shown} must be a scalar.", ATTRIBUTES)
    for kind, number in variable.dimensions:
        if kind == "start":
            if number == 0:
                yield error(
                    "variable.dimension",
                    f"The array {shown} has a dimension of 0; at the start each is positive.",
                    ATTRIBUTES,
                )
            continue
        length = description.by_reference.get(number)
        if length is None:
            yield error(
                "variable.dimension", f"A dimension of {shown} refers to {number}, which is no variable.", ATTRIBUTES
            )
        elif length.type != "UInt64" or (
            length.causality != "structuralParameter" and length.variability != "constant"
        ):
            yield error(
                "variable.dimension",
                f"A dimension of {shown} refers to {quoted(length.name)}, which is a {length.causality} of "
                f"type {length.type}: "
                "it must be a UInt64 and a structural parameter or constant.",
                ATTRIBUTES,
            )
        elif length.start and length.start[0].strip("+0") == "":
            yield error(
                "variable.dimension",
                f"The length {quoted(length.name)} of {shown} starts at 0; it must be positive.",
                ATTRIBUTES,
            )


def _alias_sets(description: Description) -> Iterator[Finding]:
    # FMI 2: variables of one base type with one value reference are one value under several names.
    sets: dict[tuple[str, int], list[Variable]] = {}
    for variable in description.variables:
        base = "Integer" if variable.type == "Enumeration" else variable.type
        sets.setdefault((base, variable.reference), []).append(variable)
    for (_, reference), aliases in sets.items():
        if len(aliases) < 2:
            continue
        names = ", ".join(quoted(alias.name, 40) for alias in aliases[:4])
        units = {description.attribute(alias, "unit") for alias in aliases}
        settable = [a for a in aliases if a.start is not None and a.variability != "constant"]
        if len({_canonical(a) for a in settable}) > 1:
            yield error(
                "variable.alias",
                f"The aliases {names} (value reference {reference}) start at different values.",
                ATTRIBUTES,
            )
        if len(units) > 1:
            yield error(
                "variable.alias", f"The aliases {names} (value reference {reference}) differ in unit.", ATTRIBUTES
            )
        if len({alias.variability == "constant" for alias in aliases}) > 1:
            yield error(
                "variable.alias",
                f"The aliases {names} (value reference {reference}) are partly constant: all or none.",
                ATTRIBUTES,
            )
        if sum(a.causality in ("input", "parameter", "independent") for a in aliases) > 1:
            yield error(
                "variable.alias",
                f"The aliases {names} (value reference {reference}) hold more than one input or parameter: one "
                "value cannot "
                "be set from two sides.",
                ATTRIBUTES,
            )


def _canonical(variable: Variable) -> object:
    numbers = _numbers(variable, variable.start or ())
    return tuple(numbers) if numbers else variable.start


def _independent(description: Description) -> Iterator[Finding]:
    for variable in description.variables:
        if variable.causality == "independent" and variable.type not in FLOATS:
            yield error(
                "variable.independent",
                f"The independent variable {quoted(variable.name)} is {variable.type}, no float.",
                ATTRIBUTES,
            )

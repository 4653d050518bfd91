"""Rules for the conversions of units, and for the units of derivatives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from fmu.validate.findings import Finding, error, quoted, warning
from fmu.validate.reading.description import Description

UNITS = "FMI 2.0.4 section 2.2.2; FMI 3.0.2 section 2.4.3"


def unit_findings(description: Description) -> Iterator[Finding]:
    """Yield what makes a unit impossible to convert."""
    for unit in description.units:
        yield from _conversion(f"The BaseUnit of the unit {quoted(unit.name)} (line {unit.line})", unit.base)
        for display in unit.displays:
            name = quoted(display.get("name", ""))
            yield from _conversion(
                f"The DisplayUnit {name} of the unit {quoted(unit.name)} (line {unit.line})", display
            )
    yield from _derivatives(description)


def _derivatives(description: Description) -> Iterator[Finding]:
    bases = {unit.name: _exponents(unit.base) for unit in description.units}
    for variable in description.variables:
        state = None if variable.derivative is None else description.referred(variable.derivative)
        if state is None:
            continue
        names = [description.attribute(v, "unit") or "" for v in (state, variable)]
        whole, rate = (bases.get(name) for name in names)
        # Units without a base are not known to be pure numbers.
        if whole and rate and {**whole, "s": whole.get("s", 0) - 1} != {"s": 0, **rate}:
            yield warning(
                "unit.derivative",
                f"The variable {quoted(variable.name)} (line {variable.line}) in {quoted(names[1])} is the derivative "
                f"of {quoted(state.name)} in {quoted(names[0])}, by which the units contradict each other: correct a "
                "unit or the attribute 'derivative'.",
                UNITS,
            )


def _exponents(base: Mapping[str, str]) -> dict[str, int]:
    """Return the exponents that are not zero; angles count as numbers, for tools differ on them."""
    given = {name: int(text) for name, text in base.items() if name not in ("factor", "offset", "rad")}
    return {name: exponent for name, exponent in given.items() if exponent}


def _conversion(where: str, attributes: Mapping[str, str]) -> Iterator[Finding]:
    factor, offset = (float(attributes.get(name, usual)) for name, usual in (("factor", "1"), ("offset", "0")))
    if not math.isfinite(factor) or factor == 0.0:
        yield error(
            "unit.factor",
            f"{where} has the factor {factor:g}; to convert there and back it must be finite and not 0.",
            UNITS,
        )
    if not math.isfinite(offset):
        yield error(
            "unit.offset", f"{where} has the offset {offset:g}; to convert there and back it must be finite.", UNITS
        )

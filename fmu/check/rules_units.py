"""Rules for the conversions of units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from fmu.check.description import Description
from fmu.check.findings import Finding, error, quoted

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

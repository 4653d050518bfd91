"""Two runs held against each other: values at the start, outputs at each point, and where they end."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from typing import Any

from fmu.validate.child.calls import Variable
from fmu.validate.child.run import OUTPUTS, Bits

Whole = tuple[list[bytes], list[Bits], bool]
"""Values at the start, outputs at each point, and whether the FMU has ended the run."""
TOLERANCE = 1e-3
"""Difference of two numbers, of their size in the run, up to which a solver may have taken other steps."""
_FORMS = {"Real": "d", "Float64": "d", "Float32": "f"}


def compare(fmu: Any, rule: str, when: str, expected: Whole, found: Whole) -> None:
    """Report the first difference; a small one as a warning, for users of the state hardly meet it."""
    # The importer holds the time, and gives it.
    readable = [variable for variable in fmu.variables if variable.readable]
    rows = [
        (v, *pair) for v, *pair in zip(readable, expected[0], found[0], strict=True) if v.causality != "independent"
    ]
    if _tell(fmu, rule, f"{when} than at first", rows):
        return
    outputs = [variable for variable in readable if variable.causality == "output"][:OUTPUTS]
    largest = [max((_largest(v, bits[k]) for _, bits in expected[1]), default=0.0) for k, v in enumerate(outputs)]
    for (t, first), (other_t, second) in zip(expected[1], found[1], strict=False):
        if t != other_t:
            text = f"The run {when} is at t = {other_t!r} where the first one was at t = {t!r}: they must be equal."
            fmu.recorder.find("error", rule, text)
            return
        if _tell(
            fmu,
            rule,
            f"{when} than at first, from t = {t!r} on",
            list(zip(outputs, first, second, strict=True)),
            largest,
        ):
            return
    if len(expected[1]) != len(found[1]):
        one, other = (f"at t = {points[-1][0]!r}" if points else "at its start" for points in (expected[1], found[1]))
        text = f"The run {when} ends {other}, the first one {one}: they must be equal."
        fmu.recorder.find("error", rule, text)


def _tell(
    fmu: Any, rule: str, when: str, rows: Sequence[tuple[Variable, bytes, bytes]], largest: Sequence[float] = ()
) -> bool:
    """Report the largest difference of some variables, of sizes that may be known; tell whether there is one."""
    scales = largest or [0.0] * len(rows)
    sizes = [
        (_size(variable, one, other, scale), variable, one, other)
        for (variable, one, other), scale in zip(rows, scales, strict=True)
        if one != other
    ]
    if not sizes:
        return False
    size, variable, one, other = max(sizes, key=lambda row: row[0])
    values = "" if (shown := _shown(variable, one, other)) is None else f": {shown[1]!r}, not {shown[0]!r}"
    judged, remark = (
        ("warning", " They differ by no more than a solver's tolerance.") if size <= TOLERANCE else ("error", "")
    )
    text = f"The variable {variable.name!r} has another value {when}{values}.{remark}"
    fmu.recorder.find(judged, rule, text)
    return True


def _numbers(variable: Variable, one: bytes, other: bytes) -> Iterator[tuple[float, float]]:
    form = _FORMS[variable.type]
    yield from zip(
        *(struct.unpack(f"={len(bits) // struct.calcsize(form)}{form}", bits) for bits in (one, other)), strict=True
    )


def _largest(variable: Variable, bits: bytes) -> float:
    if variable.type not in _FORMS:
        return 0.0
    return max((abs(number) for number, _ in _numbers(variable, bits, bits) if math.isfinite(number)), default=0.0)


def _size(variable: Variable, one: bytes, other: bytes, scale: float) -> float:
    """Return the largest relative difference of numbers; infinity where they are none."""
    if variable.type not in _FORMS:
        return math.inf
    sizes = [
        abs(a - b) / max(abs(a), abs(b), scale) if math.isfinite(a) and math.isfinite(b) else math.inf
        for a, b in _numbers(variable, one, other)
        if a != b and not (math.isnan(a) and math.isnan(b))
    ]
    return max(sizes, default=0.0)


def _shown(variable: Variable, one: bytes, other: bytes) -> tuple[float, float] | None:
    if variable.type not in _FORMS:
        return None
    return next((pair for pair in _numbers(variable, one, other) if pair[0] != pair[1]), None)

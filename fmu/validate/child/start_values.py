"""Start values: where nothing has been set, the binary holds what the description says."""

from __future__ import annotations

import math
from typing import Any

from fmu.standard.value_types import start_value
from fmu.validate.child.calls import Recorder, Refused, Variable
from fmu.validate.child.interface_types import instantiate

STARTS = "FMI 2.0.4 section 2.2.7; FMI 3.0.2 section 2.4.7: attributes initial and start"
_DIGITS = {"Float32": 1e-6}
"""Relative difference that the writing of a number may make; 1e-12 for a double."""


def start_values(fmu: Any, recorder: Recorder) -> None:
    """States and discrete variables are compared in Initialization Mode, parameters and constants thereafter.

    Not each FMU gives all variables there: what is refused is not compared.
    """
    fmu.lenient = True
    instantiate(fmu, recorder)
    fmu.enter_initialization()
    try:
        _compare_all(fmu, recorder, fmu.plan["exact"])
    except Refused:
        if fmu.plan["once"]:
            raise
        fmu.free()
        instantiate(fmu, recorder)
        fmu.enter_initialization()
    fmu.do("ExitInitializationMode")
    _compare_all(fmu, recorder, fmu.plan["exact_parameters"])
    fmu.free()


def _compare_all(fmu: Any, recorder: Recorder, entries: list[list[Any]]) -> None:
    for entry in entries:
        variable = Variable(*entry)
        expected = [start_value(variable.type, text) for text in variable.start or ()]
        found = fmu.get(variable)[0]
        expected = expected * len(found) if len(expected) == 1 else expected
        for position, (value, other) in enumerate(zip(expected, found, strict=False), 1):
            if not _equal(variable.type, value, other):
                where = f"{variable.name!r}" if len(found) == 1 else f"{variable.name!r}, element {position},"
                recorder.find(
                    "error",
                    "run.start",
                    f"The start value of {where} is {value!r} in the description, but the binary holds "
                    f"{bool(other) if variable.type == 'Boolean' else other!r} before anything is set: "
                    "importers need not set start values, so correct the one that is wrong.",
                    STARTS,
                )
                break


def _equal(kind: str, expected: Any, found: Any) -> bool:
    if isinstance(expected, float):
        return math.isnan(expected) or math.isclose(expected, found, rel_tol=_DIGITS.get(kind, 1e-12))
    return bool(expected == (bool(found) if kind == "Boolean" else found))

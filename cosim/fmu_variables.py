"""The variables of an FMU's description as scalars under names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cosim.slave import Port

INTEGERS = {
    "Integer",
    "Boolean",
    "Enumeration",
    *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)),
}
"""Types of fmpy that hold whole numbers."""

NUMBERS = {"Real", "Float32", "Float64", *INTEGERS}
"""Types of fmpy that hold numbers."""


def elements(variable: Any) -> Iterator[tuple[str, tuple[str, int]]]:
    """Yield the scalars of a variable, counted from 1 row by row, with the place of each."""
    if not variable.dimensions:
        yield variable.name, (variable.name, 0)
        return
    for index, place in enumerate(np.ndindex(*variable.shape)):
        yield f"{variable.name}[{','.join(str(i + 1) for i in place)}]", (variable.name, index)


def size(variable: Any) -> int:
    """Return the number of elements."""
    return int(np.prod(variable.shape)) if variable.dimensions else 1


def ports(variable: Any) -> list[Port]:
    """Return the scalars as inputs or outputs of a slave."""
    # FMI has no integer and no Boolean that changes along flows.
    discrete = variable.variability == "discrete" or variable.type in INTEGERS
    return [Port(name, variable.unit or "", discrete) for name, _ in elements(variable)]

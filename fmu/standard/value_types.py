"""Types of values in FMI 2.0 and 3.0: what each holds, what it is in C, and what its functions are called."""

from __future__ import annotations

import ctypes as c
from typing import Any

FLOATS = {"Real": 1.7976931348623157e308, "Float64": 1.7976931348623157e308, "Float32": 3.4028234663852886e38}
"""Types that hold numbers with a fraction, and the largest number of each."""
BITS = {"Integer": 32, **{f"Int{bits}": bits for bits in (8, 16, 32, 64)}}
"""Types that hold whole numbers with a sign, and the bits of each."""
UNSIGNED_BITS = {f"UInt{bits}": bits for bits in (8, 16, 32, 64)}
"""Types that hold whole numbers without a sign, and the bits of each."""
INTEGERS = {*BITS, *UNSIGNED_BITS, "Enumeration"}
DISCRETE = {*INTEGERS, "Boolean", "String", "Binary"}
"""Types whose values change at events alone."""
TYPES = {*FLOATS, *DISCRETE}
"""All types but clocks."""
C_TYPES: dict[int, dict[str, Any]] = {
    2: {"Real": c.c_double, "Integer": c.c_int, "Enumeration": c.c_int, "Boolean": c.c_int, "String": c.c_char_p},
    3: {
        "Float64": c.c_double,
        "Float32": c.c_float,
        **{
            f"{sign}Int{bits}": getattr(c, f"c_{sign.lower()}int{bits}") for sign in ("", "U") for bits in BITS.values()
        },
        "Enumeration": c.c_int64,
        "Boolean": c.c_bool,
        "String": c.c_char_p,
        "Clock": c.c_bool,
    },
}
"""Of one value in C, by version of the standard."""


def accessor(kind: str, major: int) -> str:
    """Return the type in the names of the functions that get and set a variable."""
    whole = "Integer" if major == 2 else "Int64"
    return whole if kind == "Enumeration" else kind


def limits(kind: str) -> tuple[int, int]:
    """Return the smallest and the largest number that a type of whole numbers holds."""
    if kind in UNSIGNED_BITS:
        return 0, 2 ** UNSIGNED_BITS[kind] - 1
    half = 2 ** (BITS[kind] - 1)
    return -half, half - 1


def start_value(kind: str, text: str) -> Any:
    """Return the value, of any type but Binary, that an attribute ``start`` says."""
    if kind == "String":
        return text.encode()
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind in FLOATS else int(text)

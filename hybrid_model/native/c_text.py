"""Pieces of C99 text: literals, tables, and the functions that CasADi generates."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import casadi as ca

_OPTIONS: dict[str, Any] = {
    "with_header": False,
    "with_export": True,
    "cpp": False,
    "main": False,
    "mex": False,
    "verbose": False,
    "casadi_real": "double",
    "casadi_int": "long long int",
}

_SCALARS = ("double", "bool", "size_t", "uint32_t", "uint64_t", "ModelFunction")


def functions(name: str, given: Iterable[ca.Function]) -> str:
    """Return definitions of traced functions.

    Parameters
    ----------
    name : str
        Of the whole; a prefix of what the functions share.
    given : iterable of casadi.Function
        With names of their own.
    """
    generator = ca.CodeGenerator(name, _OPTIONS)
    for function in given:
        generator.add(function)
    # A dozen functions that describe it come with each map; unused ones that nobody else may call are not compiled.
    return f"#define CASADI_SYMBOL_EXPORT static\n{generator.dump()}"


def string(text: str) -> str:
    """Return `text` as a C string literal of plain ASCII, whatever it contains."""
    octets = "".join(
        chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}" for byte in text.encode("utf-8")
    )
    return f'"{octets}"'


def constant(value: float) -> str:
    """Return a constant expression for any double, bit for bit; needs math.h."""
    if math.isnan(value):
        return "NAN"
    return float(value).hex() if math.isfinite(value) else ("INFINITY" if value > 0 else "-INFINITY")


def boolean(value: bool) -> str:
    """Return a literal of stdbool.h."""
    return "true" if value else "false"


def row(*entries: object) -> str:
    """Return an initialiser of a struct."""
    return f"{{{', '.join(map(str, entries))}}}"


def definition(kind: str, name: str, fields: Mapping[str, object]) -> str:
    """Return the definition of a constant struct that other files see."""
    return f"const {kind} {name} = {{\n" + "".join(f"    .{key} = {value},\n" for key, value in fields.items()) + "};\n"


def array(kind: str, name: str, items: Iterable[str]) -> str:
    """Return the definition of a table.

    C has no empty arrays: a table without entries gets one of zeros, which is never read.

    Parameters
    ----------
    kind : str
        Type of the entries.
    name : str
        Of the table.
    items : iterable of str
        Initialisers of its entries.
    """
    entries = list(items) or ["0" if kind in _SCALARS else "{0}"]
    return f"static const {kind} {name}[] = {{\n    " + ",\n    ".join(entries) + "\n};\n"

"""Pieces of C99 text: literals, tables, and the functions that CasADi generates."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import casadi as ca

from hybrid_model.native.rolled_loops import rolled

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
_BODY = re.compile(r"(static int casadi_f\d+\([^)]*\) \{\n)(.*?)(  return 0;\n\}\n)", re.DOTALL)


class Definitions(NamedTuple):
    """Definitions of functions in C, and the sizes of the work arrays arg, res, iw and w that they need."""

    text: str
    work: tuple[int, int, int, int]


def functions(name: str, given: Iterable[ca.Function]) -> Definitions:
    """Return definitions of traced functions; what repeats itself often in them is in loops.

    Parameters
    ----------
    name : str
        Of the whole; a prefix of what the functions share.
    given : iterable of casadi.Function
        With names of their own.
    """
    generator, given = ca.CodeGenerator(name, _OPTIONS), list(given)
    for function in given:
        generator.add(function)
    doubles = [function.sz_w() for function in given]

    def with_loops(found: re.Match[str]) -> str:
        body = rolled(found[2])
        if body is None:
            return found[0]
        doubles.append(body.work)
        return f"{found[1]}{body.text}{found[3]}"

    text = _BODY.sub(with_loops, generator.dump())
    arguments, results, integers = (
        max((int(getattr(function, size)()) for function in given), default=0) for size in ("sz_arg", "sz_res", "sz_iw")
    )
    # A dozen functions that describe it come with each map; unused ones that nobody else may call are not compiled.
    return Definitions(
        f"#define CASADI_SYMBOL_EXPORT static\n{text}", (arguments, results, integers, max(doubles, default=0))
    )


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

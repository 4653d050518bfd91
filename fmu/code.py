"""Generate model.c: the traced functions and the tables that the engine reads (fmu/runtime/model.h)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from fmu.derivatives import derivative_functions
from fmu.names import NameTable
from fmu.network import NetworkTrace
from fmu.trace import Trace
from fmu.variables import FmuVariable
from hybrid_model.layout import Layout
from hybrid_model.transitions import Priority, Trigger
from hybrid_model.variables import Kind

_OPTIONS: dict[str, Any] = {
    "with_header": False,
    "with_export": False,
    "cpp": False,
    "main": False,
    "mex": False,
    "verbose": False,
    "casadi_real": "double",
    "casadi_int": "long long int",
}


def model_code(
    traced: Trace | NetworkTrace, variables: Sequence[FmuVariable], token: str, kinds: Collection[str]
) -> str:
    """Return the C source of a model.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton's maps.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    kinds : collection of str
        ``"cs"``, ``"me"``: what the FMU offers.

    Returns
    -------
    str
        A C99 translation unit that defines ``const Model model``.
    """
    maps, work = _maps(traced)
    tables = [*_tables(traced, variables), _model(traced, variables, token, kinds, work)]
    return "\n".join([_PRELUDE, maps, *tables])


def _maps(traced: Trace | NetworkTrace) -> tuple[str, Sequence[int]]:
    """Return the definitions of the maps and of their derivatives, and the sizes of the work arrays they need."""
    if isinstance(traced, NetworkTrace):
        return traced.c_code(), traced.work_sizes
    functions = [*traced.functions, *derivative_functions(traced).values()]
    generator = ca.CodeGenerator("model", _OPTIONS)
    for function in functions:
        generator.add(function)
    resets = _array("ModelFunction ", "resets", (reset.name() for reset in traced.resets))
    code = "\n".join([generator.dump(), '#include "model.h"', "", resets, _RESET])
    return code, [max(getattr(f, size)() for f in functions) for size in ("sz_arg", "sz_res", "sz_iw", "sz_w")]


_MAPS = (
    *("start", "flow", "flow_set", "margins", "times", "outputs", "reset"),
    *("forward", "reverse", "start_forward", "start_reverse"),
)
_PRELUDE = """\
/* Generated from an automaton.  Its names stay inside, and its maps need not use all that they are given. */
#include <math.h>
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
"""
_RESET = """\
static int hybrid_reset(size_t jump, const double **arg, double **res, long long *iw, double *w)
{
    return resets[jump](arg, res, iw, w, 0);
}
"""


def string(text: str) -> str:
    """Return `text` as a C string literal of plain ASCII, whatever it contains."""
    octets = "".join(
        chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}" for byte in text.encode("utf-8")
    )
    return f'"{octets}"'


def _number(value: float) -> str:
    return float(value).hex() if np.isfinite(value) else str(value)


def _array(kind: str, name: str, items: Iterable[str]) -> str:
    # C has no empty arrays: a table without entries gets one that is never read.
    entries = list(items) or ["{0}" if kind in ("ModelJump ", "ModelVariable ", "ModelName ") else "0"]
    return f"static const {kind}{name}[] = {{\n    " + ",\n    ".join(entries) + "\n};\n"


def _tables(traced: Trace | NetworkTrace, variables: Sequence[FmuVariable]) -> list[str]:
    automaton, layout, names = traced.automaton, traced.layout, NameTable()
    starts = [("x", Kind.STATE), ("z", Kind.DISCRETE), ("u", Kind.INPUT), ("p", Kind.PARAMETER)]
    margin_names = [info.name for info in automaton.jumps if info.trigger is Trigger.STATE]
    tables = [
        *(_array("double ", f"start_{name}", map(_number, layout.start(kind))) for name, kind in starts),
        _array("double ", "nominals", map(_number, _nominals(layout))),
        _array("ModelName ", "state_names", map(names.entry, layout.names(Kind.STATE))),
        _array("ModelName ", "discrete_names", map(names.entry, layout.names(Kind.DISCRETE))),
        _array("ModelName ", "margin_names", map(names.entry, margin_names)),
        _array("ModelJump ", "jumps", _jumps(traced, names)),
        _array("size_t ", "clock_jump", (str(clock.jump) for clock in automaton.clocks)),
        _array("ModelVariable ", "variables", (_variable(variable, names) for variable in variables)),
    ]
    return [*tables, names.definition("names")]


def _nominals(layout: Layout) -> list[float]:
    """Return a usual size of each continuous state, 1 where none is declared."""
    variables = [place.variable for place in layout.places[Kind.STATE]]
    return [1.0 if v.nominal is None else v.nominal for v in variables for _ in range(v.size)]


def _jumps(traced: Trace | NetworkTrace, names: NameTable) -> list[str]:
    rows = []
    counts = {Trigger.STATE: 0, Trigger.TIME: 0}
    for info in traced.automaton.jumps:
        kind = "JUMP_ON_STATE" if info.trigger is Trigger.STATE else "JUMP_ON_TIME"
        rows.append(f"{{{names.entry(info.name)}, {kind}, {counts[info.trigger]}, {_bool(info.internal)}}}")
        counts[info.trigger] += 1
    return rows


def _variable(variable: FmuVariable, names: NameTable) -> str:
    flags = f"{_bool(variable.discrete)}, {_bool(variable.calculated)}"
    place = f"{names.entry(variable.name)}, {variable.index}, {variable.size}"
    return f"{{{place}, {variable.type.value}, {variable.bank.value}, {flags}}}"


def _model(
    traced: Trace | NetworkTrace,
    variables: Sequence[FmuVariable],
    token: str,
    kinds: Collection[str],
    work: Sequence[int],
) -> str:
    automaton, sizes = traced.automaton, traced.layout.sizes
    fields = {
        "name": string(automaton.name),
        "token": string(token),
        "co_simulation": _bool("cs" in kinds),
        "model_exchange": _bool("me" in kinds),
        "n_states": sizes[Kind.STATE],
        "n_discrete": sizes[Kind.DISCRETE],
        "n_inputs": sizes[Kind.INPUT],
        "n_parameters": sizes[Kind.PARAMETER],
        "n_outputs": sizes[Kind.OUTPUT],
        "n_margins": sum(info.trigger is Trigger.STATE for info in automaton.jumps),
        "n_times": sum(info.trigger is Trigger.TIME for info in automaton.jumps),
        "n_jumps": len(automaton.jumps),
        "n_clocks": len(automaton.clocks),
        "n_variables": len(variables),
        **dict(zip(("n_arg", "n_res", "n_iw", "n_w"), work, strict=True)),
        "flow_priority": _bool(automaton.priority is Priority.FLOW),
        "has_flow_set": _bool(automaton.has_flow_set),
        "predictable": _bool(all(place.variable.discrete for place in traced.layout.places[Kind.INPUT])),
        **{name: f"start_{name}" for name in ("x", "z", "u", "p")},
        **{name: f"hybrid_{name}" for name in _MAPS},
        **{name: name for name in ("nominals", "jumps", "clock_jump", "variables")},
        **{name: name for name in ("state_names", "discrete_names", "margin_names", "names")},
    }
    return "const Model model = {\n" + "".join(f"    .{key} = {value},\n" for key, value in fields.items()) + "};\n"


def _bool(value: bool) -> str:
    return "true" if value else "false"

"""Generate the C of a model: the traced functions and tables that the engine reads (hybrid_model/engine/model.h)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate

import casadi as ca

from hybrid_model import scales
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.transitions import Priority, Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.native.c_text import array, boolean, constant, definition, functions, row, string
from hybrid_model.native.derivatives import derivative_functions, jacobian_function
from hybrid_model.native.flow_structure import levels_of_quadratures
from hybrid_model.native.held_factors import HeldFactors, held_factors
from hybrid_model.native.names import NameTable
from hybrid_model.native.networks.network import NetworkTrace
from hybrid_model.native.trace import Trace, changed


def model_code(traced: Trace | NetworkTrace, *, by_parts: bool = False) -> str:
    """Return the C source of a model.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton's maps.
    by_parts : bool
        Whether a network comes with what its parts need to run on their own.

    Returns
    -------
    str
        A C99 translation unit that defines ``const Model model``.
    """
    maps, work = _maps(traced, derivatives=True, jacobian=traced.automaton.stiff is True, by_parts=by_parts)
    model = model_definition(traced, work, traced.automaton.name, starts=True)
    tables = [*_starts(traced.layout), *model_tables(traced.automaton, traced.layout)]
    return "\n".join([_PRELUDE, maps, *tables, model])


def run_code(traced: Trace | NetworkTrace, *, jacobian: bool = False) -> str:
    """Return the C source of a model that is run in this process, after hybrid_model/engine/runs/exports.c.

    Start values and the instance's name are not in it, since whoever runs it has them, so that instances that differ in
    them share it; derivatives, which runs do not need, are left out where they are functions of their own.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton's maps.
    jacobian : bool
        Whether the run is to have a method for stiff flows; an automaton that is declared stiff has it.

    Returns
    -------
    str
        A C99 translation unit that defines ``const Model model``, for `hybrid_model.native.build.libraries`.
    """
    # Of use to parts of networks alone, which run on their own; FMUs have theirs in the tables of their parts.
    held = held_factors(traced.flow) if isinstance(traced, Trace) else None
    maps, work = _maps(traced, held, derivatives=False, jacobian=jacobian or traced.automaton.stiff is True)
    model = model_definition(traced, work, type(traced.automaton).__name__, held=held)
    return "\n".join([_PRELUDE, maps, *model_tables(traced.automaton, traced.layout), model])


def _maps(
    traced: Trace | NetworkTrace,
    held: HeldFactors | None = None,
    *,
    derivatives: bool,
    jacobian: bool,
    by_parts: bool = False,
) -> tuple[str, Sequence[int]]:
    """Return the definitions of the maps and of what follows from them, and the sizes of the work arrays they need."""
    if isinstance(traced, NetworkTrace):
        network = traced.definitions(factors=by_parts)
        return "\n".join([network.text, _NO_JACOBIAN]), network.work
    found = {**(derivative_functions(traced) if derivatives else {})}
    if jacobian:
        found["jacobian"] = jacobian_function(traced)
    if held is not None:
        found["factors"] = held.function
    resets = [_Reset(reset) for reset in traced.resets]
    given = [*traced.functions[: -len(resets) or None], *(reset.function for reset in resets), *found.values()]
    maps = functions("model", given)
    work = list(maps.work)
    without = [f"#define hybrid_{name} NULL" for name in _DERIVATIVES if name not in found]
    code = "\n".join(
        [
            maps.text,
            '#include "model.h"',
            "",
            *_resets(traced, resets, work[-1]),
            *without,
            *held_tables(held),
        ]
    )
    work[-1] += max((len(reset.x) + len(reset.z) for reset in resets), default=0)
    return code, work


def held_tables(held: HeldFactors | None, prefix: str = "") -> list[str]:
    """Return the tables of what rates are affine in, their names after a prefix; none where there are none."""
    if held is None:
        return []
    columns = zip(_HELD, (held.held, held.rows, held.columns, held.keys), strict=True)
    return [array("uint32_t", f"{prefix}{name}", map(str, numbers)) for name, numbers in columns]


class _Reset:
    """A jump map that gives what it changes alone: the places in x and z, and a function of their new values.

    Most jumps change few of many states. What is not computed need not be compiled.
    """

    def __init__(self, whole: ca.Function) -> None:
        self.x, self.z = sorted(changed(whole, Kind.STATE)), sorted(changed(whole, Kind.DISCRETE))
        arguments = whole.sx_in()
        x, z = whole.call(arguments)
        after = [ca.vertcat(ca.SX(0, 1), *(new[k] for k in places)) for new, places in ((x, self.x), (z, self.z))]
        self.function = ca.Function(whole.name(), arguments, after)


def _resets(traced: Trace, resets: Sequence[_Reset], own: int) -> list[str]:
    """Return the tables of the jump maps and the function that calls them, whose work begins after `own` doubles."""
    firsts = accumulate((len(reset.x) + len(reset.z) for reset in resets), initial=0)
    parts = [row(first, len(reset.x), len(reset.z)) for first, reset in zip(firsts, resets, strict=False)]
    sizes = traced.layout.sizes
    return [
        "typedef struct { size_t first, x, z; } ResetPart;",
        array("ModelFunction", "resets", (reset.function.name() for reset in resets)),
        array("ResetPart", "reset_parts", parts),
        array("size_t", "reset_places", (str(place) for reset in resets for place in (*reset.x, *reset.z))),
        _RESET.format(states=sizes[Kind.STATE], discrete=sizes[Kind.DISCRETE], work=own),
    ]


_HELD = ("held", "factor_rows", "factor_columns", "factor_keys")
_DERIVATIVES = ("forward", "reverse", "start_forward", "start_reverse", "jacobian")
_MAPS = ("start", "flow", "flow_set", "margins", "times", "outputs", "reset", *_DERIVATIVES)
_NO_JACOBIAN = "#define hybrid_jacobian NULL\n"
"""Of networks, whose parts have derivatives along directions each."""
_STIFFNESS = {None: "STIFFNESS_UNKNOWN", True: "STIFFNESS_DECLARED", False: "STIFFNESS_DENIED"}
_VECTORS = {"x": Kind.STATE, "z": Kind.DISCRETE, "u": Kind.INPUT, "p": Kind.PARAMETER}
_PRELUDE = """\
/* Generated from an automaton.  Its names stay inside, and its maps need not use all that they are given. */
#include <math.h>
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
"""
_RESET = """\
/* A jump map writes the states that it changes; the others stay. */
static int hybrid_reset(size_t jump, const double **arg, double **res, long long *iw, double *w)
{{
    const ResetPart *part = &reset_parts[jump];
    const size_t *place = reset_places + part->first;
    double *x = res[0], *z = res[1], *after = w + {work};
    for (size_t i = 0; i < {states}; i++)
        x[i] = arg[1][i];
    for (size_t i = 0; i < {discrete}; i++)
        z[i] = arg[2][i];
    res[0] = after;
    res[1] = after + part->x;
    int failed = resets[jump](arg, res, iw, w, 0);
    for (size_t i = 0; i < part->x; i++)
        x[place[i]] = after[i];
    for (size_t i = part->x; i < part->x + part->z; i++)
        z[place[i]] = after[i];
    return failed;
}}
"""


def _starts(layout: Layout) -> list[str]:
    return [array("double", f"start_{name}", map(constant, layout.start(kind))) for name, kind in _VECTORS.items()]


def model_tables(automaton: Automaton, layout: Layout, prefix: str = "") -> list[str]:
    """Return the tables of a model that are not numbers to start with, their names after a prefix."""
    names = NameTable()
    margin_names = [info.name for info in automaton.jumps if info.trigger is Trigger.STATE]
    tables = [
        array("double", f"{prefix}nominals", map(constant, nominals(layout))),
        array("bool", f"{prefix}whole", map(boolean, layout.whole)),
        array("ModelName", f"{prefix}state_names", map(names.entry, layout.names(Kind.STATE))),
        array("ModelName", f"{prefix}discrete_names", map(names.entry, layout.names(Kind.DISCRETE))),
        array("ModelName", f"{prefix}margin_names", map(names.entry, margin_names)),
        array("ModelJump", f"{prefix}jumps", _jumps(automaton, names)),
    ]
    return [*tables, names.definition(f"{prefix}names")]


def nominals(layout: Layout) -> list[float]:
    """Return a usual size of each continuous state, 0 where none is declared."""
    variables = [place.variable for place in layout.places[Kind.STATE]]
    return [0.0 if v.nominal is None else v.nominal for v in variables for _ in range(v.size)]


def _number(value: float | tuple[float, ...]) -> str:
    return row(*map(constant, value)) if isinstance(value, tuple) else constant(value)


def _jumps(automaton: Automaton, names: NameTable) -> list[str]:
    rows = []
    counts = {Trigger.STATE: 0, Trigger.TIME: 0}
    for info in automaton.jumps:
        kind = "JUMP_ON_STATE" if info.trigger is Trigger.STATE else "JUMP_ON_TIME"
        rows.append(row(names.entry(info.name), kind, counts[info.trigger], boolean(info.internal)))
        counts[info.trigger] += 1
    return rows


def _held_fields(held: HeldFactors, prefix: str) -> dict[str, object]:
    tables = {name: f"{prefix}{name}" for name in _HELD}
    return {"n_factors": len(held.rows), "n_factor_keys": len(held.keys), **tables}


def model_definition(
    traced: Trace | NetworkTrace,
    work: Sequence[int],
    name: str,
    *,
    prefix: str = "",
    starts: bool = False,
    maps: Mapping[str, str] | None = None,
    constants: int = 0,
    held: HeldFactors | None = None,
) -> str:
    """Return the definition of a model.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton's maps.
    work : sequence of int
        Sizes of the work arrays.
    name : str
        Of the model, for messages.
    prefix : str
        Of its own name and of those of its tables.
    starts : bool
        Whether its start values are there.
    maps : mapping, optional
        Map -> C function, where not all are there under the names that they have in an FMU.
    constants : int
        Number of parameters behind the automaton's own.
    held : HeldFactors, optional
        The factors of its rates, if there are any.
    """
    automaton, sizes = traced.automaton, traced.layout.sizes
    wanted = _MAPS if held is None else (*_MAPS, "factors")
    fields = {
        "name": string(name),
        "n_states": sizes[Kind.STATE],
        "n_discrete": sizes[Kind.DISCRETE],
        "n_inputs": traced.inputs,
        "n_parameters": sizes[Kind.PARAMETER] + constants,
        "n_outputs": sizes[Kind.OUTPUT],
        "n_margins": sum(info.trigger is Trigger.STATE for info in automaton.jumps),
        "n_times": sum(info.trigger is Trigger.TIME for info in automaton.jumps),
        "n_jumps": len(automaton.jumps),
        **dict(zip(("n_arg", "n_res", "n_iw", "n_w"), work, strict=True)),
        "flow_priority": boolean(automaton.priority is Priority.FLOW),
        "has_flow_set": boolean(automaton.has_flow_set),
        "stiffness": _STIFFNESS[automaton.stiff],
        "quadratures": levels_of_quadratures(traced.pattern("flow", "x")),
        "predictable": boolean(all(place.variable.discrete for place in traced.layout.places[Kind.INPUT])),
        **{name: f"start_{name}" if starts else "NULL" for name in _VECTORS},
        **{name: f"hybrid_{name}" if maps is None else maps.get(name, "NULL") for name in wanted},
        "scales": row(*(f".{name} = {_number(value)}" for name, value in scales.of_models().items())),
        **({} if held is None else _held_fields(held, prefix)),
        **{name: f"{prefix}{name}" for name in ("nominals", "whole", "jumps")},
        **{name: f"{prefix}{name}" for name in ("state_names", "discrete_names", "margin_names", "names")},
    }
    return definition("Model", f"{prefix}model", fields)

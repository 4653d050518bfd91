"""Directional and adjoint derivatives of a traced automaton, by CasADi.

Each function has the arguments t, x, z, u, p of the maps, then the seeds (see hybrid_model/engine/model.h).
"""

from __future__ import annotations

import casadi as ca

from hybrid_model.native.trace import ARGUMENTS, Trace


def derivative_functions(traced: Trace) -> dict[str, ca.Function]:
    """Return the derivatives of flow map and outputs, and of the start map.

    Parameters
    ----------
    traced : Trace
        The automaton.

    Returns
    -------
    dict of str to casadi.Function
        ``forward``: seeds of t, x, z, u, p -> changes of dx/dt and y. ``reverse``: seeds of dx/dt and y ->
        sensitivities to t, x, z, u, p. ``start_forward`` and ``start_reverse``: the same of the start values.
    """
    sizes = [traced.flow.size1_in(k) for k in range(len(ARGUMENTS))]
    arguments = [ca.SX.sym(name, size) for name, size in zip(ARGUMENTS, sizes, strict=True)]
    rates = [*traced.flow.call(arguments), *traced.outputs.call(arguments)]
    starts = traced.start.call(arguments)
    return {
        "forward": _forward("forward", arguments, rates),
        "reverse": _reverse("reverse", arguments, rates),
        "start_forward": _forward("start_forward", arguments, starts),
        "start_reverse": _reverse("start_reverse", arguments, starts),
    }


def jacobian_function(traced: Trace) -> ca.Function:
    """Return the derivatives of the flow map that methods for stiff flows need.

    Parameters
    ----------
    traced : Trace
        The automaton.

    Returns
    -------
    casadi.Function
        t, x, z, u, p -> d(dx/dt)/dx (dense), d(dx/dt)/dt.
    """
    arguments = traced.flow.sx_in()
    (rates,) = traced.flow.call(arguments)
    time, states = (arguments[ARGUMENTS.index(name)] for name in ("t", "x"))
    slopes = [ca.densify(ca.jacobian(rates, argument)) for argument in (states, time)]
    return ca.Function("hybrid_jacobian", arguments, slopes)


def _forward(name: str, arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    seeds = [ca.SX.sym(f"{name}_seed", argument.numel()) for argument in arguments]
    changes = [ca.jtimes(result, ca.vertcat(*arguments), ca.vertcat(*seeds)) for result in results]
    return ca.Function(f"hybrid_{name}", [*arguments, *seeds], [ca.densify(change) for change in changes])


def _reverse(name: str, arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    seeds = [ca.SX.sym(f"{name}_seed", result.numel()) for result in results]
    total = ca.jtimes(ca.vertcat(*results), ca.vertcat(*arguments), ca.vertcat(*seeds), True)
    ends = [0]
    for argument in arguments:
        ends.append(ends[-1] + argument.numel())
    parts = ca.vertsplit(ca.densify(total), ends)
    return ca.Function(f"hybrid_{name}", [*arguments, *seeds], parts)

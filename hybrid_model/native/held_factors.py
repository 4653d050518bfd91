"""Rates that are affine in what only jumps change: with those values as factors of functions of time.

Between two breakpoints an agent's rate is ``sum_j w_j(t) (xhat_j - xhat)``: the functions w_j stay what they are when a
broadcast value arrives. The engine integrates them once a piece (hybrid_model/engine/methods/held_factors.c).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca

from hybrid_model.native.trace import ARGUMENTS

__all__ = ["HeldFactors", "held_factors"]

_T, _X, _Z, _U, _P = range(len(ARGUMENTS))
_SUMS = frozenset((ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE))


@dataclass(frozen=True)
class HeldFactors:
    """Rates as a sum of functions of time, each times a value that is held between jumps.

    Attributes
    ----------
    function : casadi.Function
        t, x, z, u, p -> the rates without those values, then the nonzero functions that the values are factors of.
    held : tuple of int
        Places of the values in z and u, one after the other.
    rows, columns : tuple of int
        Of each function: the rate that it belongs to, and which of the values is its factor.
    keys : tuple of int
        Places in z, u and p, one after the other, of what the functions depend on besides time.
    """

    function: ca.Function
    held: tuple[int, ...]
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    keys: tuple[int, ...]


def held_factors(flow: ca.Function, name: str = "hybrid_factors") -> HeldFactors | None:
    """Find the values that the rates of an automaton are affine in.

    Parameters
    ----------
    flow : casadi.Function
        t, x, z, u, p -> rates; what follows p counts as behind it.
    name : str
        Of the function that is made.

    Returns
    -------
    HeldFactors or None
        None where a rate depends on a continuous state, or no value is a factor.
    """
    arguments = flow.sx_in()
    if not arguments[_X].numel() or flow.jac_sparsity(0, _X).nnz():
        return None
    (rates,) = flow.call(arguments)
    values = ca.vertcat(arguments[_Z], arguments[_U])
    held = _affine_in(flow, arguments[_Z].numel(), values.numel())
    if not held:
        return None
    factors = ca.jacobian(rates, values[list(held)])
    constant = ca.substitute(rates, values[list(held)], ca.SX.zeros(len(held)))
    rows, columns = factors.sparsity().get_triplet()
    results = [ca.densify(constant), ca.vec(factors.nz[:])]
    others = ca.vertcat(values, *arguments[_P:])
    _, keys = ca.jacobian_sparsity(ca.vertcat(*results), others).get_triplet()
    function = ca.Function(name, arguments, results)
    return HeldFactors(function, held, tuple(rows), tuple(columns), tuple(sorted(set(keys))))


def _affine_in(flow: ca.Function, discrete: int, count: int) -> tuple[int, ...]:
    """Return which of discrete states and inputs, one after the other, all rates together are affine in.

    Where two of them are factors of each other, the discrete state stays out, or both do.
    """
    candidates = (1 << count) - 1
    states = (1 << discrete) - 1
    while True:
        met, bent, mixed = _passes(flow, candidates, discrete)
        out = bent or (mixed & states) or mixed
        if not out:
            return tuple(k for k in range(count) if met >> k & 1)
        candidates &= ~out


def _passes(flow: ca.Function, candidates: int, discrete: int) -> tuple[int, int, int]:
    """Return, as bits, which candidates the rates depend on, which pass a function, and which meet in a product."""
    work = [0] * flow.sz_w()
    met = bent = mixed = 0
    offsets = {_Z: 0, _U: discrete}
    for k in range(flow.n_instructions()):
        operation, out, sources = flow.instruction_id(k), flow.instruction_output(k), flow.instruction_input(k)
        if operation == ca.OP_INPUT:
            argument, place = sources
            work[out[0]] = 1 << offsets[argument] + place & candidates if argument in offsets else 0
            continue
        if operation == ca.OP_CONST:
            work[out[0]] = 0
            continue
        operands = [work[source] for source in sources]
        passed = _union(operands)
        if operation == ca.OP_OUTPUT:
            met |= passed
            continue
        if operation == ca.OP_MUL:
            mixed |= passed if all(operands) else 0
        elif operation == ca.OP_DIV:
            bent |= operands[1]
            mixed |= passed if all(operands) else 0
        elif operation == ca.OP_IF_ELSE_ZERO:
            bent |= operands[0]
        elif operation not in _SUMS:
            bent |= passed
        work[out[0]] = passed
    return met, bent, mixed


def _union(sets: Iterable[int]) -> int:
    total = 0
    for bits in sets:
        total |= bits
    return total

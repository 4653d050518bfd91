"""What a jump changes: found by comparing a traced jump map with the identity."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from hybrid_model.variables import Kind


def states_reset(traced: Any) -> frozenset[int]:
    """Return the elements of the continuous state vector that some jump may change.

    Parameters
    ----------
    traced : Trace
        With the jump maps ``resets``, if it has them apart; otherwise every state counts as changed by any jump.
    """
    resets = getattr(traced, "resets", None)
    if resets is None:
        return frozenset(range(traced.layout.sizes[Kind.STATE]) if traced.automaton.jumps else ())
    return frozenset(element for reset in resets for element in _changed(reset, 0))


def output_jumps(traced: Any, kind: Kind) -> list[frozenset[int] | None]:
    """Return which jumps may change the elements of the discrete states, or of the outputs that depend on these alone.

    Parameters
    ----------
    traced : Trace
        As for `states_reset`.
    kind : {Kind.DISCRETE, Kind.OUTPUT}
        Which vector.

    Returns
    -------
    list of frozenset of int or None
        Numbers of the jumps, one set an element; None where something else than a jump changes it as well.
    """
    count = traced.layout.sizes[Kind.DISCRETE]
    resets = getattr(traced, "resets", None)
    if resets is None:
        return [None] * traced.layout.sizes[kind]
    changed = [_changed(reset, 1) for reset in resets]
    by_state = [frozenset(k for k, elements in enumerate(changed) if z in elements) for z in range(count)]
    if kind is Kind.DISCRETE:
        return list(by_state)
    other = np.zeros(traced.layout.sizes[Kind.OUTPUT], dtype=bool)
    for argument in ("t", "x", "u"):
        other |= np.diff(sparse.csr_array(traced.pattern("outputs", argument)).indptr) > 0
    pattern = sparse.csr_array(traced.pattern("outputs", "z"))
    rows = [pattern.indices[pattern.indptr[k] : pattern.indptr[k + 1]] for k in range(other.size)]
    return [
        None if free else frozenset[int]().union(*(by_state[z] for z in row))
        for row, free in zip(rows, other, strict=True)
    ]


def _changed(reset: ca.Function, result: int) -> frozenset[int]:
    """Return the elements of x+ (result 0) or z+ (result 1) that are not x or z itself."""
    arguments = reset.sx_in()
    after, before = reset.call(arguments)[result], arguments[1 + result]
    same = (ca.is_equal(after[k], before[k], 0) for k in range(before.numel()))
    return frozenset(k for k, kept in enumerate(same) if not kept)

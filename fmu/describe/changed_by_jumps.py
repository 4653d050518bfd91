"""Which jumps change what: states, and outputs that depend on discrete states alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from hybrid_model.declare.variables import Kind


def states_reset(traced: Any) -> frozenset[int]:
    """Return the elements of the continuous state vector that some jump may change.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        Of any automaton.
    """
    return frozenset[int]().union(*traced.changes(Kind.STATE))


def output_jumps(traced: Any, kind: Kind) -> list[frozenset[int] | None]:
    """Return which jumps may change the elements of the discrete states, or of the outputs that depend on these alone.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        As for `states_reset`.
    kind : {Kind.DISCRETE, Kind.OUTPUT}
        Which vector.

    Returns
    -------
    list of frozenset of int or None
        Numbers of the jumps, one set an element; None where something else than a jump changes it as well.
    """
    jumps: list[set[int]] = [set() for _ in range(traced.layout.sizes[Kind.DISCRETE])]
    for jump, elements in enumerate(traced.changes(Kind.DISCRETE)):
        for element in elements:
            jumps[element].add(jump)
    by_state = [frozenset(found) for found in jumps]
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

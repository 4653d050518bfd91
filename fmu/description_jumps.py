"""What a jump changes: found by comparing a traced jump map with the identity."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from hybrid_model.variables import Kind

_RESULTS = (Kind.STATE, Kind.DISCRETE)
"""Vectors that jump maps give, x+ and z+."""


def states_reset(traced: Any) -> frozenset[int]:
    """Return the elements of the continuous state vector that some jump may change.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        With its jump maps, or those of its groups of parts.
    """
    return frozenset[int]().union(*changes(traced, Kind.STATE))


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
    for jump, elements in enumerate(changes(traced, Kind.DISCRETE)):
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


def changes(traced: Any, kind: Kind) -> list[frozenset[int]]:
    """Return the elements that each jump may change of the continuous states, or of the discrete ones.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        As for `states_reset`.
    kind : {Kind.STATE, Kind.DISCRETE}
        Which vector.
    """
    resets = getattr(traced, "resets", None)
    if resets is not None:
        return [_changed(reset, _RESULTS.index(kind)) for reset in resets]
    # A network: parts with equal maps share them.
    by_group = [[_changed(reset, _RESULTS.index(kind)) for reset in group.traced.resets] for group in traced.groups]
    found: list[frozenset[int]] = [frozenset()] * len(traced.automaton.jumps)
    for member, group in zip(traced.members.members, traced.group_of, strict=True):
        for k, elements in enumerate(by_group[group]):
            found[member.jump + k] = frozenset(member.first[kind] + element for element in elements)
    return found


def _changed(reset: ca.Function, result: int) -> frozenset[int]:
    """Return the elements of x+ (result 0) or z+ (result 1) that are not x or z itself."""
    arguments = reset.sx_in()
    after, before = reset.call(arguments)[result], arguments[1 + result]
    same = (ca.is_equal(after[k], before[k], 0) for k in range(before.numel()))
    return frozenset(k for k, kept in enumerate(same) if not kept)

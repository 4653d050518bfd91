"""What discrete outputs depend on in Event Mode, where readers see the state after the jump that comes next.

Whether that jump is taken follows from its margin and from the flow set, and its outcome from its jump map.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from scipy import sparse

from hybrid_model.declare.transitions import Priority, Trigger
from hybrid_model.declare.variables import Kind

Matrix: TypeAlias = Any  # scipy.sparse.csr_array of bool
"""Elements of a result by elements of t, x, z, u, p side by side."""
_STATES = (Kind.STATE, Kind.DISCRETE)
"""Vectors that jump maps give, x+ and z+."""


def after_jumps(traced: Any, margins: Matrix, flow_set: Matrix) -> dict[Kind, Matrix]:
    """Return what the states depend on in Event Mode beyond themselves.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        With its jump maps, or those of its groups of parts.
    margins, flow_set : csr_array, shapes (jump margins, arguments) and (1, arguments)
        What these depend on.

    Returns
    -------
    dict of Kind to csr_array of bool
        For the continuous and the discrete states, shape (elements, arguments).
    """
    guards = _guards(traced.automaton, _row_sets(margins), _row_sets(flow_set)[0])
    found = {}
    for kind in _STATES:
        rows = [set[int]() for _ in range(traced.layout.sizes[kind])]
        for jump, read in _reads(traced, kind):
            # Breakpoints of the flow are taken when they are due, in no mode of the importer's.
            if not traced.automaton.jumps[jump].internal:
                for element, dependencies in read.items():
                    rows[element] |= guards[jump] | dependencies
        found[kind] = _matrix(rows, margins.shape[1])
    return found


def _reads(traced: Any, kind: Kind) -> Iterator[tuple[int, dict[int, AbstractSet[int]]]]:
    """Yield each jump with the elements that it changes and what their new values depend on."""
    changed = traced.changes(kind)
    if hasattr(traced, "resets"):
        for jump, reset in enumerate(traced.resets):
            rows = _reset_rows(reset, kind) if changed[jump] else []
            yield jump, {element: rows[element] for element in changed[jump]}
        return
    for number, member in enumerate(traced.members.members):
        for k in range(len(member.automaton.jumps)):
            elements = changed[member.jump + k]
            own = traced.patterns.of_reset(number, k, kind) if elements else []
            yield member.jump + k, {element: own[element - member.first[kind]] for element in elements}


def _guards(automaton: Any, margins: list[set[int]], flow_set: set[int]) -> list[set[int]]:
    """Return what decides on each jump; the time, which is argument 0, on those at known times."""
    waits = flow_set if automaton.priority is Priority.FLOW and automaton.has_flow_set else set()
    of_state = iter(margins)
    return [next(of_state) | waits if info.trigger is Trigger.STATE else {0} for info in automaton.jumps]


def _reset_rows(reset: ca.Function, kind: Kind) -> list[set[int]]:
    result = _STATES.index(kind)
    sides = []
    for argument in range(reset.n_in()):
        rows, columns = reset.jac_sparsity(result, argument).get_triplet()
        shape = (reset.size1_out(result), reset.size1_in(argument))
        sides.append(sparse.csr_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=shape))
    return _row_sets(sparse.csr_array(sparse.hstack(sides)))


def _row_sets(matrix: Matrix) -> list[set[int]]:
    return [set(matrix.indices[a:b].tolist()) for a, b in zip(matrix.indptr[:-1], matrix.indptr[1:], strict=True)]


def _matrix(rows: list[set[int]], width: int) -> Matrix:
    pointers = np.cumsum([0, *map(len, rows)])
    indices = np.array([k for row in rows for k in sorted(row)], dtype=np.int64)
    return sparse.csr_array((np.ones(len(indices), dtype=bool), indices, pointers), shape=(len(rows), width))

"""How strongly an expression depends on its arguments: by a constant, fixed, tunable or discrete factor, or freely.

A factor is the partial derivative. It says what the dependency is only where the argument does not pass a function
with steps (a comparison, ``sign``, ``floor``) on its way: derivatives do not see those.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy import sparse

Matrix: TypeAlias = Any  # scipy.sparse.csr_array of int
"""Elements of a result by elements of all arguments side by side."""


class Factor(enum.IntEnum):
    """Kinds of dependencies, from the strictest; names as in the FMI standard 3.0, section 2.4.8."""

    CONSTANT = 0
    FIXED = 1
    TUNABLE = 2
    DISCRETE = 3
    DEPENDENT = 4


_T, _X, _Z, _U, _P = range(5)
_STEPS = frozenset(
    getattr(ca, f"OP_{name}")
    for name in ("LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "SIGN", "FLOOR", "CEIL", "FMOD", "COPYSIGN", "REMAINDER")
)
"""Operations whose derivative hides that they jump."""


def factors(function: ca.Function, result: int = 0, tunable: Sequence[int] = ()) -> Matrix:
    """Classify the dependencies of a function's result on its arguments t, x, z, u, p.

    Parameters
    ----------
    function : casadi.Function
        Function of scalar expressions, with arguments t, x, z, u, p.
    result : int
        Number of the result.
    tunable : sequence of int
        Places in p of the parameters that may change at events.

    Returns
    -------
    csr_array of int
        The arguments side by side: `Factor` + 1 where an element of the result depends on one of them, else nothing.
    """
    arguments = function.sx_in()
    expression = function.call(arguments)[result]
    stepped = _stepped(arguments, expression)
    found: list[tuple[npt.NDArray[np.int64], ...]] = []
    ends = np.cumsum([0, *(argument.numel() for argument in arguments)])
    for number in range(len(arguments)):
        pattern = function.jac_sparsity(result, number)
        rows, columns = (np.array(index, dtype=np.int64) for index in pattern.get_triplet())
        kinds = _kinds(arguments, expression, number, rows, columns, tunable)
        if stepped:
            through = [
                bool(stepped[row] >> int(ends[number] + column) & 1) for row, column in zip(rows, columns, strict=True)
            ]
            kinds[through] = Factor.DEPENDENT
        found.append((kinds + 1, rows, columns + ends[number]))
    values, rows, columns = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return sparse.csr_array((values, (rows, columns)), shape=(expression.numel(), int(ends[-1])))


def _kinds(
    arguments: Sequence[ca.SX],
    expression: ca.SX,
    number: int,
    rows: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int64],
    tunable: Sequence[int],
) -> npt.NDArray[np.int64]:
    """Return the kind of each dependency by what its partial derivative depends on."""
    kinds = np.full(rows.size, Factor.DEPENDENT, dtype=np.int64)
    if rows.size == 0:
        return kinds
    argument = arguments[number]
    slopes = ca.jacobian(expression, argument)
    known_rows, known_columns = (np.array(index, dtype=np.int64) for index in slopes.sparsity().get_triplet())
    entries = slopes.nz[:] if slopes.nnz() else ca.SX(0, 1)
    depends = [_rows_that_depend(entries, item) for item in arguments]
    # A factor that moves with what it is a factor of is none: z in z * z.
    free = depends[_T] | depends[_X] | depends[_U] | depends[number]
    tuned = _rows_that_depend(entries, arguments[_P][list(tunable)])
    by_entry = np.select(
        [free, depends[_Z], tuned, depends[_P]],
        [Factor.DEPENDENT, Factor.DISCRETE, Factor.TUNABLE, Factor.FIXED],
        Factor.CONSTANT,
    )
    width = argument.numel()
    order = np.argsort(known_rows * width + known_columns)
    keys = (known_rows * width + known_columns)[order]
    wanted = rows * width + columns
    at = np.minimum(np.searchsorted(keys, wanted), max(keys.size - 1, 0))
    # A dependency without a slope is one through steps alone.
    found = keys[at] == wanted if keys.size else np.zeros(wanted.size, dtype=bool)
    kinds[found] = by_entry[order][at[found]]
    return kinds


def _rows_that_depend(entries: ca.SX, argument: ca.SX) -> npt.NDArray[np.bool_]:
    found = np.zeros(entries.numel(), dtype=bool)
    if entries.numel() and argument.numel():
        rows, _ = ca.jacobian_sparsity(entries, argument).get_triplet()
        found[np.array(rows, dtype=np.int64)] = True
    return found


def _stepped(arguments: Sequence[ca.SX], expression: ca.SX) -> dict[int, int]:
    """Return for each row the set of scalar arguments (as bits) that pass a function with steps; empty if none do."""
    program = ca.Function("program", [ca.vertcat(*arguments)], [ca.densify(expression)])
    count = program.n_instructions()
    if not any(program.instruction_id(k) in _STEPS for k in range(count)):
        return {}
    work = [(0, 0)] * program.sz_w()
    rows = dict.fromkeys(range(expression.numel()), 0)
    for k in range(count):
        operation, out, sources = program.instruction_id(k), program.instruction_output(k), program.instruction_input(k)
        if operation == ca.OP_INPUT:
            work[out[0]] = (1 << sources[1], 0)
        elif operation == ca.OP_CONST:
            work[out[0]] = (0, 0)
        elif operation == ca.OP_OUTPUT:
            rows[out[1]] = work[sources[0]][1]
        else:
            operands = [work[source] for source in sources]
            passed = _union(bits for bits, _ in operands)
            inside = _union(bits for _, bits in operands)
            if operation in _STEPS:
                inside |= passed
            elif operation == ca.OP_IF_ELSE_ZERO:
                inside |= operands[0][0]
            work[out[0]] = (passed, inside)
    return rows


def _union(sets: Iterable[int]) -> int:
    total = 0
    for bits in sets:
        total |= bits
    return total

"""Arrays of expressions as columns: one call of CasADi computes what else takes a call for each element.

What is computed is the same, expression by expression. A column is kept beside the array that it was made from, and
used again as long as the array holds these very elements.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

__all__ = ["FEWEST", "Column", "as_column", "at_once", "sum_of", "taken_apart"]

FEWEST = 4
"""Fewer elements are computed one by one."""
_NUMBERS = (float, int)


class Column(NamedTuple):
    """An array as one column, and the elements that it was made from.

    Attributes
    ----------
    whole : casadi.SX
        Its elements, row by row.
    elements : list
        The objects that the array held: expressions and numbers.
    symbolic : bool
        Whether all of them are expressions.
    """

    whole: ca.SX
    elements: list[Any]
    symbolic: bool


def as_column(array: np.ndarray[Any, np.dtype[Any]]) -> Column | None:
    """Return an array of scalar expressions and numbers as a column; None where it holds anything else.

    Parameters
    ----------
    array : ndarray of object
        Its attribute ``column``, where it has one, keeps the column.
    """
    elements = array.ravel().tolist()
    kept: Column | None = getattr(array, "column", None)
    if kept is not None and len(kept.elements) == len(elements) and all(map(operator.is_, kept.elements, elements)):
        return kept
    kinds = set(map(type, elements))
    if not kinds <= {ca.SX, *_NUMBERS}:
        return None
    whole = ca.SX(ca.vertcat(*elements))
    # An element may be a matrix, or a zero that is none of the nonzeros.
    if whole.numel() != len(elements) or not whole.is_dense():
        return None
    column = Column(whole, elements, kinds == {ca.SX})
    if hasattr(array, "column"):
        array.column = column
    return column


def at_once(
    operation: Callable[..., Any], given: Sequence[np.ndarray[Any, np.dtype[Any]]], deciding: Sequence[int]
) -> tuple[np.ndarray[Any, np.dtype[Any]], Column] | None:
    """Apply an elementwise operation to whole columns.

    Parameters
    ----------
    operation : callable
        Of columns, or of scalars.
    given : sequence of ndarray of object
        Operands that are broadcast against each other.
    deciding : sequence of int
        Numbers of the operands of which one has to be of expressions alone: numbers among themselves are not CasADi's.

    Returns
    -------
    tuple of ndarray of object and Column, or None
        The result, in both forms. None where it has to be computed element by element.
    """
    shape = np.broadcast_shapes(*(array.shape for array in given))
    size = math.prod(shape)
    if size < FEWEST:
        return None
    columns = []
    for array in given:
        same = array if array.size == 1 or array.shape == shape else np.broadcast_to(array, shape)
        column = as_column(same)
        if column is None:
            return None
        columns.append(column)
    if not any(columns[k].symbolic for k in deciding):
        return None
    result = operation(*(column.whole for column in columns))
    if result.numel() != size or not result.is_dense():
        return None
    elements = taken_apart(result)
    return np.fromiter(elements, object, size).reshape(shape), Column(result, elements, symbolic=True)


def sum_of(array: np.ndarray[Any, np.dtype[Any]]) -> ca.SX | None:
    """Return the sum of all elements, from the first to the last; None where they have to be added one by one."""
    column = as_column(array) if array.size >= FEWEST else None
    return None if column is None or not column.symbolic else ca.sum1(column.whole)


def taken_apart(column: ca.SX) -> list[Any]:
    """Return the elements of a column."""
    return ca.vertsplit(column) if column.numel() else []

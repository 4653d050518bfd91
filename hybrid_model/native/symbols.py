"""Arrays of symbols that behave like numpy arrays, so that maps written for floats can be traced.

The expressions themselves are CasADi's; this module only keeps numpy's shapes, indexing and broadcasting, which
CasADi's matrices do not have, and says what to write where a value cannot be a symbol.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from hybrid_model.errors import TraceError
from hybrid_model.native.symbol_columns import Column, at_once, sum_of, taken_apart


def _modulo(a: Any, b: Any) -> Any:
    # numpy's remainder has the sign of the divisor, C's fmod that of the dividend.
    return a - b * ca.floor(a / b)


_ELEMENTWISE: dict[np.ufunc, Callable[..., Any]] = {
    np.add: lambda a, b: a + b,
    np.subtract: lambda a, b: a - b,
    np.multiply: lambda a, b: a * b,
    np.divide: lambda a, b: a / b,
    np.floor_divide: lambda a, b: ca.floor(a / b),
    np.remainder: _modulo,
    np.fmod: ca.fmod,
    np.power: lambda a, b: a**b,
    np.float_power: lambda a, b: a**b,
    np.negative: lambda a: -a,
    np.positive: lambda a: a,
    np.absolute: ca.fabs,
    np.fabs: ca.fabs,
    np.sign: ca.sign,
    np.square: lambda a: a * a,
    np.sqrt: ca.sqrt,
    np.exp: ca.exp,
    np.expm1: ca.expm1,
    np.log: ca.log,
    np.log1p: ca.log1p,
    np.log10: ca.log10,
    np.sin: ca.sin,
    np.cos: ca.cos,
    np.tan: ca.tan,
    np.arcsin: ca.asin,
    np.arccos: ca.acos,
    np.arctan: ca.atan,
    np.arctan2: ca.atan2,
    np.sinh: ca.sinh,
    np.cosh: ca.cosh,
    np.tanh: ca.tanh,
    np.hypot: ca.hypot,
    np.floor: ca.floor,
    np.ceil: ca.ceil,
    np.minimum: ca.fmin,
    np.maximum: ca.fmax,
    np.fmin: ca.fmin,
    np.fmax: ca.fmax,
    np.less: lambda a, b: a < b,
    np.less_equal: lambda a, b: a <= b,
    np.greater: lambda a, b: a > b,
    np.greater_equal: lambda a, b: a >= b,
    np.equal: lambda a, b: a == b,
    np.not_equal: lambda a, b: a != b,
    np.logical_and: ca.logic_and,
    np.logical_or: ca.logic_or,
    np.logical_not: ca.logic_not,
    np.bitwise_and: ca.logic_and,
    np.bitwise_or: ca.logic_or,
    np.invert: ca.logic_not,
}
_ONE_BY_ONE = {ufunc: np.frompyfunc(operation, ufunc.nin, 1) for ufunc, operation in _ELEMENTWISE.items()}
_IDENTITY = {np.add: 0.0, np.multiply: 1.0, np.logical_and: True, np.logical_or: False}


class Symbols(np.ndarray[Any, np.dtype[Any]]):
    """An array whose elements are scalar CasADi expressions; also used, with shape (), for scalars.

    Attributes
    ----------
    column : Column or None
        See `hybrid_model.native.symbol_columns`.
    """

    column: Column | None = None

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply a numpy function element by element, or reduce with it."""
        if ufunc is np.matmul and method == "__call__":
            return symbols(np.matmul(*(_plain(given) for given in inputs)))
        operation = _ELEMENTWISE.get(ufunc)
        if operation is None or method not in ("__call__", "reduce", "accumulate"):
            raise TraceError(
                f"np.{ufunc.__name__} ({method}) cannot be traced: write it with arithmetic, np.where, np.minimum, "
                "np.maximum and the elementary functions."
            )
        elementwise = _ONE_BY_ONE[ufunc]
        if method == "__call__":
            return _elementwise(operation, elementwise, inputs, range(ufunc.nin))
        given = [_plain(value) for value in inputs]
        options = {key: value for key, value in options.items() if key in ("axis", "keepdims")}
        if given[0].size == 0 and ufunc in _IDENTITY:
            return symbols(np.full((), _IDENTITY[ufunc], dtype=object))
        whole = method == "reduce" and options.get("axis", 0) is None
        # numpy reduces one axis at a time with functions that it does not know to be commutative.
        total = sum_of(inputs[0]) if whole and ufunc is np.add and isinstance(inputs[0], Symbols) else None
        if whole and (given[0].ndim > 1 or total is not None):
            reduced = symbols(elementwise.reduce(given[0].ravel()) if total is None else total)
            return reduced.reshape((1,) * given[0].ndim) if options.get("keepdims") else reduced
        return symbols(getattr(elementwise, method)(given[0], **options))

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Let numpy rearrange arrays; what compares or computes is written with element-wise functions instead."""
        if function in _REWRITTEN:
            return _REWRITTEN[function](*args, **kwargs)
        result = super().__array_function__(function, types, args, kwargs)
        return symbols(result) if isinstance(result, np.ndarray) and result.dtype == object else result

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, Symbols) or (isinstance(key, tuple) and any(isinstance(k, Symbols) for k in key)):
            raise TraceError(
                "a traced value is used as an index: select by np.where(np.arange(n) == index, ...) and a sum instead."
            )
        return symbols(super().__getitem__(key))

    def __iter__(self) -> Any:
        return (self[k] for k in range(len(self)))

    def __bool__(self) -> bool:
        raise TraceError(
            "a condition on a traced value is used as True or False (if, and, or, not, while, min, max): write "
            "np.where(condition, a, b) for values, least(...) and greatest(...) for sets."
        )

    def __float__(self) -> float:
        raise TraceError(
            "a traced value is converted to a number: use np.sin, np.exp, ... instead of math.sin, ..., and "
            "np.array([...]) instead of writing into np.zeros(...)."
        )

    def __int__(self) -> int:
        raise TraceError("a traced value is converted to an integer: use np.floor instead of int.")


def _where(*args: Any) -> Symbols:
    if len(args) != 3:
        raise TraceError("np.where with a condition only asks for indices: give np.where(condition, a, b).")
    # Which of two numbers a traced condition chooses is an expression all the same.
    return _elementwise(ca.if_else, _CHOOSE, args, range(1))


_CHOOSE = np.frompyfunc(ca.if_else, 3, 1)


def _elementwise(
    operation: Callable[..., Any], one_by_one: Callable[..., Any], given: Sequence[Any], deciding: Sequence[int]
) -> Symbols:
    """Apply an operation to arrays, all elements at once if that can be."""
    arrays = [value if isinstance(value, Symbols) else _plain(value) for value in given]
    if not any(array.ndim for array in arrays):
        return symbols(operation(*(array.item() for array in arrays)))
    found = at_once(operation, arrays, deciding)
    if found is None:
        return symbols(one_by_one(*(_plain(value) for value in arrays)))
    elements, column = found
    result = elements.view(Symbols)
    result.column = column
    return result


def _clip(value: Any, low: Any, high: Any) -> Any:
    return np.minimum(np.maximum(value, low), high)


def _norm(vector: Any) -> Any:
    if np.ndim(vector) != 1:
        raise TraceError("np.linalg.norm can be traced for vectors only: write a matrix norm with arithmetic.")
    return np.sqrt(np.sum(vector * vector))


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Symbols:
    places, values = np.asarray(xp), np.asarray(fp)
    if places.dtype == object or values.dtype == object or period is not None or np.ndim(places) != 1:
        raise TraceError(
            "np.interp can be traced for a table of numbers, without a period only. Remedy: write the pieces with "
            "np.where."
        )
    if len(places) != len(values) or not 1 <= len(places) <= TABLE_MOST or not (np.diff(places) > 0.0).all():
        raise TraceError(
            f"np.interp can be traced for 1 to {TABLE_MOST} places in increasing order, with a value each; it has "
            f"{len(places)} places and {len(values)} values."
        )
    below, above = values[0] if left is None else left, values[-1] if right is None else right

    def at(given: Any) -> Any:
        inside = ca.pw_lin(given, places, values) if len(places) > 1 else values[0]
        return ca.if_else(given < places[0], below, ca.if_else(given > places[-1], above, inside))

    return symbols(np.frompyfunc(at, 1, 1)(_plain(x)))


TABLE_MOST = 1000
"""Places in a table: an evaluation passes all of them."""

_REWRITTEN: dict[Callable[..., Any], Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clip,
    np.linalg.norm: _norm,
    np.interp: _interp,
}


def symbols(value: Any) -> Symbols:
    """Return `value` (an expression, number or array of them) as an array of symbols."""
    if isinstance(value, ca.SX):
        holder = np.empty((), dtype=object)
        holder[()] = value
        return holder.view(Symbols)
    return np.asarray(value, dtype=object).view(Symbols)


def symbol_vector(expression: ca.SX) -> Symbols:
    """Return a CasADi column vector as a one-dimensional array of symbols."""
    return np.fromiter(taken_apart(expression), object, expression.shape[0]).view(Symbols)


def expressions(value: Any) -> list[ca.SX]:
    """Return the elements of a traced value, row by row, as CasADi expressions."""
    elements = np.asarray(_plain(value), dtype=object).ravel()
    return [element if type(element) is ca.SX else ca.SX(element) for element in elements]


def _plain(value: Any) -> Any:
    if isinstance(value, Symbols):
        return value.view(np.ndarray)
    if isinstance(value, ca.SX):
        return symbols(value).view(np.ndarray)
    return np.asarray(value, dtype=object)

"""Formulas in scenario files: arithmetic on names that are given, and nothing else of Python."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hybrid_model.consensus.messages import shown
from hybrid_model.declare.variables import FloatArray

_OPERATORS: dict[type[ast.operator] | type[ast.unaryop], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Mod: operator.mod,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS = {name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "sign", "floor")}
_LONGEST = 1000


class FormulaError(ValueError):
    """A formula that is none, or has no finite values; the message is the end of a sentence."""


def formula_values(text: str, names: Mapping[str, float | FloatArray], count: int) -> list[float]:
    """Evaluate a formula.

    Parameters
    ----------
    text : str
        Numbers, the names, ``pi``, ``+ - * / % **`` and functions such as ``sin(...)``.
    names : mapping
        Name -> a number, or an array of `count` numbers.
    count : int
        Number of values wanted.

    Raises
    ------
    FormulaError
        If it is no such formula, or a value is not finite.
    """
    try:
        if len(text) > _LONGEST:
            raise FormulaError(f"it is longer than {_LONGEST} characters.")
        tree = ast.parse(text.strip(), mode="eval")
        with np.errstate(all="ignore"):
            value = _value(tree.body, {"pi": np.pi, **names})
            values = np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
    except (SyntaxError, RecursionError, MemoryError, OverflowError, ZeroDivisionError) as error:
        raise FormulaError(f"it is no formula: {type(error).__name__}.") from None
    if not np.all(np.isfinite(values)):
        raise FormulaError(f"its value for i = {int(np.argmin(np.isfinite(values))) + 1} is not finite.")
    return [float(number) for number in values]


def _value(node: ast.expr, names: Mapping[str, float | FloatArray]) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        # As a float, so that powers of whole numbers have an end.
        return np.float64(node.value)
    if isinstance(node, ast.Name) and node.id in names:
        return np.asarray(names[node.id], dtype=np.float64)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left, names), _value(node.right, names))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.operand, names))
    match node:
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](_value(argument, names))
    raise FormulaError(
        f"{shown(ast.unparse(node))} is not understood: a formula has numbers, {', '.join(names)}, + - * / % ** and "
        f"{', '.join(_FUNCTIONS)}."
    )

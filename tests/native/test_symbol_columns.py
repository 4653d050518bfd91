"""Expressions that are made column by column are those made one by one, and follow what is written into arrays."""

import casadi as ca
import numpy as np
import pytest

from hybrid_model.native import symbol_columns
from hybrid_model.native.symbols import expressions, symbol_vector

SIZE = 12
NUMBERS = np.arange(float(SIZE))
FUNCTIONS = {
    "arithmetic": lambda x, y: (x + y) * x - y / (1.0 + x**2) - 2 * x + NUMBERS * y,
    "powers": lambda x, y: x**NUMBERS + 2.0**y + x**0.5,
    "elementary": lambda x, y: np.sin(x) * np.exp(-(x**2)) + np.mod(x, 3.0) + np.hypot(x, y[0]) + np.sign(y),
    "choice": lambda x, y: np.where(x > y, x, np.where(y[3] >= NUMBERS, 1.0, NUMBERS)),
    "logic": lambda x, y: np.where(np.logical_not(x > 0) | (x < -1), 1.0, 0.0),
    "extremes": lambda x, y: np.minimum(x, y) + np.clip(x, -1.0, 1.0) + np.max(x),
    "sums": lambda x, y: np.sum(x * y) + np.sum(np.stack([x, y])) + np.sum(x[:, None] * y[None, :], axis=0),
    "sums in shape": lambda x, y: np.sum(np.stack([x, y]), keepdims=True) + x.mean(),
    "zeros": lambda x, y: (x - x) * y + np.sum(x * np.zeros(SIZE)),
    "mixed": lambda x, y: np.concatenate([x[:5], NUMBERS[:7]]) * y + np.concatenate([x[:5], NUMBERS[:7]]),
    "no elements": lambda x, y: np.sum(x[:0]) + x[:0] * y[:0],
}


def made(name):
    x, y = ca.SX.sym("x", SIZE), ca.SX.sym("y", SIZE)
    result = FUNCTIONS[name](symbol_vector(x), symbol_vector(y))
    return np.shape(result), ca.Function("f", [x, y], [ca.vertcat(ca.SX(0, 1), *expressions(result))]).serialize()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_columns_give_the_expressions_of_their_elements(name, monkeypatch):
    at_once = made(name)
    monkeypatch.setattr(symbol_columns, "FEWEST", 10**9)
    assert at_once == made(name)


def test_what_is_written_into_an_array_is_in_what_is_computed_from_then_on():
    x = ca.SX.sym("x", SIZE)
    vector = symbol_vector(x)
    doubled = 2.0 * vector
    doubled[3] = vector[0]
    part = doubled[5:]
    part[0] = vector[1]
    function = ca.Function("f", [x], [ca.vertcat(*expressions(np.sin(doubled)))])
    wanted = 2.0 * NUMBERS
    wanted[[3, 5]] = NUMBERS[[0, 1]]
    np.testing.assert_allclose(np.ravel(function(NUMBERS)), np.sin(wanted), rtol=0.0, atol=1e-15)


def test_a_sum_of_hundreds_of_expressions_takes_few_calls(monkeypatch):
    calls = []
    operation = ca.SX.__mul__
    monkeypatch.setattr(ca.SX, "__mul__", lambda a, b: calls.append(1) or operation(a, b))
    x = symbol_vector(ca.SX.sym("x", 300))
    np.sum(x * x * x)
    assert len(calls) == 2

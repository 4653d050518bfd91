"""The coefficients of Dormand-Prince 8(5, 3), read from the engine's C: order conditions over all rooted trees."""

import functools
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from oracles.rooted_trees import density, size, trees

import hybrid_model

SOURCE = Path(hybrid_model.__file__).parent / "engine" / "methods" / "dormand_prince.h"
STEP, STAGES = 12, 16
# Coefficients of up to 43 with 16 digits.
ROUNDING = 1e-13


def number(entry):
    above, _, below = entry.partition("/")
    return float(Fraction(above.strip()) / Fraction(below.strip() or "1"))


@functools.cache
def table(name):
    """The rows of a table of the C file, filled up with zeros as C does it."""
    body = re.search(rf"double {name}\[.*?= \{{(.*?)\}};", SOURCE.read_text(), re.DOTALL)[1]
    rows = re.findall(r"\{([^{}]*)\}", body) or [body]
    numbers = [[number(entry) for entry in row.split(",") if entry.strip()] for row in rows]
    return np.array([row + [0.0] * (STAGES - len(row)) for row in numbers])


@functools.cache
def weight(tree):
    """What the stages make of a tree: the weights of a method times this are to be 1 / density."""
    return np.prod([table("TABLE") @ weight(branch) for branch in tree], axis=0) if tree else np.ones(STAGES)


def worst(weights, order, part=1.0):
    """The largest error in the conditions of an order, at a part of the step."""
    return max(abs(weights @ weight(tree) - part**order / density(tree)) for tree in trees(order))


def step():
    return table("TABLE")[STEP]


def test_there_are_as_many_trees_as_known():
    assert [len(trees(order)) for order in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]
    assert {size(tree) for tree in trees(7)} == {7}


def test_nodes_are_row_sums():
    np.testing.assert_allclose(table("NODE")[0], table("TABLE").sum(axis=1), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(("name", "order"), [(None, 8), ("FIFTH", 5), ("THIRD", 3)])
def test_the_step_and_those_that_tell_its_error_have_their_orders_and_no_higher_one(name, order):
    weights = step() - (table(name)[0] if name else 0.0)
    assert max(worst(weights, k) for k in range(1, order + 1)) < ROUNDING
    assert worst(weights, order + 1) > 1e-7


@pytest.mark.parametrize("part", np.linspace(0.1, 1.0, 10))
def test_the_interpolation_has_order_seven(part):
    a, b = part, 1.0 - part
    first, end = np.eye(STAGES)[0], np.eye(STAGES)[STEP]
    vectors = [step(), first - step(), 2.0 * step() - end - first, *table("DENSE")]
    weights = np.zeros(STAGES)
    for k, vector in reversed(list(enumerate(vectors))):
        weights = (b if k % 2 else a) * (vector + weights)
    assert max(worst(weights, order, part) for order in range(1, 8)) < 50.0 * ROUNDING
    if part < 1.0:
        assert worst(weights, 8, part) > 1e-9

"""The coefficients of Rodas5P, read from the engine's C: order conditions over all rooted trees, and stability."""

import functools
import re
from pathlib import Path

import numpy as np
import pytest
from oracles.rooted_trees import density, size, trees

import hybrid_model

SOURCE = Path(hybrid_model.__file__).parent / "engine" / "methods" / "rodas.c"
# The coefficients are given to 16 digits, those in products up to 170 of size.
ROUNDING = 2e-13


def table(name, width):
    """The rows of a table of the C file, filled up with zeros as C does it."""
    body = re.search(rf"double {name}\[.*?= \{{(.*?)\}};", SOURCE.read_text(), re.DOTALL)[1]
    rows = re.findall(r"\{([^{}]*)\}", body) or [body]
    numbers = [[float(entry) for entry in row.split(",") if entry.strip()] for row in rows]
    return np.array([row + [0.0] * (width - len(row)) for row in numbers])


@functools.cache
def classical():
    """gamma, alpha, beta and b of HW's equation (7.4), from the form without products of matrix and vector (7.25)."""
    gamma = float(re.search(r"double GAMMA = (.*?);", SOURCE.read_text())[1])
    state, coupling = table("STATE", 8), table("COUPLING", 8)
    gammas = np.linalg.inv(np.eye(8) / gamma - coupling)
    alpha = state @ gammas
    beta = alpha + gammas
    # The last stage's argument is the solution of order 4; with the stage itself it is the step.
    lower = state[7] @ gammas
    return gamma, alpha, beta, lower + gammas[7], lower


def weight(tree):
    """Per stage: a single branch goes by beta, several by alpha (HW II, theorem IV.7.4)."""
    _, alpha, beta, *_ = classical()
    if len(tree) == 1:
        return beta @ weight(tree[0])
    return np.prod([alpha @ weight(branch) for branch in tree], axis=0) if tree else np.ones(8)


@pytest.mark.parametrize("tree", [tree for order in range(1, 6) for tree in trees(order)], ids=str)
def test_the_step_has_order_five(tree):
    *_, b, _ = classical()
    assert b @ weight(tree) == pytest.approx(1.0 / density(tree), abs=ROUNDING)


@pytest.mark.parametrize("tree", [tree for order in range(1, 5) for tree in trees(order)], ids=str)
def test_the_solution_that_tells_the_error_has_order_four(tree):
    *_, lower = classical()
    assert lower @ weight(tree) == pytest.approx(1.0 / density(tree), abs=ROUNDING)


def test_neither_has_a_higher_order():
    *_, b, lower = classical()
    assert max(abs(b @ weight(tree) - 1.0 / density(tree)) for tree in trees(6)) > 1e-3
    assert max(abs(lower @ weight(tree) - 1.0 / density(tree)) for tree in trees(5)) > 1e-3


def test_nodes_and_factors_of_the_change_in_time_are_row_sums():
    _, alpha, beta, *_ = classical()
    assert table("NODE", 8)[0] == pytest.approx(alpha.sum(axis=1), abs=ROUNDING)
    assert table("DRIFT", 8)[0] == pytest.approx((beta - alpha).sum(axis=1), abs=ROUNDING)


def growth(z):
    """What a step makes of x' = lambda x, with z = h lambda."""
    _, _, beta, b, _ = classical()
    return 1.0 + z * (b @ np.linalg.solve(np.eye(8) - z * beta, np.ones(8)))


def test_it_is_a_stable():
    # |R| <= 1 on the imaginary axis, and no pole on the left: all are at 1/gamma.
    assert max(abs(growth(1j * y)) for y in np.geomspace(1e-3, 1e6, 4000)) <= 1.0 + 1e-12
    assert max(abs(growth(-np.exp(1j * angle) * r)) for angle in (-1.5, -1.0, 0.0, 1.0, 1.5) for r in (1, 10, 1e3)) < 1


def test_what_is_infinitely_fast_is_gone_after_a_step():
    # L-stable, and stiffly accurate: the step is the last row.
    _, _, beta, b, _ = classical()
    assert abs(growth(-1e6)) < 1e-4
    assert abs(growth(-1e9)) < 1e-7
    assert b == pytest.approx(beta[7], abs=ROUNDING)


@pytest.mark.parametrize("part", np.linspace(0.1, 0.9, 9))
def test_the_interpolation_has_order_four(part):
    # Weights of the stages u at part a of the step: with row m of the step, a (m + (1 - a)(e1 + a (e2 + a e3))).
    gamma, _, _, _, _ = classical()
    state, coupling = table("STATE", 8), table("COUPLING", 8)
    step = np.append(state[7, :7], 1.0)
    e1, e2, e3 = table("DENSE", 8)
    weights = part * (step + (1.0 - part) * (e1 + part * (e2 + part * e3)))
    b = weights @ np.linalg.inv(np.eye(8) / gamma - coupling)
    for tree in (tree for order in range(1, 5) for tree in trees(order)):
        assert b @ weight(tree) == pytest.approx(part ** size(tree) / density(tree), abs=ROUNDING)

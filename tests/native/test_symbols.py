"""Symbols behave like numpy arrays: the same code, called with floats and with symbols, gives the same numbers."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid_model as hm
from hybrid_model.errors import TraceError
from hybrid_model.native.symbols import expressions, symbol_vector
from hybrid_model.native.trace import trace

FUNCTIONS = {
    "arithmetic": lambda x, y: (x + y) * x - y / (1.0 + x**2) - 2.0 * x,
    "elementary": lambda x, y: np.sin(x) + np.cos(y) * np.exp(-(x**2)) + np.sqrt(np.abs(y)) + np.tanh(x),
    "floor": lambda x, y: np.floor(x) + np.ceil(y) + np.mod(x, 3.0) + np.sign(y),
    "remainder of negatives": lambda x, y: np.mod(-np.abs(x), 2.5) + np.mod(np.abs(y), -2.5),
    "choice": lambda x, y: np.where(x > y, x, np.where(y >= 1.0, 1.0, -y)),
    "logic": lambda x, y: np.where(np.logical_and(x > 0, y > 0) | (x < -1), 1.0, 0.0),
    "extremes": lambda x, y: np.minimum(x, y) + np.maximum(x, 0.5) + np.clip(x, -1.0, 1.0),
    "reductions": lambda x, y: np.sum(x * y) + np.min(x) + np.max(y) + x.sum() + np.prod(x),
    "products": lambda x, y: x @ y + np.sum(np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 0.0]]) @ x) + np.dot(x, y),
    "shapes": lambda x, y: np.stack([x, y]).reshape(3, 2)[1] * np.concatenate([x, y])[2:4] + x[::-1][:2],
    "broadcast": lambda x, y: np.sum(x[:, None] * y[None, :], axis=0) + np.arange(3.0),
    "elements": lambda x, y: x[0] * y[1] - x[2] + np.hypot(x[1], y[0]) + np.arctan2(x[0], y[2]),
    "loop": lambda x, y: sum(a * b for a, b in zip(x, y, strict=True)) + len(x),
    "norm": lambda x, y: np.linalg.norm(x - y),
}
NUMBERS = st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-6)


@pytest.mark.parametrize("name", FUNCTIONS)
@settings(max_examples=40, deadline=None)
@given(x=st.lists(NUMBERS, min_size=3, max_size=3), y=st.lists(NUMBERS, min_size=3, max_size=3))
def test_symbols_give_the_numbers_that_numpy_gives(name, x, y):
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 3)
    traced = FUNCTIONS[name](symbol_vector(a), symbol_vector(b))
    expected = np.asarray(FUNCTIONS[name](np.array(x), np.array(y)), dtype=float)
    assert np.shape(traced) == expected.shape
    function = ca.Function("f", [a, b], [ca.vertcat(*expressions(traced))])
    # One rounding differs where numpy sums in another order than the trace.
    np.testing.assert_allclose(np.ravel(function(x, y)), expected.ravel(), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("attempt", "sentence"),
    [
        (lambda x: 1.0 if x[0] > 0 else 0.0, "np.where"),
        (lambda x: max(x[0], x[1]), "least"),
        (lambda x: float(x[0]), "np.sin, np.exp"),
        (lambda x: int(x[0]), "np.floor"),
        (lambda x: x[x[0]], "used as an index"),
        (lambda x: np.where(x > 0), "only asks for indices"),
        (lambda x: np.arcsinh(x), "np.arcsinh"),
    ],
)
def test_what_cannot_be_traced_is_refused_with_what_to_write(attempt, sentence):
    with pytest.raises(TraceError, match=sentence):
        attempt(symbol_vector(ca.SX.sym("x", 3)))


@pytest.mark.parametrize("reduce", [np.sum, np.max, np.min, np.prod])
def test_a_matrix_is_reduced_whole_and_by_axis(reduce):
    class Reduced(hm.HybridAutomaton):
        m = hm.Parameter([[1.5, -2.0, 3.0], [4.0, 5.5, -6.0]])
        whole = hm.Output()
        kept = hm.Output()

        def outputs(self, s):
            return {"whole": reduce(s.m), "kept": np.sum(reduce(s.m, axis=1)) + np.sum(reduce(s.m, keepdims=True))}

    automaton = Reduced()
    run = hm.Execution(automaton)
    traced = trace(automaton).outputs(0.0, [], [], [], run.p)
    expected = automaton.output_values(run.values())
    assert np.asarray(traced).ravel() == pytest.approx([float(expected["whole"]), float(expected["kept"])])

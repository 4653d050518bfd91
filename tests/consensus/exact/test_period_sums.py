"""Sums over many periods at a time against the sums one by one."""

import numpy as np
import pytest
from drawing import examples
from hypothesis import given
from hypothesis import strategies as st

from hybrid_model.consensus.exact.period_sums import support_over_periods


def one_by_one(generators, monodromy, directions, tail):
    values, now, first = 0.0, directions, np.linalg.norm(directions, axis=0)
    while np.any(np.linalg.norm(now, axis=0) > tail * first):
        values += np.abs(generators @ now).sum(axis=0)
        now = monodromy.T @ now
    return values + np.abs(generators @ now).sum(axis=0)


def drawn(seed, size, slowest, spread, turning):
    """Generators, and a monodromy matrix with real eigenvalues down from `slowest`, or a slow pair that turns."""
    random = np.random.default_rng(seed)
    values = slowest ** (spread ** np.arange(size))
    vectors = np.linalg.qr(random.standard_normal((size, size)))[0] + 0.3 * random.standard_normal((size, size))
    blocks = np.diag(values)
    if turning and size > 1:
        cosine, sine = slowest * np.cos(turning), slowest * np.sin(turning)
        blocks[:2, :2] = [[cosine, -sine], [sine, cosine]]
    monodromy = vectors @ blocks @ np.linalg.inv(vectors)
    return random.standard_normal((60, size)), monodromy, random.standard_normal((size, 5))


@examples(12, 60)
@given(
    seed=st.integers(0, 10_000),
    size=st.integers(1, 5),
    slowest=st.sampled_from([0.3, 0.9, 0.99, 0.999]),
    spread=st.sampled_from([1.01, 1.3, 3.0]),
    turning=st.sampled_from([0.0, 0.0, 1e-3, 0.1, 2.0]),
    tail=st.sampled_from([1e-3, 1e-11]),
)
def test_values_are_those_of_the_periods_one_by_one(seed, size, slowest, spread, turning, tail):
    generators, monodromy, directions = drawn(seed, size, slowest, spread, turning)
    values, points = support_over_periods(generators, monodromy, directions, tail)
    # Errors that are admissible reach the value, and nothing beyond it.
    np.testing.assert_allclose(np.einsum("ic,ic->c", directions, points), values, rtol=1e-8)
    whole = one_by_one(generators, monodromy, directions, 1e-14)
    assert np.all(values <= whole * (1 + 1e-9))
    # What earlier periods than the tail add, and what is lost where signs turn.
    assert np.all(values >= whole * (1 - 10 * tail - np.sqrt(tail)))


def test_a_billion_periods_are_summed_at_once():
    """A geometric series: without memory of the number of periods, 1/(1 - m)."""
    slow = 1 - 1e-7
    values, points = support_over_periods(np.array([[1.0]]), np.array([[slow]]), np.array([[2.0]]), 1e-12)
    assert values == pytest.approx([2e7], rel=1e-8)
    assert points == pytest.approx(np.array([[1e7]]), rel=1e-8)


def test_what_does_not_vanish_is_refused():
    with pytest.raises(ValueError, match="does not vanish"):
        support_over_periods(np.array([[1.0]]), np.array([[1.0]]), np.array([[1.0]]))

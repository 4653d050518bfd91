"""Repetitions in sequences: found where they are, as long as they are, and nowhere else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid_model.native.repeated_runs import repeated_runs


@pytest.mark.parametrize(
    ("keys", "found"),
    [
        ([7] * 5, [(0, 1, 5)]),
        ([1, 2, 3] * 6, [(0, 3, 6)]),
        ([9, 8, *[1, 2, 3] * 6, 1, 2, 5], [(2, 3, 6)]),
        ([1, 2, 3, 4, 5, 6, 7], []),
        ([1, 2, 3] * 4, []),
        ([*[1, 2] * 5, 3, *[4, 5, 6, 7] * 5, 9], [(0, 2, 5), (11, 4, 5)]),
        # Pairs within the period are too few to be runs themselves.
        ([1, 1, 2, 2, 3] * 5, [(0, 5, 5)]),
        ([], []),
        ([1], []),
    ],
)
def test_repetitions_of_five_and_more(keys, found):
    assert repeated_runs(np.array(keys, dtype=np.int64), 5) == found


@settings(max_examples=60, deadline=None)
@given(
    before=st.lists(st.integers(0, 3), max_size=5),
    period=st.lists(st.integers(0, 3), min_size=1, max_size=6),
    count=st.integers(6, 9),
    after=st.lists(st.integers(0, 3), max_size=5),
)
def test_runs_repeat_themselves_in_order_and_nothing_long_is_missed(before, period, count, after):
    keys = [*before, *period * count, *after]
    runs = repeated_runs(np.array(keys, dtype=np.int64), 4)
    stop = 0
    for run in runs:
        assert run.start >= stop
        assert run.times >= 4
        repetition = keys[run.start : run.start + run.length]
        assert keys[run.start : run.stop] == repetition * run.times
        stop = run.stop
    # A run that begins before may end within the first of the repetitions, or the second.
    assert any(run.stop > len(before) + 2 * len(period) for run in runs)

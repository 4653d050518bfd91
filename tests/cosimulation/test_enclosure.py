"""Where steps are to end while an event is enclosed: few steps where slaves tell, and an end whatever they tell."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.masters.enclosure import Enclosure

RESOLUTION = 1e-13


def enclosed(event, told):
    """Return between which times an event is enclosed, and in how many steps, if `told(t, end)` is what is said."""
    enclosure, t = Enclosure(RESOLUTION), 0.0
    for steps in itertools.count(1):
        end = enclosure.aim(t, 1.0)
        assert t < end <= 1.0
        if event <= end and end - t <= 2.0 * RESOLUTION:
            return t, end, steps
        if event <= end:
            enclosure.missed(t, end, told(t, end))
        else:
            t = end
            enclosure.passed(t)


@pytest.mark.parametrize("event", [0.3, 0.71, 0.999, 1e-3])
def test_what_is_told_spares_most_steps(event):
    """A slave is off by a part of the step's square, as with inputs that stand still; or says nothing."""
    t, end, steps = enclosed(event, lambda t, end: min(event + 1e-3 * (end - t) ** 2, end))
    assert t <= event <= end
    # Each time that the step is a thousandth, one that ends before, one behind, and one that is not long enough.
    assert steps <= 25
    t, end, halvings = enclosed(event, lambda t, end: None)
    assert t <= event <= end
    # Each halving is a step, and each fourth that finds nothing is followed by a look.
    assert math.log2(1.0 / RESOLUTION) - 1 <= halvings <= 70


@settings(max_examples=20)
@given(st.floats(1e-6, 1.0), st.randoms(use_true_random=False))
def test_whatever_is_told_the_event_is_enclosed(event, random):
    t, end, steps = enclosed(event, lambda t, end: random.uniform(t, end))
    assert t <= event <= end
    assert steps < 1000


def test_what_is_not_there_any_more_is_forgotten():
    enclosure = Enclosure(RESOLUTION)
    enclosure.missed(0.0, 1.0, None)
    t, ends = 0.0, []
    while enclosure.active:
        t = enclosure.aim(t, 2.0)
        enclosure.passed(t)
        ends.append(t)
    assert ends == [0.5, 0.75, 0.875, 1.0]
    assert enclosure.aim(1.0, 2.0) == 2.0

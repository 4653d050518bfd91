"""Sets given as yes or no: each form is answered by what to write instead."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.errors import TraceError
from hybrid_model.models import BouncingBall
from hybrid_model.native.trace import trace


def ball(flow_set=None, jump_set=None):
    """The bouncing ball with another set."""
    sets = {}
    if flow_set:
        sets["flow_set"] = lambda self, s: flow_set(s)
    if jump_set:
        sets["jump_set"] = lambda self, s: jump_set(s)
    return type("Ball", (BouncingBall,), sets)()


FORMS = {
    "comparison": lambda s: s.h <= 0.0,
    "python whole number": lambda s: 1 if s.h <= 0.0 else 0,
    "numpy whole number": lambda s: (s.h <= 0.0) * 1,
    "numpy array": lambda s: np.array(s.h <= 0.0),
    "where": lambda s: np.where(s.h <= 0.0, 1, 0),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_jump_set_that_says_yes_or_no(form):
    with pytest.raises(hm.DeclarationError, match="return a margin instead"):
        hm.simulate(ball(jump_set=FORMS[form]), 1.0)


@pytest.mark.parametrize("form", ["comparison", "numpy array"])
def test_a_flow_set_that_says_yes_or_no(form):
    with pytest.raises(hm.DeclarationError, match="return a margin instead"):
        hm.simulate(ball(flow_set=FORMS[form]), 1.0)


def test_a_flow_set_of_zeros_and_ones_as_floats():
    # 0.0 is a margin of the set's border, so the ball would fall through the floor without a word.
    falling = ball(flow_set=lambda s: np.where(s.h >= 0.0, 1.0, 0.0), jump_set=lambda s: -1.0)
    with pytest.raises(hm.SimulationError, match="margin of the flow set is 0 or 1 along the flow"):
        hm.simulate(falling, 2.0)


def test_a_jump_set_of_zeros_and_ones_as_floats_stops_at_once_and_says_why():
    arc = hm.simulate(ball(jump_set=lambda s: np.where(s.h <= 0.0, 1.0, 0.0)), 1.0)
    assert arc.stop is hm.Stop.ZENO
    assert "a set given as 0 outside and 1 inside" in arc.message


@pytest.mark.parametrize(
    "condition",
    [
        lambda s: s.h <= 0.0,
        lambda s: (s.h <= 0.0) & (s.v <= 0.0),
        lambda s: np.logical_not(s.h > 0.0),
        lambda s: s.h == 0.0,
    ],
)
def test_a_traced_comparison_is_refused(condition):
    with pytest.raises(TraceError, match="is a comparison: return a margin instead"):
        trace(ball(jump_set=condition))


def test_margins_that_touch_zero_and_one_by_chance_are_none():
    """x rises from 0 to 1: its margin is 0 at the start of the step and 1 at its end, and a margin."""

    class Rising(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def flow_set(self, s):
            return s.x

    assert hm.simulate(Rising(), 1.0).stop is hm.Stop.HORIZON

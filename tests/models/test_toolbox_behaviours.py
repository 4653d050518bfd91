"""Behaviours that the HyEQ Toolbox documents beside its examples: overlapping sets, and the causes that end a run."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall

# Exponentials up to 9, each to the solver's relative 1e-13.
ROUNDING = 1e-11


class Overlap(hm.HybridAutomaton):
    """The toolbox's example of behaviour in the intersection of C and D.

    ``x' = x`` on C = [1, 3] and [5, 9]; ``x+ = round(x + 1)`` on D = {0} and [2, 6], and ``x+ = 0`` at x = 7.
    """

    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": s.x}

    def flow_set(self, s):
        return hm.greatest(hm.least(s.x - 1.0, 3.0 - s.x), hm.least(s.x - 5.0, 9.0 - s.x))

    def jump_set(self, s):
        return hm.greatest(-abs(s.x), hm.least(s.x - 2.0, 6.0 - s.x), -abs(s.x - 7.0))

    def jump_map(self, s):
        return {"x": np.where(s.x > 6.5, 0.0, np.floor(s.x + 1.5))}


class PatientOverlap(Overlap):
    priority = hm.Priority.FLOW


def test_with_jump_priority_the_overlap_is_left_at_once():
    arc = hm.simulate(Overlap(), 2.5 * np.log(2.0))
    # 0 -> 1, a flow to 2 where D begins, and up by jumps to 7, which resets to 0.
    cycle = [1.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0]
    assert [jump.x_after[0] for jump in arc.jumps] == [*cycle, *cycle, 1.0]
    expected = np.repeat(np.arange(3), [1, 7, 7])[: len(arc.jumps)] * np.log(2.0)
    assert [jump.t for jump in arc.jumps] == pytest.approx(expected, abs=ROUNDING)


def test_with_flow_priority_it_flows_through_the_overlap_and_ends_where_it_leaves_both_sets():
    arc = hm.simulate(PatientOverlap(), 10.0)
    # 0 -> 1, a flow to 3 where C ends, 3 -> 4 -> 5, and a flow to 9, through D's point 7.
    assert [jump.x_after[0] for jump in arc.jumps] == [1.0, 4.0, 5.0]
    assert [jump.t for jump in arc.jumps] == pytest.approx([0.0, np.log(3.0), np.log(3.0)], abs=ROUNDING)
    assert arc.stop is hm.Stop.BLOCKED
    # The flow set may be overstepped by 1e-9 of the state's size.
    assert arc.end.x == pytest.approx(9.0, rel=2e-9)
    assert arc.t[-1] == pytest.approx(np.log(3.0) + np.log(9.0 / 5.0), abs=2e-9)


def test_the_end_time_ends_a_run():
    assert hm.simulate(BouncingBall(), 0.1).stop is hm.Stop.HORIZON


def test_the_number_of_jumps_ends_a_run():
    arc = hm.simulate(BouncingBall(), 60.0, zeno=hm.ZenoGuard(max_jumps=5))
    assert arc.stop is hm.Stop.JUMPS
    assert len(arc.jumps) == 5


class Escape(hm.HybridAutomaton):
    """``x' = x^2`` from 1: grows beyond all bounds at t = 1."""

    x = hm.State(1.0)

    def flow_map(self, s):
        return {"x": s.x * s.x}


def test_a_state_that_grows_beyond_all_bounds_is_an_error_that_names_the_time():
    arc = hm.simulate(Escape(), 0.9)
    assert arc.end.x == pytest.approx(10.0, rel=1e-10)
    with pytest.raises(hm.SimulationError, match=r"Escape.* t = (1|0\.99999)"):
        hm.simulate(Escape(), 2.0)


def test_a_state_that_is_not_a_number_is_an_error_that_names_it():
    class Undefined(Escape):
        def flow_map(self, s):
            return {"x": np.sqrt(1.5 - s.x) - 3.0 + 3.0 * s.x}

    with pytest.raises(hm.SimulationError, match=r"Undefined"):
        hm.simulate(Undefined(), 2.0)

"""The switched feedback against matrix exponentials and a root finder."""

import numpy as np
import pytest
from oracles.affine_modes import AffineMode

import hybrid_model as hm
from hybrid_model.models import SwitchedFeedback

LOOPS = (AffineMode([[0.0, 1.0], [-1.0, -1.0]]), AffineMode([[0.0, 1.0], [2.0, -1.0]]))
# Ten flights, each to the solver's 1e-13, over radial speeds of at least 0.1 per s.
ROUNDING = 1e-10


def switches(start, count):
    """Times, names and states: inward with loop 0 to the radius 1, outward with loop 1 to the radius 3."""
    t, x, q, found = 0.0, np.array(start), 0, []
    for _ in range(count):
        radius, sign = (1.0, -1.0) if q == 0 else (3.0, 1.0)
        tau = LOOPS[q].first_rise(x, lambda z, r=radius, s=sign: s * (z @ z - r * r), 20.0, pieces=800)
        t, x, q = t + tau, LOOPS[q].at(x, tau), 1 - q
        found.append((t, ("switch.use_0", "switch.use_1")[q], x))
    return found


@pytest.mark.parametrize("start", [(10.0, 0.0), (-3.0, 4.0)])
def test_switching_times_and_states(start):
    exact = switches(start, 10)
    arc = hm.simulate(SwitchedFeedback(start=start), exact[-1][0] + 1e-3)
    # It starts with feedback 1 outside the outer circle, so it changes at once.
    assert (arc.jumps[0].t, arc.jumps[0].name) == (0.0, "switch.use_0")
    assert [jump.name for jump in arc.jumps[1:]] == [name for _, name, _ in exact]
    assert [jump.t for jump in arc.jumps[1:]] == pytest.approx([t for t, _, _ in exact], abs=ROUNDING)
    assert np.array([jump.x_after for jump in arc.jumps[1:]]) == pytest.approx(
        np.array([x for _, _, x in exact]), abs=ROUNDING
    )


def test_the_feedback_passed_on_is_the_chosen_one():
    arc = hm.simulate(SwitchedFeedback(), 15.0)
    x, q = arc["plant.x"], arc["switch.q"]
    expected = np.where(q > 0.5, x @ [2.0, -1.0], x @ [-1.0, -1.0])
    assert arc["switch.u"] == pytest.approx(expected, abs=1e-14)
    assert set(q) == {0.0, 1.0}

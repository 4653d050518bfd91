"""The ball that comes to rest, against the closed form of its impacts."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall, RestingBall

G, E = 9.81, 0.7


def impacts(slowest):
    """Impact times up to and with the one that is too slow."""
    speed = np.sqrt(2.0 * G)
    count = int(np.floor(np.log(slowest / speed) / np.log(E))) + 1
    rebounds = speed * E ** np.arange(1, count)
    return np.cumsum([speed / G, *(2.0 * rebounds / G)])


@pytest.mark.parametrize("slowest", [2.0, 0.3, 0.01])
def test_it_rests_after_the_first_impact_that_is_too_slow(slowest):
    times = impacts(slowest)
    arc = hm.simulate(RestingBall(slowest=slowest), 10.0)
    assert [jump.name for jump in arc.jumps] == ["impact"] * (len(times) - 1) + ["rest"]
    # Each flight is a parabola, exact up to the rounding of a few hundred operations near 1.
    assert [jump.t for jump in arc.jumps] == pytest.approx(times, abs=1e-12)
    assert arc.stop is hm.Stop.HORIZON
    assert (arc.end.h, arc.end.v, arc.end.mode) == (0.0, 0.0, 1.0)


def test_until_then_it_is_the_bouncing_ball():
    times = impacts(0.3)
    modal, plain = hm.simulate(RestingBall(slowest=0.3), times[-1]), hm.simulate(BouncingBall(), times[-1])
    assert [jump.t for jump in modal.jumps] == [jump.t for jump in plain.jumps]
    grid = np.linspace(0.0, times[-1], 57)[:-1]
    assert np.array_equal(modal.at("h", grid), plain.at("h", grid))

"""The ball under the period controller against its recursion."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import JuggledBall

G, E, GAIN = 9.8, 0.7, 0.5
# Forty parabolas, exact up to rounding, of speeds up to 13 m/s.
ROUNDING = 1e-11


def impacts(period, count):
    """Times, rebound speeds and corrected pushes: the push of an impact was computed from the flight before it."""
    t = np.sqrt(2.0 / G)
    v, push, flight, found = np.sqrt(2.0 * G), 0.0, t, []
    for _ in range(count):
        v = E * v + push
        push = max(0.0, push + GAIN * (period - flight))
        found.append((t, v, push))
        flight = 2.0 * v / G
        t += flight
    return np.array(found)


@pytest.mark.parametrize("period", [0.5, 2.0])
def test_impacts_follow_the_recursion(period):
    exact = impacts(period, 40)
    arc = hm.simulate(JuggledBall(period=period), exact[-1, 0] + 1e-3)
    assert [jump.name for jump in arc.jumps] == ["ball.jump", "controller.jump"] * 40
    assert arc.event_times("ball.jump") == pytest.approx(exact[:, 0], abs=ROUNDING)
    after = [arc.after(jump) for jump in arc.jumps if jump.name == "controller.jump"]
    assert [s["ball.v"] for s in after] == pytest.approx(exact[:, 1], abs=ROUNDING)
    assert [s["controller.push"] for s in after] == pytest.approx(exact[:, 2], abs=ROUNDING)


def test_the_period_converges_to_the_one_wanted():
    exact = impacts(2.0, 250)
    arc = hm.simulate(JuggledBall(), exact[-1, 0] + 0.1)
    # The determinant 0.802 of the map shrinks errors by its root 0.896 per impact: 250 of them are below 1e-11.
    assert np.diff(arc.event_times("ball.jump"))[-1] == pytest.approx(2.0, abs=1e-9)
    assert arc.end["controller.push"] == pytest.approx((1 - E) * G, abs=1e-9)

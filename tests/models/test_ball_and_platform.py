"""The ball and the platform against matrix exponentials of both together."""

import numpy as np
import pytest
from oracles.affine_modes import AffineMode

import hybrid_model as hm
from hybrid_model.models import BallAndPlatform

G, E, RATE = 0.8, 0.8, 1.0
# Ten flights, each to the solver's 1e-13; the slowest impact approaches at some 0.1 m/s.
ROUNDING = 1e-10


def flight(drive):
    """Both together: h, v, y, w, and the drive as an oscillator."""
    matrix = np.zeros((6, 6))
    matrix[0, 1] = matrix[2, 3] = 1.0
    matrix[3, 2:5] = -1.0, -2.0, drive
    matrix[4, 5], matrix[5, 4] = RATE, -RATE
    return AffineMode(matrix, [0.0, -G, 0.0, 0.0, 0.0, 0.0])


def impacts(drive, height, count):
    mode, t, x, found = flight(drive), 0.0, np.array([height, 0.0, 0.0, 0.0, 0.0, 1.0]), []
    for _ in range(count):
        tau = mode.first_rise(x, lambda z: z[2] - z[0], 20.0, pieces=20000)
        t, x = t + tau, mode.at(x, tau)
        x[1], x[3] = E * abs(x[1]), -E * abs(x[3])
        found.append((t, *x[:4]))
    return np.array(found)


@pytest.mark.parametrize(("drive", "height"), [(0.0, 1.0), (0.5, 1.0), (0.5, 2.0)])
def test_impacts_against_matrix_exponentials(drive, height):
    exact = impacts(drive, height, 8)
    arc = hm.simulate(BallAndPlatform(drive=drive, height=height), exact[-1, 0] + 1e-6)
    assert [jump.name for jump in arc.jumps] == ["ball.jump", "platform.jump"] * 8
    assert arc.event_times("ball.jump") == pytest.approx(exact[:, 0], abs=ROUNDING)
    assert np.array_equal(arc.event_times("platform.jump"), arc.event_times("ball.jump"))
    after = [arc.after(jump) for jump in arc.jumps if jump.name == "platform.jump"]
    states = np.array([[s["ball.h"], s["ball.v"], s["platform.y"], s["platform.w"]] for s in after])
    assert states == pytest.approx(exact[:, 1:], abs=ROUNDING)


def test_the_ball_stays_above_the_platform():
    arc = hm.simulate(BallAndPlatform(), 12.0)
    t = np.linspace(0.0, arc.t[-1], 1201)
    assert np.min(arc.at("ball.h", t) - arc.at("platform.y", t)) >= -1e-12


def test_without_drive_the_platform_stays_at_rest_until_the_first_impact_and_after():
    # An impact reverses the platform's own velocity only, as in the toolbox: at rest it stays at rest.
    arc = hm.simulate(BallAndPlatform(drive=0.0), 5.0)
    assert len(arc.jumps) > 2
    assert np.all(arc["platform.y"] == 0.0)
    assert arc.event_times("ball.jump")[0] == pytest.approx(np.sqrt(2.0 / G), abs=1e-13)

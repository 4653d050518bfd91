"""The vehicle on its lane against sine and cosine integrals."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import sici

import hybrid_model as hm
from hybrid_model.models import VehicleOnPath

# Ten flights, each to the solver's tolerance of 1e-13 on positions near 10 m and crossings at speeds above 0.5 m/s.
ROUNDING = 1e-10


def across(x0, heading0, target, tau, speed=1.0):
    """Position across the lane `tau` after x0: heading = target + c exp(-tau), integrated in closed form."""
    c = heading0 - target
    if c == 0.0:
        return x0 + speed * np.cos(target) * tau
    sine0, cosine0 = sici(abs(c))
    sine1, cosine1 = sici(abs(c) * np.exp(-tau))
    return x0 + speed * (np.cos(target) * (cosine0 - cosine1) - np.sin(target) * np.sign(c) * (sine0 - sine1))


def turns(count, x=0.0, heading=np.pi / 4, leftward=False, speed=1.0):
    """Times and headings of the turns: each is the one root after the vehicle has come back into the lane."""
    t, found = 0.0, []
    for _ in range(count):
        target, edge = (3 * np.pi / 4, -1.0) if leftward else (np.pi / 4, 1.0)

        def beyond(tau, x=x, heading=heading, target=target, edge=edge):
            return (across(x, heading, target, tau, speed) - edge) * edge

        # The vehicle first goes on outward until its heading is pi/2, then straight across.
        turn = np.log((heading - target) / (np.pi / 2 - target)) if (heading - np.pi / 2) * edge < 0 and t else 0.0
        tau = brentq(beyond, turn, turn + 20.0 / speed, xtol=1e-14, rtol=1e-14)
        t, x, heading, leftward = t + tau, edge, target + (heading - target) * np.exp(-tau), not leftward
        found.append((t, heading))
    return np.array(found)


def test_the_first_turn_comes_after_a_straight_line():
    arc = hm.simulate(VehicleOnPath(), 2.0)
    assert [jump.name for jump in arc.jumps] == ["turn_left"]
    assert arc.jumps[0].t == pytest.approx(np.sqrt(2.0), abs=1e-13)
    assert arc.before(arc.jumps[0]).y == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("speed", [0.6, 1.0, 2.5])
def test_turns_against_sine_and_cosine_integrals(speed):
    exact = turns(10, speed=speed)
    arc = hm.simulate(VehicleOnPath(), exact[-1, 0] + 1e-3, inputs={"speed": speed})
    assert [jump.name for jump in arc.jumps] == ["turn_left", "turn_right"] * 5
    assert [jump.t for jump in arc.jumps] == pytest.approx(exact[:, 0], abs=ROUNDING)
    assert [jump.x_after[2] for jump in arc.jumps] == pytest.approx(exact[:, 1], abs=ROUNDING)


def test_position_and_heading_between_turns():
    exact = turns(4)
    arc = hm.simulate(VehicleOnPath(), exact[-1, 0])
    for (t0, heading0), (t1, _), target, edge in zip(
        exact[:-1], exact[1:], [3 * np.pi / 4, np.pi / 4, 3 * np.pi / 4], [1.0, -1.0, 1.0], strict=True
    ):
        tau = np.linspace(0.0, t1 - t0, 30)[1:-1]
        assert arc.at("x", t0 + tau) == pytest.approx(across(edge, heading0, target, tau), abs=ROUNDING)
        heading = target + (heading0 - target) * np.exp(-tau)
        assert arc.at("heading", t0 + tau) == pytest.approx(heading, abs=ROUNDING)
        travelled = quad(lambda u, h=heading0, m=target: np.sin(m + (h - m) * np.exp(-u)), 0.0, tau[-1], epsabs=1e-12)
        assert arc.at("y", t0 + tau[-1]) - arc.at("y", t0) == pytest.approx(travelled[0], abs=ROUNDING)


def test_the_zigzag_settles_to_equal_and_mirrored_halves():
    arc = hm.simulate(VehicleOnPath(), 100.0)
    headings = np.array([jump.x_after[2] for jump in arc.jumps])
    assert headings[-1] == pytest.approx(np.pi - headings[-2], abs=1e-9)
    assert np.diff([jump.t for jump in arc.jumps])[-1] == pytest.approx(np.diff(arc.event_times("turn_left"))[-1] / 2)


def test_a_change_of_speed_changes_the_times_and_not_the_path():
    # The steering lags in time, so only the straight first leg keeps its path: 1 m at 1 m/s, then twice as fast.
    speed = hm.Signal(lambda t: 1.0 if t < 1.0 else 2.0, [1.0])
    arc = hm.simulate(VehicleOnPath(), 1.5, inputs={"speed": speed})
    assert arc.jumps[0].t == pytest.approx(1.0 + (np.sqrt(2.0) - 1.0) / 2.0, abs=1e-13)

"""The bouncing ball against its closed form: impact times, states between impacts, and the Zeno time."""

import re

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall

G = 9.81
# The flow is a parabola, exact for DOP853 up to rounding; a few hundred operations near 1.
ROUNDING = 1e-12


def impacts(e, count, height=1.0):
    """Impact times t_n and rebound speeds v_n: v_n = e^n sqrt(2 g h), flights last 2 v_n/g."""
    speed = np.sqrt(2.0 * G * height)
    rebounds = speed * e ** np.arange(1, count + 1)
    flights = np.concatenate([[speed / G], 2.0 * rebounds[:-1] / G])
    return np.cumsum(flights), rebounds


@pytest.mark.parametrize("e", [0.7, 0.8])
def test_impact_times_and_speeds(e):
    times, rebounds = impacts(e, 10)
    arc = hm.simulate(BouncingBall(e=e), times[-1] + 1e-3)
    assert [jump.t for jump in arc.jumps] == pytest.approx(times, abs=ROUNDING)
    assert [jump.x_after[1] for jump in arc.jumps] == pytest.approx(rebounds, abs=10 * ROUNDING)
    assert [jump.x_before[1] for jump in arc.jumps] == pytest.approx(-rebounds / e, abs=10 * ROUNDING)
    assert all(jump.x_after[0] == 0.0 for jump in arc.jumps)


@pytest.mark.parametrize("e", [0.7, 0.8])
def test_height_and_velocity_between_impacts(e):
    times, rebounds = impacts(e, 6)
    arc = hm.simulate(BouncingBall(e=e), times[-1])
    t = np.linspace(0.0, times[-1], 301)[:-1]
    n = np.searchsorted(times, t, side="right")
    since = t - np.concatenate([[0.0], times])[n]
    v0 = np.concatenate([[0.0], rebounds])[n]
    h0 = np.where(n == 0, 1.0, 0.0)
    assert arc.at("v", t) == pytest.approx(v0 - G * since, abs=20 * ROUNDING)
    assert arc.at("h", t) == pytest.approx(h0 + v0 * since - G * since**2 / 2, abs=20 * ROUNDING)


@pytest.mark.parametrize("e", [0.7, 0.8])
def test_the_zeno_run_stops_at_its_accumulation_time_and_never_below_the_floor(e):
    exact = np.sqrt(2.0 / G) * (1.0 + e) / (1.0 - e)
    arc = hm.simulate(BouncingBall(e=e), 60.0)
    assert arc.stop is hm.Stop.ZENO
    told = float(re.search(r"accumulate at t = ([0-9.]+) s", arc.message).group(1))
    assert told == pytest.approx(exact, abs=1e-3)
    assert "dwell time" in arc.stop.value
    # An impact is located to a few ulp, at 4.4 m/s at most.
    assert arc["h"].min() >= -1e-14
    assert arc.at("h", np.linspace(0.0, arc.t[-1], 2001)).min() >= -1e-14
    # Stopped by the geometric series, with the last gaps near the guard's remainder, and not by a count of jumps.
    assert len(arc.jumps) < 80


def test_energy_is_kept_in_flight_and_lost_at_impacts():
    arc = hm.simulate(BouncingBall(), 2.0)
    energy = G * arc["h"] + arc["v"] ** 2 / 2
    for j in range(len(arc.jumps) + 1):
        assert energy[arc.j == j] == pytest.approx(G * 0.7 ** (2 * j), rel=1e-11)


def test_parameters_change_the_run():
    arc = hm.simulate(BouncingBall(h=2.0, v=1.0, g=1.62), 3.0)
    first = (1.0 + np.sqrt(1.0 + 2.0 * 1.62 * 2.0)) / 1.62
    assert arc.jumps[0].t == pytest.approx(first, abs=ROUNDING)

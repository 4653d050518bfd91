"""The ball on a moving table: a table that moves evenly, and the impacts on an oscillating one by brentq."""

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid_model as hm
from hybrid_model.models import BallOnMovingTable, BallOnOscillatingTable, BouncingBall

G = 9.81
# Flow and impact law are exact up to rounding: a few hundred operations near 1.
ROUNDING = 1e-12
RATE = 10.0
E = 0.5


@pytest.mark.parametrize("speed", [0.4, -0.7])
def test_a_table_that_moves_evenly_sees_a_bouncing_ball(speed):
    ball = BallOnMovingTable(h=1.2, v=speed, e=0.8)
    arc = hm.simulate(ball, 2.5, inputs={"table": lambda t: 0.2 + speed * t, "table_velocity": speed})
    at_rest = hm.simulate(BouncingBall(h=1.0, v=0.0, e=0.8), 2.5)
    assert len(arc.jumps) == len(at_rest.jumps) > 3
    assert arc.event_times("jump") == pytest.approx(at_rest.event_times("jump"), abs=ROUNDING)
    t = np.linspace(0.0, 2.5, 100)
    assert arc.at("h", t) - 0.2 - speed * t == pytest.approx(at_rest.at("h", t), abs=10 * ROUNDING)
    assert arc.at("v", t) - speed == pytest.approx(at_rest.at("v", t), abs=20 * ROUNDING)


def test_a_table_that_drops_is_met_where_it_is_then():
    """The table's height as a signal with a breakpoint: from 0 to -0.5 m before the ball arrives."""
    table = hm.Signal(lambda t: np.where(t < 0.3, 0.0, -0.5), [0.3])
    arc = hm.simulate(BallOnMovingTable(h=1.0, e=0.8), 1.0, inputs={"table": table})
    assert arc.event_times("jump") == pytest.approx([np.sqrt(2.0 * 1.5 / G)], abs=ROUNDING)


def amplitude(gamma):
    """Amplitude of the table for a greatest acceleration of gamma g."""
    return gamma * G / RATE**2


def next_impact(t0, v0, table):
    """First zero of the relative height after an impact at t0, divided by the time since to take the zero at t0 out."""

    def lifted(tau):
        return v0 - G * tau / 2.0 - table * (np.sin(RATE * (t0 + tau)) - np.sin(RATE * t0)) / tau

    grid = np.arange(1e-4, 5.0, 1e-4)
    below = np.argmax(lifted(grid) < 0.0)
    assert below > 0
    return t0 + brentq(lifted, grid[below - 1], grid[below], xtol=1e-15, rtol=1e-15)


def impacts_by_brentq(t0, v0, table, e, count):
    """Impact times from the rebound (t0, v0) on, and the velocities after them."""
    found = []
    for _ in range(count):
        t = next_impact(t0, v0, table)
        w = table * RATE * np.cos(RATE * t)
        v = w - e * (v0 - G * (t - t0) - w)
        found.append((t, v))
        t0, v0 = t, v
    return np.array(found).T


@pytest.mark.parametrize(("gamma", "e", "height"), [(1.3, 0.5, 0.4), (1.6, 0.5, 0.4), (0.9, 0.8, 0.5), (0.5, 1.0, 0.3)])
def test_impacts_on_the_oscillating_table_are_those_of_brentq(gamma, e, height):
    table = amplitude(gamma)
    # From the table at time zero, where it stands at 0, with a speed that reaches about `height`.
    v0 = np.sqrt(2.0 * G * height)
    times, velocities = impacts_by_brentq(0.0, v0, table, e, 8)
    ball = BallOnOscillatingTable(table={"amplitude": table, "rate": RATE}, h=0.0, v=v0, e=e)
    arc = hm.simulate(ball, times[-1] + 1e-3)
    # A difference dt of an impact time is passed on to the next with a factor of at most 1 + e**2 + gamma (1 + e)**2
    # (sum of the entries of the impact map's derivative, about 5 here): some 100 ulp grow over 8 impacts.
    assert arc.event_times("ball.jump") == pytest.approx(times, abs=5.0**4 * ROUNDING)
    assert [jump.x_after[1] for jump in arc.jumps] == pytest.approx(velocities, abs=5.0**4 * G * ROUNDING)
    # The first impacts have not lost anything yet.
    assert arc.event_times("ball.jump")[:2] == pytest.approx(times[:2], abs=ROUNDING)


def period_n_start(n, gamma, e):
    """Phase of the impacts and rebound velocity of the motion with one impact in n periods of the table."""
    flight = 2.0 * np.pi * n / RATE
    w = (1.0 - e) / (1.0 + e) * G * flight / 2.0
    return np.arccos(w / (amplitude(gamma) * RATE)), G * flight / 2.0, flight


@pytest.mark.parametrize(("n", "gamma"), [(1, 1.2), (1, 1.4), (2, 2.3)])
def test_one_impact_in_n_periods_is_kept(n, gamma):
    phase, v0, flight = period_n_start(n, gamma, E)
    table = {"amplitude": amplitude(gamma), "rate": RATE, "phase": phase}
    h0 = amplitude(gamma) * np.sin(phase)
    arc = hm.simulate(BallOnOscillatingTable(table=table, h=h0, v=v0, e=E), 12.5 * flight)
    # The motion attracts, so rounding does not add up.
    assert arc.event_times("ball.jump") == pytest.approx(flight * np.arange(1, 13), abs=10 * ROUNDING)
    assert np.array([jump.x_after[1] for jump in arc.jumps]) == pytest.approx(v0, abs=100 * ROUNDING)


def test_the_motion_with_one_impact_a_period_attracts():
    gamma = 1.3
    phase, v0, flight = period_n_start(1, gamma, E)
    table = {"amplitude": amplitude(gamma), "rate": RATE, "phase": phase}
    h0 = amplitude(gamma) * np.sin(phase)
    arc = hm.simulate(BallOnOscillatingTable(table=table, h=h0, v=1.01 * v0, e=E), 40.5 * flight)
    late = arc.event_times("ball.jump") - flight * np.arange(1, 41)
    # The impact map's derivative has determinant e**2 and a trace below 2 e in modulus: perturbations shrink by e each
    # impact, and 0.03 e**40 is below rounding.
    assert abs(late[0]) > 1e-3
    assert late[-5:] == pytest.approx(0.0, abs=10 * ROUNDING)


def test_the_motion_with_one_impact_a_period_repels_beyond_period_doubling():
    # Period doubling at gamma**2 = (pi (1 - e)/(1 + e))**2 + (2 (1 + e**2)/(1 + e)**2)**2.
    doubling = np.hypot(np.pi * (1.0 - E) / (1.0 + E), 2.0 * (1.0 + E**2) / (1.0 + E) ** 2)
    # The leading multiplier of the impact map is -0.71 below and -1.23 above: 50 impacts shrink the deviation to 1e-10,
    # or have long taken it to the motion of period two.
    spreads = {}
    for gamma in (doubling - 0.06, doubling + 0.06):
        phase, v0, flight = period_n_start(1, gamma, E)
        table = {"amplitude": amplitude(gamma), "rate": RATE, "phase": phase}
        h0 = amplitude(gamma) * np.sin(phase)
        arc = hm.simulate(BallOnOscillatingTable(table=table, h=h0, v=1.001 * v0, e=E), 50.5 * flight)
        gaps = np.diff(arc.event_times("ball.jump"))[-10:]
        spreads[gamma > doubling] = np.ptp(gaps)
        if gamma > doubling:
            # Two flights of different length take turns.
            assert gaps[2:] == pytest.approx(gaps[:-2], abs=1e-3 * flight)
    assert spreads[False] < 1e-8 < 1e-2 < spreads[True]


def test_energy_is_kept_over_an_elastic_impact_in_the_frame_of_the_table():
    table = amplitude(0.5)
    ball = BallOnOscillatingTable(table={"amplitude": table, "rate": RATE}, h=0.3, e=1.0)
    arc = hm.simulate(ball, 3.0)
    assert len(arc.jumps) > 4
    for jump in arc.jumps:
        w = table * RATE * np.cos(RATE * jump.t)
        # The impact is evaluated at the same rounded time, at speeds below 10 m/s.
        assert jump.x_after[1] - w == pytest.approx(w - jump.x_before[1], abs=10 * ROUNDING)

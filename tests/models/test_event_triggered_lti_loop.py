"""Event-triggered state feedback: exact event times by matrix exponentials, and Tabuada's minimum inter-event time."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import hybrid_model as hm
from hybrid_model.models import EventTriggeredLtiLoop
from hybrid_model.models.event_triggered_lti_loop import minimum_inter_event_time

A = np.array([[0.0, 1.0], [-2.0, 3.0]])
B = np.array([[0.0], [1.0]])
K = np.array([[1.0, -4.0]])
SIGMA = 0.05
# Locations are good to a few ulp and the flow to 1e-13 a step; an event's error moves the later ones, in a loop that is
# stable, by no more than about itself each.
TOLERANCE = 1e-10


def exact_events(start, t_end, sigma=SIGMA):
    """Event times and states there: between events (x, u) flows by one matrix exponential."""
    drift = np.block([[A, B], [np.zeros((1, 3))]])
    fine = 2e-3  # more than ten points in the shortest gap, and every gap begins with a clearly negative margin
    step = expm(drift * fine)
    t, x, found = 0.0, np.asarray(start, dtype=float), []
    while True:
        held, since = x, 0.0
        both = np.concatenate([x, K @ x])

        def margin(s, held=held, both=both):
            now = (expm(drift * s) @ both)[:2]
            return np.linalg.norm(held - now) - sigma * np.linalg.norm(now)

        walk = both
        while True:
            walk = step @ walk
            since += fine
            if np.linalg.norm(held - walk[:2]) >= sigma * np.linalg.norm(walk[:2]):
                break
        gap = brentq(margin, since - fine, since, xtol=1e-15, rtol=1e-14)
        t, x = t + gap, (expm(drift * gap) @ both)[:2]
        if t > t_end:
            return np.array(found)
        found.append([t, *x])


@pytest.mark.parametrize("start", [(1.0, 0.0), (-0.4, 2.0)])
def test_event_times_and_states_are_exact(start):
    expected = exact_events(start, 4.0)
    arc = hm.simulate(EventTriggeredLtiLoop(start=start), 4.0)
    assert len(expected) > 50
    assert [jump.t for jump in arc.jumps] == pytest.approx(expected[:, 0], abs=TOLERANCE)
    np.testing.assert_allclose([jump.x_after for jump in arc.jumps], expected[:, 1:], rtol=0, atol=TOLERANCE)


def test_no_gap_is_shorter_than_the_guaranteed_time():
    """Over random starts, the time from the start to the first event included; the bound is not far from them."""
    least = minimum_inter_event_time(A, B, K, SIGMA)
    rng = np.random.default_rng(20070901)
    shortest = np.inf
    for angle in rng.uniform(0.0, 2.0 * np.pi, 8):
        arc = hm.simulate(EventTriggeredLtiLoop(start=[np.cos(angle), np.sin(angle)]), 2.0)
        gaps = np.diff([0.0, *arc.event_times("feedback.update")])
        assert gaps.min() >= least
        shortest = min(shortest, gaps.min())
    # A bound for all directions at once is met by the worst of them up to its conservatism.
    assert shortest < 1.1 * least


@pytest.mark.parametrize("sigma", [0.01, 0.2, 0.7])
def test_no_gap_is_shorter_for_other_thresholds_and_plants(sigma):
    rng, events = np.random.default_rng(3), 0
    for _ in range(4):
        a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
        k = np.linalg.lstsq(b, -1.5 * np.eye(3) - a, rcond=None)[0]
        least = minimum_inter_event_time(a, b, k, sigma)
        arc = hm.simulate(EventTriggeredLtiLoop(A=a, B=b, K=k, sigma=sigma, start=rng.normal(size=3)), 40.0 * least)
        gaps = np.diff([0.0, *arc.event_times("feedback.update")])
        assert np.all(gaps >= least)
        events += gaps.size
    assert events > 20


def test_the_bound_is_the_time_at_which_the_riccati_solution_reaches_sigma():
    """Three ways to one number: closed form, quadrature, and the differential equation itself."""
    loop, error = np.linalg.norm(A + B @ K, 2), np.linalg.norm(B @ K, 2)
    closed = minimum_inter_event_time(A, B, K, SIGMA)
    integral = quad(lambda phi: 1.0 / ((1.0 + phi) * (loop + error * phi)), 0.0, SIGMA, epsabs=1e-15)[0]
    assert closed == pytest.approx(integral, rel=1e-12)
    solution = solve_ivp(
        lambda t, phi: loop + (loop + error) * phi + error * phi**2, (0.0, closed), [0.0], rtol=1e-12, atol=1e-14
    )
    # The solver's global error, some steps at rtol 1e-12.
    assert solution.y[0, -1] == pytest.approx(SIGMA, rel=1e-10)


def test_the_bound_where_the_norms_are_equal():
    """A = -2 b b', K = b': |A + BK| = |BK| = 1, and phi' = (1 + phi)^2 gives sigma/(1 + sigma)."""
    exact = 0.3 / 1.3
    for slightly in (0.0, 1e-14, -1e-9):
        found = minimum_inter_event_time([[-2.0 + slightly]], [[1.0]], [[1.0]], 0.3)
        assert found == pytest.approx(exact, abs=1e-9)
    assert minimum_inter_event_time([[-1.0]], [[1.0]], [[1.0]], 0.3) == np.inf


def test_the_bound_is_met_by_a_plant_of_order_one():
    """x' = a x + u, u = k xhat: the ratio |e|/|x| grows by the scalar equation itself: every gap is the bound."""
    a, k, sigma = 1.0, -3.0, 0.2
    # x falls, so |e|/|x| grows as fast as the norms allow: phi' = (1 + phi)(|a + k| + |k| phi).
    arc = hm.simulate(EventTriggeredLtiLoop(A=[[a]], B=[[1.0]], K=[[k]], sigma=sigma, start=[1.0]), 1.0)
    least = minimum_inter_event_time([[a]], [[1.0]], [[k]], sigma)
    gaps = np.diff([0.0, *arc.event_times("feedback.update")])
    # Differences of located times: a few ulp of 1 s, and the flow's tolerance.
    assert gaps == pytest.approx(least, abs=1e-12)


def test_sigma_must_be_positive():
    with pytest.raises(hm.DeclarationError, match=r"sigma is 0\.0: give a number above zero"):
        minimum_inter_event_time(A, B, K, 0.0)


def test_at_the_origin_it_does_not_fire():
    arc = hm.simulate(EventTriggeredLtiLoop(start=[0.0, 0.0]), 10.0)
    assert arc.stop is hm.Stop.HORIZON
    assert len(arc.jumps) == 0


def test_the_loop_converges_to_the_ball_of_the_floor_and_goes_on_there():
    """The floor replaces the relative threshold below floor/sigma; the state ends in a ball of that order."""
    arc = hm.simulate(EventTriggeredLtiLoop(floor=1e-3), 30.0)
    assert arc.stop is hm.Stop.HORIZON
    late = np.linalg.norm(arc.at("plant.x", np.linspace(20.0, 30.0, 201)), axis=1)
    assert late.max() < 1e-3 / SIGMA
    gaps = np.diff(arc.event_times("feedback.update"))
    assert gaps.min() >= minimum_inter_event_time(A, B, K, SIGMA)


def test_error_stays_below_the_threshold():
    arc = hm.simulate(EventTriggeredLtiLoop(), 4.0)
    x, xhat = arc["plant.x"], arc["feedback.xhat"]
    margin = np.linalg.norm(xhat - x, axis=1) - SIGMA * np.linalg.norm(x, axis=1)
    # At events it is zero, up to the location: a few ulp of t times the speed of the error.
    assert margin.max() < 1e-14
    assert np.linalg.norm(x[-1]) < 0.3

"""Estimation over a network against products of matrix exponentials."""

import numpy as np
import pytest
from oracles.affine_modes import AffineMode
from scipy.linalg import expm

import hybrid_model as hm
from hybrid_model.models import NetworkEstimation
from hybrid_model.models.network_estimation import DYNAMICS, INJECTION, INPUT_COLUMN, MEASUREMENT

INTERVALS = (0.7, 2.9, 0.2, 1.6, 2.3, 0.45, 3.0, 1.1)
A, B, M, L = (np.array(given) for given in (DYNAMICS, INPUT_COLUMN, MEASUREMENT, INJECTION))
# Twenty flights of states up to 100, each to the solver's relative 1e-13.
ROUNDING = 1e-9


def errors(intervals, rounds):
    """Times of messages and errors of the estimate after them: e' = A e, e+ = (I - L M) e."""
    correct = np.eye(4) - np.outer(L, M)
    times, e, found = np.cumsum(np.tile(intervals, rounds)), np.array([1.0, 0.1 - 0.5, 1.0, 0.6]), []
    for tau in np.tile(intervals, rounds):
        e = correct @ expm(A * tau) @ e
        found.append(e)
    return times, np.array(found)


@pytest.mark.parametrize("amplitude", [0.0, 50.0])
def test_the_error_is_a_product_of_exponentials_and_jumps_whatever_the_input(amplitude):
    times, exact = errors(INTERVALS, 2)
    arc = hm.simulate(NetworkEstimation(amplitude=amplitude), times[-1] + 0.1)
    assert [jump.name for jump in arc.jumps] == ["network.transmit", "estimator.correct"] * 16
    assert arc.event_times("network.transmit") == pytest.approx(times, abs=1e-13)
    assert np.array_equal(arc.event_times("estimator.correct"), arc.event_times("network.transmit"))
    after = [arc.after(jump) for jump in arc.jumps if jump.name == "estimator.correct"]
    assert np.array([s["process.x"] - s["estimator.x"] for s in after]) == pytest.approx(exact, abs=ROUNDING)


def test_the_process_under_the_sine_against_the_exponential_of_the_system_with_its_oscillator():
    arc = hm.simulate(NetworkEstimation(), 12.0)
    matrix = np.zeros((6, 6))
    matrix[:4, :4], matrix[:4, 4], matrix[4, 5], matrix[5, 4] = A, B, 0.1, -0.1
    start = [1.0, 0.1, 1.0, 0.6, 0.0, 50.0]
    for t in (0.7, 5.0, 12.0):
        assert arc.at("process.x", t) == pytest.approx(AffineMode(matrix).at(start, t)[:4], abs=ROUNDING)


@pytest.mark.parametrize(
    ("interval", "converges"), [(1.48, False), (1.55, True), (2.0, True), (3.1, True), (3.2, False)]
)
def test_a_constant_interval_converges_between_its_two_bounds(interval, converges):
    factor = np.cos(interval) - INJECTION[1] * np.sin(interval)
    assert converges == (abs(factor) < 1.0) == (2 * np.arctan(-INJECTION[1]) < interval < np.pi)
    arc = hm.simulate(NetworkEstimation(intervals=(interval,), amplitude=0.0), 20.5 * interval)
    after = [arc.after(jump) for jump in arc.jumps if jump.name == "estimator.correct"]
    errors = np.array([s["process.x"] - s["estimator.x"] for s in after])
    assert errors[:, 0] == pytest.approx(0.0, abs=ROUNDING)
    assert errors[1:, 1] == pytest.approx(factor * errors[:-1, 1], abs=ROUNDING)
    assert (abs(errors[-1, 1]) < abs(errors[0, 1])) == converges


def test_the_measurement_is_reproduced_at_once():
    # M L = 1, so a message makes the estimated measurement the measured one.
    arc = hm.simulate(NetworkEstimation(), 10.0)
    for jump in arc.jumps:
        if jump.name == "estimator.correct":
            s = arc.after(jump)
            assert s["estimator.x"][0] == pytest.approx(s["network.message"], abs=ROUNDING)

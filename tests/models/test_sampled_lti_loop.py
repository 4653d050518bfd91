"""Sample-and-hold state feedback against the discrete-time system that it is at the samples."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import hybrid_model as hm
from hybrid_model.models import SampledLtiLoop

A = np.array([[0.0, 1.0], [0.0, 0.0]])
B = np.array([[0.0], [1.0]])
K = np.array([[-1.0, -1.5]])
PERIOD = 0.5
# The solver's relative tolerance is 1e-13 a step; some tens of steps of a stable loop with states near 1.
TOLERANCE = 1e-10


def discretised(a, b, period):
    """Ad and Bd out of one matrix exponential (Van Loan 1978)."""
    n, m = b.shape
    both = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * period)
    return both[:n, :n], both[:n, n:]


def test_states_at_the_samples_are_those_of_the_discrete_system():
    arc = hm.simulate(SampledLtiLoop(), 20.0)
    ad, bd = discretised(A, B, PERIOD)
    x = np.array([1.0, 0.0])
    for k in range(41):
        assert arc.at("plant.x", k * PERIOD) == pytest.approx(x, abs=TOLERANCE)
        assert arc.at("feedback.u", k * PERIOD) == pytest.approx(K @ x, abs=TOLERANCE)
        x = (ad + bd @ K) @ x


def test_it_is_the_plant_that_python_control_discretises():
    held = control.c2d(control.ss(A, B, np.eye(2), 0.0), PERIOD, method="zoh")
    loop = control.ss(held.A + held.B @ K, np.zeros((2, 1)), np.eye(2), 0.0, PERIOD)
    expected = control.initial_response(loop, np.arange(21) * PERIOD, [1.0, 0.0]).outputs
    arc = hm.simulate(SampledLtiLoop(), 10.0)
    np.testing.assert_allclose(arc.at("plant.x", np.arange(21) * PERIOD).T, expected, rtol=0, atol=TOLERANCE)


def test_between_samples_the_feedback_is_held():
    arc = hm.simulate(SampledLtiLoop(), 3.0)
    for t in np.linspace(0.01, 2.99, 47):
        k = int(t // PERIOD)
        ad, bd = discretised(A, B, t - k * PERIOD)
        u = arc.at("feedback.u", k * PERIOD)
        assert arc.at("plant.x", t) == pytest.approx(ad @ arc.at("plant.x", k * PERIOD) + bd @ u, abs=TOLERANCE)


def test_samples_are_taken_at_multiples_of_the_period_computed_from_their_number():
    arc = hm.simulate(SampledLtiLoop(period=0.1), 10.0)
    assert [jump.t for jump in arc.jumps] == [k * 0.1 for k in range(101)]
    assert arc.end["feedback.k"] == 101


@pytest.mark.parametrize(("period", "stable"), [(0.9, True), (1.4, False)])
def test_the_loop_is_stable_up_to_the_period_that_the_eigenvalues_tell(period, stable):
    """A stable continuous loop becomes unstable when it is sampled too slowly."""
    ad, bd = discretised(A, B, period)
    assert bool(np.abs(np.linalg.eigvals(ad + bd @ K)).max() < 1.0) is stable
    arc = hm.simulate(SampledLtiLoop(period=period), 40 * period)
    assert bool(np.linalg.norm(arc["plant.x"][-1]) < 1e-2) is stable


def test_a_plant_of_any_order_with_several_inputs():
    rng = np.random.default_rng(7)
    a, b, k = rng.normal(size=(3, 3)) - 2.0 * np.eye(3), rng.normal(size=(3, 2)), 0.3 * rng.normal(size=(2, 3))
    arc = hm.simulate(SampledLtiLoop(A=a, B=b, K=k, period=0.2, start=[1.0, -1.0, 0.5]), 4.0)
    ad, bd = discretised(a, b, 0.2)
    x = np.linalg.matrix_power(ad + bd @ k, 20) @ [1.0, -1.0, 0.5]
    assert arc.at("plant.x", 4.0, before=True) == pytest.approx(x, abs=TOLERANCE)


def test_matrices_that_do_not_fit_are_refused():
    with pytest.raises(hm.DeclarationError, match="one length 'order'"):
        SampledLtiLoop(A=np.eye(3))

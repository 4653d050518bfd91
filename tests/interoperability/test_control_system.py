"""An exported plant as a system of python-control: its functions from Model Exchange, its matrices from the FMU."""

import control
import numpy as np
import pytest
from catalogue import cases
from small_automata import Store

import hybrid_model as hm
from cosim.flow_functions import FlowError, FlowFunctions
from hybrid_model.linear import linearise
from hybrid_model.models import BouncingBall

VERSIONS = ["2.0", "3.0"]


class Pendulum(hm.HybridAutomaton):
    """A pendulum with a motor, and an arm's two joints as a vector."""

    count = hm.Dimension()
    theta = hm.State(0.3, output=True)
    omega = hm.State(-0.2)
    joints = hm.State(0.0, shape="count")
    torque = hm.Input(0.0)
    push = hm.Input(0.0, shape="count")
    mode = hm.DiscreteState(1.0)
    length = hm.Parameter(0.7)
    height = hm.Output()
    pull = hm.Output(shape="count")

    def flow_map(self, s):
        return {
            "theta": s.omega,
            "omega": -9.81 / s.length * np.sin(s.theta) - 0.1 * s.omega**3 + s.torque * np.cos(s.theta) * s.mode,
            "joints": np.sin(s.joints) * s.omega + s.push * s.theta,
        }

    def outputs(self, s):
        return {"height": s.length * (1 - np.cos(s.theta)) + 0.5 * s.torque**2, "pull": s.joints**2 + s.push * s.omega}


def pendulum():
    return Pendulum(joints=[0.1, 0.2], push=[0.0, 0.0])


def system(flow):
    """What a user writes: six lines."""

    def labels(names):
        return [name.replace(".", "_") for name in names]

    return control.nlsys(
        lambda t, x, u, params: flow.derivatives(t, x, u),
        lambda t, x, u, params: flow.values(t, x, u),
        states=labels(flow.states),
        inputs=labels(flow.inputs),
        outputs=labels(flow.outputs),
    )


@pytest.fixture(params=VERSIONS)
def flow(request, exported):
    functions = FlowFunctions(exported(pendulum(), "pendulum", request.param))
    yield functions
    functions.close()


POINT = {"theta": 0.8, "omega": -0.5, "joints": [0.4, -0.3], "torque": 0.6, "push": [0.2, -0.1]}
X, U = np.array([0.8, -0.5, 0.4, -0.3]), np.array([0.6, 0.2, -0.1])


def test_names_and_start_values(flow):
    assert flow.states == ("theta", "omega", "joints[1]", "joints[2]")
    assert flow.inputs == ("torque", "push[1]", "push[2]")
    assert flow.outputs == ("height", "pull[1]", "pull[2]", "theta")
    np.testing.assert_array_equal(flow.x, [0.3, -0.2, 0.1, 0.2])
    np.testing.assert_array_equal(flow.u, [0.0, 0.0, 0.0])


def test_functions_are_those_of_the_automaton(flow):
    theta, omega, a, b = X
    torque, p, q = U
    rates = [
        omega,
        -9.81 / 0.7 * np.sin(theta) - 0.1 * omega**3 + torque * np.cos(theta),
        np.sin(a) * omega + p * theta,
        np.sin(b) * omega + q * theta,
    ]
    # Rounding of the same expressions in C.
    np.testing.assert_allclose(flow.derivatives(0.0, X, U), rates, rtol=1e-14)
    shown = [0.7 * (1 - np.cos(theta)) + 0.5 * torque**2, a**2 + p * omega, b**2 + q * omega, theta]
    np.testing.assert_allclose(flow.values(0.0, X, U), shown, rtol=1e-14)


def test_directional_derivatives_are_the_linearisation_in_closed_form(flow):
    theta, omega, a, b = X
    torque, p, q = U
    found = flow.linearize(0.0, X, U)
    A = [
        [0, 1, 0, 0],
        [-9.81 / 0.7 * np.cos(theta) - torque * np.sin(theta), -0.3 * omega**2, 0, 0],
        [p, np.sin(a), omega * np.cos(a), 0],
        [q, np.sin(b), 0, omega * np.cos(b)],
    ]
    B = [[0, 0, 0], [np.cos(theta), 0, 0], [0, theta, 0], [0, 0, theta]]
    C = [[0.7 * np.sin(theta), 0, 0, 0], [0, p, 2 * a, 0], [0, q, 0, 2 * b], [1, 0, 0, 0]]
    D = [[torque, 0, 0], [0, omega, 0], [0, 0, omega], [0, 0, 0]]
    for matrix, expected in zip(found, (A, B, C, D), strict=True):
        np.testing.assert_allclose(matrix, expected, rtol=1e-14, atol=1e-15)


def test_python_controls_linearisation_of_the_system_is_the_same(flow):
    linear = control.linearize(system(flow), X, U)
    for matrix, expected in zip((linear.A, linear.B, linear.C, linear.D), flow.linearize(0.0, X, U), strict=True):
        # python-control takes forward differences with a step of 1e-6; second derivatives are below 20.
        np.testing.assert_allclose(matrix, expected, rtol=0, atol=2e-5)


def test_linearisation_of_the_automaton_is_the_same(flow):
    linear = linearise(pendulum(), POINT)
    found = flow.linearize(0.0, X, U)
    order = [linear.output_labels.index(name) for name in flow.outputs]
    # Extrapolated central differences there.
    np.testing.assert_allclose(found.A, linear.A, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.B, linear.B, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.C, linear.C[order], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.D, linear.D[order], rtol=0, atol=1e-8)


def test_python_control_simulates_the_fmu_as_the_python_run_does(flow):
    times = np.linspace(0.0, 3.0, 31)
    inputs = np.vstack([np.full_like(times, 0.4), np.full_like(times, 0.1), np.full_like(times, -0.2)])
    response = control.input_output_response(
        system(flow), times, inputs, flow.x, solve_ivp_method="DOP853", solve_ivp_kwargs={"rtol": 1e-11, "atol": 1e-12}
    )
    arc = hm.simulate(pendulum(), 3.0, inputs={"torque": 0.4, "push": [0.1, -0.2]})
    np.testing.assert_allclose(response.states[0], arc.at("theta", times), rtol=0, atol=1e-8)
    np.testing.assert_allclose(response.outputs[0], arc.at("height", times), rtol=0, atol=1e-8)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_late_pulse_in_a_table_of_inputs_needs_a_bound_on_steps(fmi, exported):
    """As docs/interoperability.md says it."""

    times = np.arange(101.0)
    pulse = np.where(times == 50.0, 1.0, 0.0)  # a triangle of area 1
    accurate = {"rtol": 1e-10, "atol": 1e-10}
    flow = FlowFunctions(exported(Store(), "store", fmi))
    found = [
        control.input_output_response(system(flow), times, pulse, flow.x, solve_ivp_kwargs=options).states[0, -1]
        for options in (accurate, accurate | {"max_step": 1.0})
    ]
    flow.close()
    assert found[0] == 0.0
    # Kinks within steps: the tolerance of 1e-10 is met step by step, in some hundred steps.
    assert found[1] == pytest.approx(1.0, abs=1e-7)


def test_a_regulator_designed_on_the_fmus_matrices_holds_it(flow):
    """Linear-quadratic feedback by python-control brings the FMU's pendulum to rest."""
    still = np.zeros(4)
    A, B, _, _ = flow.linearize(0.0, still, np.zeros(3))
    gain, _, _ = control.lqr(A[:2, :2], B[:2, :1], np.diag([10.0, 1.0]), [[1.0]])

    def closed(t, x):
        torque = -float((gain @ x[:2])[0])
        return flow.derivatives(t, x, [torque, 0.0, 0.0])

    x = flow.x.copy()
    step = 2e-3  # Euler: enough to see it come to rest
    for k in range(12_500):
        x += step * closed(k * step, x)
    # The slowest closed-loop pole is at -0.66 1/s: exp(-0.66 * 25) = 7e-8.
    assert np.abs(x[:2]).max() < 1e-6


@pytest.mark.parametrize("fmi", VERSIONS)
def test_parameters_and_start_values_can_be_given(fmi, exported):
    flow = FlowFunctions(exported(pendulum(), "pendulum", fmi), {"length": 2.0, "theta": 1.0})
    assert flow.x[0] == 1.0
    assert flow.derivatives(0.0, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0])[1] == pytest.approx(-9.81 / 2 * np.sin(1.0))
    flow.close()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_flow_of_a_network_between_two_events(fmi, exported):
    """The paper's closed loop: discrete states frozen as they are after the events at the start."""
    automaton = cases()["paper_dynamic"].automaton
    flow = FlowFunctions(exported(automaton, "paper_dynamic", fmi))
    found = flow.linearize(0.0, flow.x)
    n = len(flow.states)
    step = 1e-6
    columns = [
        (flow.derivatives(0.0, flow.x + step * e) - flow.derivatives(0.0, flow.x - step * e)) / (2 * step)
        for e in np.eye(n)
    ]
    # Central differences: rounding 1e-16/1e-6 times values of some tens.
    np.testing.assert_allclose(found.A, np.transpose(columns), rtol=0, atol=1e-7)
    assert found.B.shape == (n, 0)
    flow.close()


def test_what_cannot_be_is_refused(flow, exported, tmp_path):
    with pytest.raises(FlowError, match=r"has 4 states and 3 inputs, but shapes \(2,\) and \(0,\)"):
        flow.derivatives(0.0, [1.0, 2.0])
    with pytest.raises(FlowError, match="SetContinuousStates failed at t = 0, x = "):
        flow.derivatives(0.0, [np.nan, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(FlowError, match="it has no variable 'lenght'; it has time, "):
        FlowFunctions(exported(pendulum(), "pendulum"), {"lenght": 1.0})
    text = tmp_path / "no.fmu"
    text.write_text("this is no archive")
    with pytest.raises(FlowError, match=r"no\.fmu cannot be run"):
        FlowFunctions(text)
    ball = FlowFunctions(exported(BouncingBall(), "ball"))
    assert ball.inputs == ()
    ball.close()

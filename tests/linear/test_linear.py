"""python-control both ways: flows as its systems, linearisations with exact answers, its systems as automata."""

import subprocess
import sys

import control
import numpy as np
import pytest
from catalogue import control_plant_under_triggers
from scipy.linalg import expm
from scipy.optimize import brentq
from small_automata import Store

import hybrid_model as hm
from hybrid_model.linear import flow_system, linearise, lti
from hybrid_model.models import BouncingBall, EventTriggeredLtiLoop, SampledLtiLoop

# What input_output_response hands on to solve_ivp; its global error stays below some hundred times this.
ACCURATE = {"solve_ivp_method": "DOP853", "solve_ivp_kwargs": {"rtol": 1e-12, "atol": 1e-13}}
# Rounding over an extrapolated step of about 1e-2 of the states.
DERIVATIVES = 1e-12


class Pendulum(hm.HybridAutomaton):
    """A damped pendulum in the wind, with a torque and a latch that holds a part of it."""

    angle = hm.State(0.3, output=True)
    rate = hm.State(0.0)
    torque = hm.Input(0.0)
    step = hm.Input(0.0, discrete=True)
    latch = hm.DiscreteState(0.5)
    damping = hm.Parameter(0.2)
    height = hm.Output()

    def flow_map(self, s):
        pull = s.torque + s.step * s.latch + 0.1 * np.sin(s.t)
        return {"angle": s.rate, "rate": -np.sin(s.angle) - s.damping * s.rate * np.abs(s.rate) + pull}

    def outputs(self, s):
        return {"height": 1.0 - np.cos(s.angle) + s.torque**2}


# Flows as systems.


def test_free_flight_of_a_ball():
    system = flow_system(BouncingBall())
    assert system.state_labels == ["h", "v"]
    assert system.output_labels == ["h", "v"]
    assert system.ninputs == 0
    times = np.linspace(0.0, 2.0, 21)
    for g in (9.81, 1.62):
        response = control.input_output_response(system, times, 0.0, [1.0, 0.5], params={"g": g}, **ACCURATE)
        np.testing.assert_allclose(response.outputs[0], 1.0 + 0.5 * times - g * times**2 / 2, rtol=0, atol=1e-10)


def test_signals_and_parameters_have_the_names_of_the_automaton():
    system = flow_system(Pendulum())
    assert (system.input_labels, system.state_labels) == (["torque", "step"], ["angle", "rate"])
    assert system.output_labels == ["height", "angle"]
    assert system.params == {"damping": 0.2}
    assert system.name == "Pendulum"


def test_operating_point_of_a_pendulum():
    """At rest under a constant torque c: sin(angle) = c. The wind is zero at t = 0."""
    point = control.find_operating_point(flow_system(Pendulum()), [0.2, 0.0], [0.6, 0.0])
    assert point.states == pytest.approx([np.arcsin(0.6), 0.0], abs=1e-9)  # the root finder's tolerance
    asked = control.find_operating_point(flow_system(Pendulum()), [0.1, 0.0], [0.1, 0.0], y0=[0.0, 0.7], iu=[1], iy=[1])
    assert asked.inputs[0] == pytest.approx(np.sin(0.7), abs=1e-8)


def test_time_and_inputs_reach_the_flow():
    system = flow_system(Pendulum())
    found = system.dynamics(2.0, [0.3, -1.5], [0.4, 2.0])
    assert found == pytest.approx([-1.5, -np.sin(0.3) + 0.2 * 1.5**2 + 0.4 + 2.0 * 0.5 + 0.1 * np.sin(2.0)], abs=1e-15)


def test_discrete_states_are_frozen_at_their_start_values_or_given_ones():
    """The event-triggered loop holds u: affine, so one matrix exponential; by default xhat is the computed start."""
    loop = EventTriggeredLtiLoop(start=[0.4, -1.0])
    a, b, k = (np.array(m) for m in (((0.0, 1.0), (-2.0, 3.0)), ((0.0,), (1.0,)), ((1.0, -4.0),)))
    times = np.linspace(0.0, 0.5, 6)
    for z, xhat in ((None, [0.4, -1.0]), ({"feedback.xhat": [2.0, 1.0]}, [2.0, 1.0])):
        system = flow_system(loop, z)
        assert system.state_labels == ["plant_x[1]", "plant_x[2]"]
        response = control.input_output_response(system, times, 0.0, [0.4, -1.0], **ACCURATE)
        drift = np.block([[a, b], [np.zeros((1, 3))]])
        exact = [(expm(drift * t) @ [0.4, -1.0, *(k @ xhat)])[:2] for t in times]
        np.testing.assert_allclose(response.states.T, exact, rtol=0, atol=1e-9)


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(hm.DeclarationError, match="Pendulum has no variable 'angle'; it has latch"):
        flow_system(Pendulum(), {"angle": 1.0})
    with pytest.raises(hm.DeclarationError, match=r"Pendulum \(parameters\) has no variable 'damp'; it has damping"):
        control.input_output_response(flow_system(Pendulum()), [0.0, 1.0], 0.0, [0.0, 0.0], params={"damp": 1.0})

    def test_a_late_pulse_in_a_table_of_inputs_needs_a_bound_on_steps(self):
        times = np.arange(101.0)
        pulse = np.where(times == 50.0, 1.0, 0.0)  # a triangle of area 1
        response = control.input_output_response(
            flow_system(Store()), times, pulse, [0.0], solve_ivp_kwargs={"max_step": 1.0, "rtol": 1e-10, "atol": 1e-10}
        )
        # Kinks within steps: the tolerance of 1e-10 is met step by step, in some hundred steps.
        assert response.outputs[-1] == pytest.approx(1.0, abs=1e-7)


def test_names_that_are_the_same_without_dots_are_refused():
    twice = hm.Composition("pair", {"a": BouncingBall(), "b": BouncingBall()}, names={"a.h": "b_h"})
    with pytest.raises(hm.DeclarationError, match=r"pair: b_h and b\.h are both called 'b_h' in python-control"):
        flow_system(twice)


# Linearisations.


def test_linearisation_of_a_pendulum_is_exact():
    at = {"angle": 0.8, "rate": -1.5, "torque": 0.4, "latch": 2.5, "damping": 0.3, "t": 1.0}
    system = linearise(Pendulum(), at)
    np.testing.assert_allclose(system.A, [[0.0, 1.0], [-np.cos(0.8), -0.6 * 1.5]], rtol=0, atol=DERIVATIVES)
    np.testing.assert_allclose(system.B, [[0.0, 0.0], [1.0, 2.5]], rtol=0, atol=DERIVATIVES)
    np.testing.assert_allclose(system.C, [[np.sin(0.8), 0.0], [1.0, 0.0]], rtol=0, atol=DERIVATIVES)
    np.testing.assert_allclose(system.D, [[0.8, 0.0], [0.0, 0.0]], rtol=0, atol=DERIVATIVES)
    assert (system.input_labels, system.state_labels) == (["torque", "step"], ["angle", "rate"])
    assert system.output_labels == ["height", "angle"]
    assert system.isctime(strict=True)


def test_signals_can_be_chosen_and_held_values_act_as_inputs():
    system = linearise(Pendulum(step=3.0), inputs=["latch", "torque"], outputs=["rate"])
    assert (system.input_labels, system.output_labels) == (["latch", "torque"], ["rate"])
    np.testing.assert_allclose(system.B, [[0.0, 0.0], [3.0, 1.0]], rtol=0, atol=DERIVATIVES)
    np.testing.assert_allclose(system.C, [[0.0, 1.0]], rtol=0, atol=DERIVATIVES)
    loop = linearise(EventTriggeredLtiLoop(), {"plant.x[2]": 0.7}, inputs=["feedback.xhat"], outputs=["plant.x"])
    assert loop.input_labels == ["feedback_xhat[1]", "feedback_xhat[2]"]
    np.testing.assert_allclose(loop.B, [[0.0, 0.0], [1.0, -4.0]], rtol=0, atol=DERIVATIVES)


def test_it_agrees_with_python_control_to_the_accuracy_of_its_differences():
    """Two independent ways; control.linearize takes one-sided differences with a step of 1e-6."""
    at = {"angle": 0.8, "rate": 1.5, "torque": 0.4, "step": 0.1}
    ours = linearise(Pendulum(), at)
    theirs = control.linearize(flow_system(Pendulum()), [0.8, 1.5], [0.4, 0.1])
    for mine, other in zip((ours.A, ours.B, ours.C, ours.D), (theirs.A, theirs.B, theirs.C, theirs.D), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-5)


def test_a_linear_system_comes_back_from_its_automaton():
    rng = np.random.default_rng(5)
    given = control.ss(
        rng.normal(size=(4, 4)),
        rng.normal(size=(4, 2)),
        rng.normal(size=(3, 4)),
        rng.normal(size=(3, 2)),
        inputs=["u", "w"],
        outputs=["a", "b", "c"],
        name="plant",
    )
    back = linearise(lti(given, start=rng.normal(size=4)), {"u": 3.0})
    assert (back.name, back.input_labels, back.output_labels) == ("plant", ["u", "w"], ["a", "b", "c"])
    for name in "ABCD":
        # Affine: exact up to some ten rounding errors of the sums.
        np.testing.assert_allclose(getattr(back, name), getattr(given, name), rtol=0, atol=5e-14)


def test_closed_loop_poles_out_of_an_automaton():
    """The sampled loop with its held feedback as an input: the plant, ready for control.c2d."""
    loop = SampledLtiLoop()
    plant = linearise(loop, inputs=["feedback.u"], outputs=["plant.x"])
    held = control.c2d(plant, 0.5)
    poles = np.linalg.eigvals(held.A + held.B @ [[-1.0, -1.5]])
    arc = hm.simulate(loop, 30.0)
    # The slowest pole is the ratio of late samples of a second-order loop: x[k+2] - (sum) x[k+1] + (product) x[k] = 0.
    x = arc.at("plant.x", 0.5 * np.arange(3))[:, 0]
    assert x[2] - poles.sum().real * x[1] + poles.prod().real * x[0] == pytest.approx(0.0, abs=1e-12)


def test_points_without_a_linearisation_are_refused():
    class Saturated(hm.HybridAutomaton):
        """A level with a valve that saturates, and an outlet."""

        level = hm.State(1.0)
        valve = hm.Input(0.0)

        def flow_map(self, s):
            return {"level": np.clip(s.valve, -1.0, 1.0) - np.sqrt(s.level)}

    assert linearise(Saturated(), {"level": 4.0}).A[0, 0] == pytest.approx(-0.25, abs=DERIVATIVES)
    with pytest.raises(
        hm.DeclarationError, match=r"the derivative of level has no derivative .* valve = 1: .* kink, .* 1 below"
    ):
        linearise(Saturated(), {"valve": 1.0})
    with pytest.raises(hm.SimulationError, match="finite on one side only"):
        linearise(Saturated(), {"level": 0.0})
    with pytest.raises(hm.SimulationError, match="the derivative of level is nan"):
        linearise(Saturated(), {"level": -1.0})
    with pytest.raises(hm.DeclarationError, match="Saturated has no variable 'lever'; it has level"):
        linearise(Saturated(), {"lever": 0.0})
    with pytest.raises(hm.DeclarationError, match=r"Saturated \(inputs and discrete states\) has no variable 'level'"):
        linearise(Saturated(), inputs=["level"])
    with pytest.raises(hm.DeclarationError, match=r"t = nan is not finite"):
        linearise(Saturated(), {"t": np.nan})


# Linear systems as automata.


def test_transfer_function_against_its_step_response():
    """(s + 3)/(s^2 + 2 s + 5): 0.6 (1 - exp(-t) (cos 2t - sin 2t/3))."""
    automaton = lti(control.tf([1.0, 3.0], [1.0, 2.0, 5.0], inputs=["u"], outputs=["y"]))
    arc = hm.simulate(automaton, 4.0, inputs={"u": 1.0})
    t = np.linspace(0.0, 4.0, 33)
    exact = 0.6 * (1.0 - np.exp(-t) * (np.cos(2 * t) - np.sin(2 * t) / 3.0))
    assert arc.at("y", t) == pytest.approx(exact, abs=1e-12)  # the solver's 1e-13 a step


def test_a_proper_transfer_function_passes_its_input_on():
    automaton = lti(control.tf([2.0, 1.0], [1.0, 1.0], inputs=["u"], outputs=["y"]))
    t = np.linspace(0.0, 3.0, 13)
    arc = hm.simulate(automaton, 3.0, inputs={"u": 1.0})
    assert arc.at("y", t) == pytest.approx(1.0 + np.exp(-t), abs=1e-12)


def test_discrete_transfer_function_against_python_control():
    system = control.tf([0.3, 0.1, -0.2], [1.0, -0.7, 0.2], 0.25, inputs=["e"], outputs=["u"])
    times = 0.25 * np.arange(41)
    expected = control.forced_response(system, times, np.sin(times)).outputs
    arc = hm.simulate(lti(system), 10.0, inputs={"e": np.sin})
    assert arc.at("u", times) == pytest.approx(expected, abs=1e-13)  # rounding of another realisation


def test_names_can_be_given():
    automaton = lti(control.ss(-1.0, 1.0, 1.0, 0.0), "lag", inputs=["u"], outputs=["x"], state="inner")
    assert automaton.name == "lag"
    assert {"u", "x", "inner"} <= {variable.name for variable in automaton.variables}


def test_event_triggered_sensors_on_a_plant_of_python_control():
    """Each sensor sends when its value has moved by 0.02; the event times by matrix exponentials and bisection."""
    a, b, k = np.array([[0.0, 1.0], [-2.0, 3.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, -4.0]])
    drift = np.block([[a, b], [np.zeros((1, 3))]])
    fine = 5e-4  # most gaps are ten times this; crossings are looked for in every step, from the first one on
    step = expm(drift * fine)
    t, x = 0.0, np.array([0.8, -0.3])
    sent, expected = x.copy(), []
    while True:
        both = walk = np.concatenate([x, k @ sent])

        def reached(s, both=both, sent=sent):
            return np.abs(sent - (expm(drift * s) @ both)[:2]).max() - 0.02

        since = 0.0
        while np.abs(sent - walk[:2]).max() < 0.02 or since == 0.0:
            walk = step @ walk
            since += fine
        gap = brentq(reached, since - fine, since, xtol=1e-15, rtol=1e-14)
        if t + gap > 2.0:
            break
        t, x = t + gap, (expm(drift * gap) @ both)[:2]
        sensor = int(np.argmax(np.abs(sent - x)))
        sent[sensor] = x[sensor]
        expected.append((t, ("position.broadcast", "velocity.broadcast")[sensor]))
    arc = hm.simulate(control_plant_under_triggers(), 2.0)
    assert [jump.name for jump in arc.jumps] == [name for _, name in expected]
    # A location's error is some ulp; each one is carried on by a loop that is stable.
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _ in expected], abs=1e-10)
    assert len(expected) > 40


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (control.ss(-1.0, 1.0, 1.0, 0.0), r"'u\[0\]', which is no Python identifier: name the signals by inputs="),
        (control.tf([1.0, 0.0, 1.0], [1.0, 1.0]), "is improper: its numerator has degree 2, its denominator 1"),
        (control.tf([1.0], [1.0, 1.0], True), "with dt=True, whose sampling period is not known: give it in s"),
        (control.ss(-1.0, 1.0, 1.0, 0.0, dt=None), "has dt=None, so it may be continuous or discrete"),
        (control.nlsys(lambda t, x, u, p: -x, inputs=1, outputs=1, states=1), "is a NonlinearIOSystem: give"),
        (control.tf([[[1.0], [1.0]]], [[[1.0, 1.0], [1.0, 2.0]]]), "several inputs or outputs"),
    ],
)
def test_systems_that_cannot_be_parts_are_refused(system, message):
    with pytest.raises(hm.DeclarationError, match=message):
        lti(system)


def test_names_must_be_one_for_each_signal():
    with pytest.raises(hm.DeclarationError, match="has 1 inputs and 1 outputs, but 2 and 1 names were given"):
        lti(control.ss(-1.0, 1.0, 1.0, 0.0), inputs=["a", "b"], outputs=["y"])


def test_importing_the_package_does_not_import_python_control():
    code = (
        "import sys, hybrid_model, hybrid_model.models, hybrid_model.declare.state_space; "
        "sys.exit('control' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

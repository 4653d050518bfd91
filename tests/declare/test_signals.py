"""Inputs of runs: constants, functions of time, signals with breakpoints."""

import math

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.signals import Inputs
from hybrid_model.models import BouncingBall


class Plant(hm.HybridAutomaton):
    u = hm.Input(2.0)
    w = hm.Input([1.0, -1.0])
    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": s.u + s.w[0] + s.w[1]}


def inputs(**given):
    return Inputs(Layout(Plant()), given)


def test_inputs_not_given_keep_their_start_values():
    np.testing.assert_array_equal(inputs().at(0.0), [2.0, 1.0, -1.0])
    assert not inputs().vary


@pytest.mark.parametrize(
    ("w", "expected"),
    [
        ([3.0, 4.0], [3.0, 4.0]),
        (5.0, [5.0, 5.0]),
        (lambda t: [t, 2.0 * t], [0.5, 1.0]),
        (lambda t: t, [0.5, 0.5]),
        (hm.Signal(lambda t: np.array([1.0, 2.0])), [1.0, 2.0]),
    ],
)
def test_values_are_given_as_number_array_function_or_signal(w, expected):
    np.testing.assert_array_equal(inputs(w=w).at(0.5), [2.0, *expected])


def test_breakpoints_of_all_signals_come_in_order():
    given = inputs(u=hm.Signal(lambda t: 0.0, [3.0, 1.0]), w=hm.Signal(lambda t: 0.0, (2.0,)))
    assert [given.next_breakpoint(t) for t in (-1.0, 1.0, 2.5, 3.0)] == [1.0, 2.0, 3.0, math.inf]


def test_a_held_value_reports_whether_it_changed():
    given = inputs()
    assert given.hold("u", 3.0)
    assert not given.hold("u", 3.0)
    assert given.hold_element(2, 7.0)
    assert not given.hold_element(2, 7.0)
    np.testing.assert_array_equal(given.at(0.0), [3.0, 1.0, 7.0])


def test_a_copy_is_independent():
    one = inputs(u=lambda t: t)
    two = one.copy()
    two.hold("w", 9.0)
    np.testing.assert_array_equal(one.at(4.0), [4.0, 1.0, -1.0])
    np.testing.assert_array_equal(two.at(4.0), [4.0, 9.0, 9.0])


def test_the_array_returned_earlier_does_not_change():
    given = inputs()
    before = given.at(0.0).copy()
    held = given.at(0.0)
    given.hold_element(0, 8.0)
    np.testing.assert_array_equal(held, before)
    given = inputs()
    held = given.at(0.0)
    given.hold("u", 8.0)
    np.testing.assert_array_equal(held, before)


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"v": 1.0}, hm.DeclarationError, r"Plant has no input 'v'; it has u, w\."),
        ({"x": 1.0}, hm.DeclarationError, r"no input 'x'"),
        (
            {"u": [1.0, 2.0]},
            hm.DeclarationError,
            r"input u has shape \(\), but the value given has shape \(2,\): .* lambda t: np\.interp",
        ),
        ({"w": [1.0, 2.0, 3.0]}, hm.DeclarationError, r"input w has shape \(2,\)"),
        ({"u": "fast"}, hm.DeclarationError, r"Plant\.u = 'fast' is not a number"),
        ({"w": lambda t: [1.0, 2.0, 3.0]}, hm.SimulationError, r"input w has shape \(2,\), but .* gives shape \(3,\)"),
        ({"u": lambda t: [1.0]}, hm.SimulationError, r"input u has shape \(\), but .* shape \(1,\)"),
        ({"u": lambda t: "fast"}, hm.SimulationError, r"input u is 'fast' at t = 0 s"),
        ({"u": lambda t: None}, hm.SimulationError, r"input u is "),
    ],
)
def test_inputs_that_do_not_fit(given, error, sentence):
    with pytest.raises(error, match=sentence):
        hm.simulate(Plant(), 1.0, inputs=given)


def test_an_unknown_name_cannot_be_held():
    with pytest.raises(hm.DeclarationError, match="no input 'v'"):
        inputs().hold("v", 1.0)


@pytest.mark.parametrize(
    "give",
    [
        lambda: Inputs(Layout(BouncingBall())).hold("u", 1.0),
        lambda: hm.simulate(BouncingBall(), 1.0, inputs={"u": 1.0}),
    ],
    ids=["held", "in a run"],
)
def test_an_automaton_without_inputs_says_so(give):
    with pytest.raises(hm.DeclarationError, match=r"^BouncingBall has no input 'u'; it has no inputs: leave it out\.$"):
        give()


def test_a_run_follows_its_inputs():
    arc = hm.simulate(Plant(), 2.0, inputs={"u": math.sin, "w": hm.Signal(lambda t: [t >= 1.0, 0.0], [1.0])})
    assert arc.end.x == pytest.approx(1.0 - math.cos(2.0) + 1.0, abs=1e-12)
    assert arc.at("u", 0.25) == math.sin(0.25)
    np.testing.assert_array_equal(arc.at("w", [0.5, 1.0]), [[0.0, 0.0], [1.0, 0.0]])


def test_a_pulse_with_breakpoints_is_not_stepped_over():
    """A pulse of 1 from 50 s to 50.1 s into an integrator adds 0.1; a plain function of time may not show it."""

    def pulse(t):
        return 1.0 if 50.0 <= t < 50.1 else 0.0

    options = {"u": hm.Signal(pulse, [50.0, 50.1])}
    assert hm.simulate(Plant(), 100.0, inputs=options).end.x == pytest.approx(0.1, abs=1e-12)


def test_a_jump_that_no_step_crosses_names_the_remedy():
    with pytest.raises(
        hm.SimulationError, match=r"cannot go on at t = 50 s .* give it as a Signal with its breakpoints\.$"
    ):
        hm.simulate(
            Plant(),
            52.0,
            t_start=48.0,
            inputs={"u": lambda t: 1.0 if 50.0 <= t < 50.1 else 0.0},
            solver=hm.Solver(max_step=0.09),
        )

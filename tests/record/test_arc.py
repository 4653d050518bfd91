"""Hybrid arcs: samples, interpolation, both sides of jumps, names, and the domain."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat

FIRST = np.sqrt(2.0 / 9.81)


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 2.0)


class Mixed(hm.HybridAutomaton):
    """A vector, an input, an output and a parameter."""

    w = hm.State([1.0, 2.0])
    u = hm.Input(0.5)
    k = hm.Parameter(3.0)
    y = hm.Output()
    n = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"w": np.stack([s.u, -s.u])}

    def outputs(self, s):
        return {"y": s.k * s.w[0] + s.u}


def test_samples_are_the_solver_steps_and_both_sides_of_jumps(ball):
    assert len(ball.t) == len(ball.j) == len(ball["h"])
    assert (ball.t[0], ball.t[-1]) == (0.0, 2.0)
    assert sum(np.diff(ball.j)) == len(ball.jumps)
    at = np.flatnonzero(np.diff(ball.j))
    np.testing.assert_array_equal(ball.t[at], ball.t[at + 1])


def test_interpolation_between_samples_is_as_exact_as_the_samples(ball):
    t = np.linspace(0.0, FIRST, 57)[:-1]
    assert ball.at("h", t) == pytest.approx(1.0 - 9.81 / 2 * t**2, abs=1e-12)
    assert ball.at("v", t) == pytest.approx(-9.81 * t, abs=1e-12)


def test_interpolation_meets_the_samples_bit_by_bit(ball):
    inside = np.flatnonzero((np.diff(ball.j, prepend=0) == 0) & (np.diff(ball.j, append=ball.j[-1]) == 0))
    np.testing.assert_array_equal(ball.at("h", ball.t[inside]), ball["h"][inside])


def test_at_a_jump_the_later_side_is_the_default_and_the_earlier_can_be_had(ball):
    jump = ball.jumps[0]
    assert ball.at("v", jump.t) == jump.x_after[1] > 0.0
    assert ball.at("v", jump.t, before=True) == jump.x_before[1] < 0.0
    # Away from jumps there is no difference.
    assert ball.at("v", 0.2) == ball.at("v", 0.2, before=True)


def test_in_a_cascade_the_sides_are_those_of_the_first_and_the_last_jump():
    class Cascade(hm.HybridAutomaton):
        n = hm.DiscreteState(3, integer=True)

        def jump_set(self, s):
            return hm.least(s.n - 0.5, s.t - 1.0)

        def jump_map(self, s):
            return {"n": s.n - 1}

    arc = hm.simulate(Cascade(), 2.0)
    assert (arc.at("n", 1.0, before=True), arc.at("n", 1.0)) == (3.0, 0.0)


def test_sides_of_jumps_at_the_start_and_at_the_end():
    arc = hm.simulate(Thermostat(temperature=25.0), 1.0)
    assert (arc.at("heating", 0.0, before=True), arc.at("heating", 0.0)) == (1.0, 0.0)

    class Step(hm.HybridAutomaton):
        n = hm.DiscreteState(0)
        transitions = (hm.TimeEvent("step", lambda self, s: 1.0 + s.n, lambda self, s: {"n": s.n + 1}),)

    arc = hm.simulate(Step(), 1.0)
    assert (arc.at("n", 1.0, before=True), arc.at("n", 1.0), arc.end.n) == (0.0, 1.0, 1.0)


def test_values_before_and_after_a_jump_by_name(ball):
    jump = ball.jumps[1]
    before, after = ball.before(jump), ball.after(jump)
    assert (before.t, after.t) == (jump.t, jump.t)
    assert after.v == pytest.approx(-0.7 * before.v, abs=1e-15)
    assert (before.e, after.h) == (0.7, 0.0)


def test_event_times_by_name(ball):
    np.testing.assert_array_equal(ball.event_times("jump"), [jump.t for jump in ball.jumps])
    with pytest.raises(hm.DeclarationError, match=r"BouncingBall has no jump 'bounce'; it has jump"):
        ball.event_times("bounce")


def test_every_kind_of_variable_can_be_read():
    arc = hm.simulate(Mixed(), 1.0)
    assert arc["w"].shape == (len(arc.t), 2)
    assert arc.at("w", 0.5) == pytest.approx([1.25, 1.75], abs=1e-14)
    assert arc.at("w", [[0.0, 0.5, 1.0]]).shape == (1, 3, 2)
    assert arc.at("y", 0.5) == pytest.approx(3.0 * 1.25 + 0.5, abs=1e-14)
    assert arc["y"][-1] == pytest.approx(3.0 * 1.5 + 0.5, abs=1e-14)
    assert (arc.at("k", 0.1), arc.at("u", 0.1), arc.at("n", 0.1)) == (3.0, 0.5, 0.0)


def test_shapes_of_what_is_asked_for_are_kept():
    arc = hm.simulate(Mixed(), 1.0)
    assert arc.at("n", 0.5).shape == ()
    assert arc.at("n", []).shape == (0,)
    assert arc.at("w", []).shape == (0, 2)
    assert arc.at("w", np.zeros((2, 3))).shape == (2, 3, 2)


def test_elements_have_the_names_that_fmus_and_plots_give_them():
    class Decay(hm.HybridAutomaton):
        v = hm.State([1.0, 2.0])
        A = hm.Parameter([[1.0, 2.0], [3.0, 4.0]])

        def flow_map(self, s):
            return {"v": -s.v}

    arc = hm.simulate(Decay(), 1.0)
    np.testing.assert_array_equal(arc["v[2]"], arc["v"][:, 1])
    np.testing.assert_array_equal(arc.at("v[1]", [0.0, 0.5]), arc.at("v", [0.0, 0.5])[:, 0])
    assert arc.at("A[2,1]", 0.3) == 3.0
    assert arc.variable("v[2]").shape == ()
    assert list(arc.resample([0.0, 1.0], ["v[2]"]).values) == ["v[2]"]
    with pytest.raises(hm.DeclarationError, match=r"^Decay has no v\[3\]: v is an array of v\[1\] to v\[2\]\.$"):
        arc["v[3]"]


def test_the_end_has_all_values(ball):
    assert ball.end.t == 2.0
    assert ball.end.h == ball["h"][-1]


@pytest.mark.parametrize("t", [-1e-9, 2.0 + 1e-9, [0.5, 3.0]])
def test_times_outside_the_run_are_refused(ball, t):
    with pytest.raises(hm.DeclarationError, match=r"lies outside the run, which covers \[0, 2\] s"):
        ball.at("h", t)


@pytest.mark.parametrize("times", [0.5, []])
def test_unknown_names_are_refused(ball, times):
    with pytest.raises(hm.DeclarationError, match="BouncingBall has no variable 'x'"):
        ball.at("x", times)
    with pytest.raises(hm.DeclarationError, match="no variable 'x'"):
        ball["x"]


def test_the_text_of_an_arc_tells_what_ran_and_how_it_ended(ball):
    assert repr(ball) == f"HybridArc(BouncingBall: t from 0 to 2 s, {len(ball.jumps)} jumps, HORIZON)"


def test_an_arc_does_not_change_when_its_automaton_runs_again():
    automaton = BouncingBall()
    arc = hm.simulate(automaton, 1.0)
    before = arc["h"].copy()
    hm.simulate(automaton, 2.0)
    np.testing.assert_array_equal(arc["h"], before)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_outputs_are_computed_once_for_all_who_read_them_at_the_same_times(engine):
    calls = []

    class Counted(hm.HybridAutomaton):
        x = hm.State(0.0)
        a, b = hm.Output(), hm.Output()

        def flow_map(self, s):
            return {"x": 1.0}

        def outputs(self, s):
            calls.append(s.t)
            return {"a": 2.0 * s.x, "b": s.t - s.x}

    arc = hm.simulate(Counted(), 1.0, engine=engine)
    grid = np.linspace(0.0, 1.0, 11)
    first = arc.at("a", grid)
    first[:] = np.nan  # belongs to the caller
    before = len(calls)
    np.testing.assert_allclose(arc.at("b", grid), 0.0, atol=1e-12)
    np.testing.assert_allclose(arc.at("a", grid), 2.0 * grid, atol=1e-12)
    assert len(calls) == before
    np.testing.assert_allclose(arc.at("a", grid[:5] + 0.05), 2.0 * grid[:5] + 0.1, atol=1e-12)

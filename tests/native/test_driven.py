"""Inputs that follow time on the native engine: traced, or polynomials between breakpoints; and what is neither."""

import numpy as np
import pytest
from scipy.special import erf

import hybrid_model as hm


class Driven(hm.HybridAutomaton):
    """x' = u; counts the times that x passes a whole number upwards."""

    x = hm.State(0.0)
    n = hm.DiscreteState(1.0)
    u = hm.Input(0.0)

    def flow_map(self, s):
        return {"x": s.u}

    def jump_set(self, s):
        return s.x - s.n

    def jump_map(self, s):
        return {"n": s.n + 1.0}


class Follower(hm.HybridAutomaton):
    """Takes over a discrete input as soon as it is another one than before, to the last bit."""

    seen = hm.DiscreteState(0.0)
    u = hm.Input(0.0, discrete=True)

    def jump_set(self, s):
        return np.where(s.u != s.seen, 1.0, -1.0)

    def jump_map(self, s):
        return {"seen": s.u}


class Two(hm.HybridAutomaton):
    """w' = a vector that follows time, plus a number that does."""

    w = hm.State([0.0, 0.0])
    u = hm.Input([0.0, 0.0])
    b = hm.Input(0.0)

    def flow_map(self, s):
        return {"w": s.u + s.b}


def run(automaton, t_end, **inputs):
    return hm.simulate(automaton, t_end, inputs=inputs, engine="native")


def test_a_function_is_traced():
    """x = 1 - cos(t) + t passes 1, 2, 3, 4 and ends at 4.98."""
    arc = run(Driven(), 3.0, u=lambda t: np.sin(t) + 1.0)
    times = arc.event_times("jump")
    assert 1.0 - np.cos(times) + times == pytest.approx([1.0, 2.0, 3.0, 4.0], abs=1e-11)


def test_a_table_is_traced():
    """The integral of a hat of height 2 over [0, 2] is t^2, and then 2 - (2 - t)^2; it ends at 2 and stays there."""
    arc = run(Driven(), 4.0, u=lambda t: np.interp(t, [0.0, 1.0, 2.0], [0.0, 2.0, 0.0]))
    assert arc.event_times("jump")[0] == pytest.approx(1.0, abs=1e-9)
    times = np.linspace(0.0, 4.0, 41)
    exact = np.where(times <= 1.0, times**2, 2.0 - np.clip(2.0 - times, 0.0, None) ** 2)
    # The solver passes the kinks by error control, as any solver does.
    np.testing.assert_allclose(arc.at("x", times), exact, atol=1e-10)


@pytest.mark.parametrize(("outside", "area"), [({}, 12.0), ({"left": 1.0, "right": -1.0}, 2.0 + 4.0 - 2.0)])
def test_a_table_outside_of_its_places(outside, area):
    """Of the value 2 from 2 s to 4 s, over 6 s."""
    arc = run(Driven(), 6.0, u=lambda t: np.interp(t, [2.0, 4.0], [2.0, 2.0], **outside))
    # The solver passes a jump of the rates by ever shorter steps, down to its tolerance.
    assert arc.end["x"] == pytest.approx(area, abs=1e-8)


def test_polynomials_between_breakpoints():
    """u = t, then 1 - (t - 2)^2 from t = 2 on: a degree that the polynomials hold."""
    signal = hm.Signal(lambda t: t if t < 2.0 else 1.0 - (t - 2.0) ** 2, [2.0])
    arc = run(Driven(), 3.0, u=signal)
    assert arc.event_times("jump") == pytest.approx([np.sqrt(2.0), 2.0], abs=1e-11)
    assert arc.end["x"] == pytest.approx(2.0 + 1.0 - 1.0 / 3.0, abs=1e-12)


def test_a_short_pulse_is_seen():
    arc = run(Driven(), 100.0, u=hm.Signal(lambda t: 15.0 if 50.0 <= t < 50.1 else 0.0, [50.0, 50.1]))
    assert arc.event_times("jump") == pytest.approx([50.0 + 1.0 / 15.0], abs=1e-10)
    assert arc.end["x"] == pytest.approx(1.5, abs=1e-12)


def test_an_input_that_changes_at_the_end_is_seen_there():
    signal = hm.Signal(lambda t: 0.0 if t < 2.0 else 1.0, [2.0])
    for engine in ("native", "python"):
        arc = hm.simulate(Follower(), 2.0, inputs={"u": signal}, engine=engine)
        assert [(jump.t, jump.z_after[0]) for jump in arc.jumps] == [(2.0, 1.0)]


def test_constant_pieces_are_so_to_the_last_bit():
    values = [0.1, 0.7, 0.3, 0.1 + 0.2]
    signal = hm.Signal(lambda t: values[min(int(t), 3)], [1.0, 2.0, 3.0])
    arc = run(Follower(), 4.0, u=signal)
    assert [(jump.t, jump.z_after[0]) for jump in arc.jumps] == list(enumerate(values))


def test_elements_of_vectors_have_pieces_of_their_own():
    signal = hm.Signal(lambda t: [1.0, t] if t < 1.0 else [t * t, 2.0], [1.0])
    arc = run(Two(), 2.0, u=signal, b=lambda t: np.exp(-t))
    rest = 1.0 - np.exp(-2.0)
    np.testing.assert_allclose(arc.end["w"], [1.0 + 7.0 / 3.0 + rest, 0.5 + 2.0 + rest], atol=1e-12)


def test_a_signal_that_is_no_polynomial_runs_in_python():
    signal = hm.Signal(lambda t: float(np.exp(-(t**2))) if t < 3.0 else 0.0, [3.0])
    arc = hm.simulate(Driven(), 4.0, inputs={"u": signal})
    assert arc.engine.startswith("python: the signal given for input u is no polynomial of degree 8 or less from t = 0")
    assert arc.end["x"] == pytest.approx(0.5 * np.sqrt(np.pi) * erf(3.0), abs=1e-11)


def test_pieces_that_are_no_polynomials_are_traced():
    """u = sin t until t = 2 and then exp(2 - t): each step that ends at t = 2 sees the sine only."""
    signal = hm.Signal(lambda t: np.where(t < 2.0, np.sin(t), np.exp(2.0 - t)), [2.0])
    arc = run(Driven(), 4.0, u=signal)
    assert arc.event_times("jump") == pytest.approx([np.pi / 2.0, 2.0 - np.log(-np.cos(2.0))], abs=1e-11)
    times = np.linspace(0.0, 4.0, 81)
    exact = np.where(times < 2.0, 1.0 - np.cos(times), 1.0 - np.cos(2.0) + 1.0 - np.exp(2.0 - times))
    np.testing.assert_allclose(arc.at("x", times), exact, rtol=0, atol=1e-13)
    assert arc.statistics.rejected == 0


def test_a_discrete_input_that_changes_between_its_breakpoints_runs_in_python():
    arc = hm.simulate(Follower(), 1.0, inputs={"u": hm.Signal(lambda t: 1.0, [0.5])})
    assert arc.engine.startswith("native: its maps are compiled, together with")
    with pytest.raises(hm.SimulationError, match="the discrete input u changes between its breakpoints"):
        run(Follower(), 1.0, u=hm.Signal(lambda t: t, [0.5]))


FACTOR = 1.0


class Global(hm.HybridAutomaton):
    """Reads a constant of its module, as a notebook's models do."""

    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": FACTOR}


def test_a_constant_that_changes_between_two_runs_changes_the_run(monkeypatch):
    automaton = Global()
    assert run(automaton, 1.0).end["x"] == pytest.approx(1.0)
    monkeypatch.setitem(globals(), "FACTOR", 3.0)
    assert run(automaton, 1.0).end["x"] == pytest.approx(3.0)
    assert run(Global(), 1.0).end["x"] == pytest.approx(3.0)

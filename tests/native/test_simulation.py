"""Runs on the native engine: what runs where, and what is kept of a run."""

import functools
import pickle

import numpy as np
import pytest
from catalogue import cases

import hybrid_model as hm
from hybrid_model.errors import SimulationError
from hybrid_model.native.run import NativeRun


def test_inputs_that_vary_and_a_copy_of_the_run():
    """A driven integrator: x' = u(t) with u a sine and then a step; x in closed form."""

    class Integrator(hm.HybridAutomaton):
        x = hm.State(0.0)
        u = hm.Input(0.0)

        def flow_map(self, s):
            return {"x": s.u}

        def jump_set(self, s):
            return s.x - 1.5

        def jump_map(self, s):
            return {"x": 0.0}

    signal = hm.Signal(lambda t: np.sin(t) if t < np.pi else 1.0, [np.pi])
    arc = hm.simulate(Integrator(), 5.0, inputs={"u": signal})
    assert arc.engine.startswith("python: the signal given for input u is no polynomial")
    first = np.arccos(-0.5)
    # x(pi) = 0.5 after the jump, then slope one.
    assert [jump.t for jump in arc.jumps] == pytest.approx([first, np.pi + 1.0], abs=1e-11)
    assert arc.at("x", 4.5) == pytest.approx(4.5 - np.pi - 1.0, abs=1e-11)


class Branching(hm.HybridAutomaton):
    x = hm.State(0.5)

    def flow_map(self, s):
        return {"x": -1.0 if s.x > -10.0 else -2.0}


def test_an_automaton_that_cannot_be_traced_runs_in_python_and_says_why():
    arc = hm.simulate(Branching(), 1.0)
    assert arc.at("x", 1.0) == pytest.approx(-0.5)
    assert arc.statistics is None
    assert arc.engine.startswith("python: flow_map of Branching cannot be traced: a condition on a traced value")
    with pytest.raises(SimulationError, match=r"Branching cannot run on the native engine: .*np\.where"):
        hm.simulate(Branching(), 1.0, engine="native")


def test_a_long_run_of_a_smooth_flow_is_not_given_up():
    """Of some 1e7 steps at its pace, which are a matter of ten seconds."""

    class Oscillator(hm.HybridAutomaton):
        x = hm.State(1.0)
        v = hm.State(0.0)

        def flow_map(self, s):
            return {"x": s.v, "v": -s.x}

        def jump_set(self, s):
            return s.t - 100.0

        def jump_map(self, s):
            return {"x": np.nan}

    # The run goes on to the jump, which ends it, and is not given up for its pace at the first look.
    with pytest.raises(hm.SimulationError, match="x = nan after jump 'jump' at t = 100 s"):
        hm.simulate(Oscillator(), 1e5, engine="native", record="events")


@functools.lru_cache
def rate():
    return 1.0


class Cached(hm.HybridAutomaton):
    """Reads what a cache holds: nobody can tell from outside whether that changes."""

    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": rate()}


def test_what_ran_is_told():
    ball = cases()["bouncing_ball"].automaton
    assert hm.simulate(ball, 1.0).engine == "native: its maps are compiled."
    again = Cached()
    assert hm.simulate(again, 1.0).engine.startswith("native: its maps are compiled, and traced anew for each run: ")
    assert hm.simulate(ball, 1.0, engine="python").engine == 'python: it was asked for (engine="python").'
    with pytest.raises(SimulationError, match="engine = 'c': give one of 'auto', 'native', 'python'"):
        hm.simulate(ball, 1.0, engine="c")


@pytest.mark.parametrize("solver", [hm.Solver(method="LSODA"), hm.Solver(scan_points=16)], ids=str)
def test_what_only_the_python_engine_can_do_it_does(solver):
    arc = hm.simulate(cases()["bouncing_ball"].automaton, 1.0, solver=solver)
    assert arc.engine.startswith("python: the native engine")


def test_without_a_compiler_everything_runs_in_python(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")

    class Falling(hm.HybridAutomaton):
        h = hm.State(1.0)

        def flow_map(self, s):
            return {"h": -s.t}

    arc = hm.simulate(Falling(), 1.0)
    assert arc.at("h", 1.0) == pytest.approx(0.5)
    assert "no program 'no-such-compiler'" in arc.engine


class Relaxation(hm.HybridAutomaton):
    """Van der Pol's oscillator, not declared stiff; it is set back on the slow branch, before it leaves it."""

    x = hm.State(2.0)
    v = hm.State(0.0)
    mu = hm.Parameter(300.0)
    turns = hm.DiscreteState(0.0)

    def flow_map(self, s):
        return {"x": s.v, "v": s.mu * (1.0 - s.x**2) * s.v - s.x}

    def jump_set(self, s):
        return 1.2 - s.x

    def jump_map(self, s):
        return {"x": 2.0, "v": 0.0, "turns": s.turns + 1.0}


def test_a_stiff_flow_is_found_and_each_run_of_it_is_the_same():
    first, again = (hm.simulate(Relaxation(), 1500.0, engine="native") for _ in range(2))
    assert first.statistics.jacobians > 1000
    # A turn takes mu (ln x - x^2 / 2) between 1.2 and 2, but for terms of 1/mu.
    assert len(first.jumps) == int(1500.0 / (300.0 * (np.log(1.2) - 0.72 - np.log(2.0) + 2.0))) == 6
    np.testing.assert_array_equal(first.event_times("jump"), again.event_times("jump"))
    asked = hm.simulate(Relaxation(), 1500.0, engine="native", solver=hm.Solver(method="Radau"))
    assert asked.statistics.jacobians > 1000
    # At a relative tolerance of 1e-12, where x changes by 0.009 in a second.
    assert asked.event_times("jump") == pytest.approx(first.event_times("jump"), abs=1e-8)
    plain = hm.simulate(Relaxation(), 300.0, engine="python", solver=hm.Solver(method="Radau", rtol=1e-11))
    assert first.event_times("jump")[:1] == pytest.approx(plain.event_times("jump"), abs=1e-7)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_events_only(engine):
    """Both sides of each jump and the end are kept, and a state between them is refused."""
    ball = cases()["bouncing_ball"].automaton
    whole, events = (hm.simulate(ball, 2.0, engine=engine, record=record) for record in ("all", "events"))
    assert len(events.t) == 2 * (len(events.jumps) + 1)
    np.testing.assert_array_equal(events.event_times("jump"), whole.event_times("jump"))
    for one, other in zip(events.jumps, whole.jumps, strict=True):
        np.testing.assert_array_equal(one.x_before, other.x_before)
        assert events.before(one)["v"] == whole.before(other)["v"]
    assert events.end["h"] == whole.end["h"]
    assert events.t[-1] == 2.0
    for read in (lambda: events.at("h", 0.1), lambda: events.resample([0.1]), lambda: events.restrict(t=(0.1, 1.0))):
        with pytest.raises(hm.DeclarationError, match=r"kept its events only, and t = 0\.1 s lies between two of them"):
            read()


def test_what_a_run_costs_is_counted():
    ball = cases()["bouncing_ball"].automaton
    arc = hm.simulate(ball, 2.0, engine="native")
    cost = arc.statistics
    assert cost.jumps == len(arc.jumps)
    assert cost.steps == sum(len(flow.pieces) for flow in arc._record.flows)
    assert cost.evaluations > cost.steps
    assert cost.probes > cost.jumps


def test_a_run_and_its_parts_are_pickled():
    arc = hm.simulate(cases()["bouncing_ball"].automaton, 2.0, engine="native")
    again = pickle.loads(pickle.dumps(arc))
    np.testing.assert_array_equal(again["h"], arc["h"])
    assert again.at("h", 0.3) == arc.at("h", 0.3) == arc.restrict(t=(0.2, 0.4)).at("h", 0.3)


class Oscillator(hm.HybridAutomaton):
    x = hm.State(1.0)
    v = hm.State(0.0)
    passes = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"x": s.v, "v": -s.x}

    def jump_set(self, s):
        return hm.least(s.t - 40.0 * (s.passes + 1), 1.0)

    def jump_map(self, s):
        return {"passes": s.passes + 1}


def test_a_run_that_pauses_often_is_the_same(monkeypatch):
    """Pauses are there so that a run can be interrupted."""
    whole = hm.simulate(Oscillator(), 100.0, engine="native")
    monkeypatch.setattr("hybrid_model.native.simulation.STEPS_AT_ONCE", 7)
    paused = hm.simulate(Oscillator(), 100.0, engine="native")
    np.testing.assert_array_equal(paused.t, whole.t)
    np.testing.assert_array_equal(paused["x"], whole["x"])
    # Each goes on with an evaluation of the rates.
    assert paused.statistics.steps == whole.statistics.steps


def test_a_run_of_many_states_can_be_interrupted_after_fewer_steps(monkeypatch):
    """A step of many states takes longer; an interrupt is heard between two advances."""

    class Many(hm.HybridAutomaton):
        x = hm.State(np.ones(100))

        def flow_map(self, s):
            return {"x": np.cos(40.0 * s.t) - s.x}

    counts, advance = [], NativeRun.advance

    def counted(run, *given, **named):
        ended = advance(run, *given, **named)
        counts.append(run.statistics.steps)
        return ended

    monkeypatch.setattr(NativeRun, "advance", counted)
    hm.simulate(Many(), 20.0, engine="native")
    assert len(counts) > 1
    assert np.diff(counts, prepend=0).max() * 100 <= 1e5


class Chain(hm.HybridAutomaton):
    """Quadratures of two levels whose steps need many terms; the way starts anew at each whole second."""

    way = hm.State(0.2)
    speed = hm.State(0.5)
    due = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"way": s.speed, "speed": np.cos(3.0 * s.t)}

    transitions = (hm.TimeEvent("anew", lambda self, s: s.due, lambda self, s: {"way": 0.0, "due": s.due + 1.0}),)


def test_quadratures_are_recorded_to_rounding_in_all_forms(tmp_path):
    """Times within steps, parts, samples, copies and files against the closed form, which no step meets by itself."""
    arc = hm.simulate(Chain(), 2.5, engine="native")
    t = np.linspace(0.0, 2.5, 401)[1:]
    begun = np.floor(t)

    def integral(t):
        return 0.5 * t - np.cos(3.0 * t) / 9.0

    way = np.where(begun == 0.0, 0.2, 0.0) + integral(t) - integral(begun)
    arc.save(tmp_path / "arc.npz")
    part = arc.restrict(t=(0.3, 1.8))
    inside = (t >= 0.3) & (t <= 1.8)
    forms = {
        "itself": (arc.at("way", t), way),
        "copied": (pickle.loads(pickle.dumps(arc)).at("way", t), way),
        "resampled": (arc.resample(t)["way"], way),
        "in part": (part.at("way", t[inside]), way[inside]),
        "from a file": (hm.load_arc(tmp_path / "arc.npz").at("way", t), way),
    }
    for form, (found, expected) in forms.items():
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-14, err_msg=form)
    assert arc.statistics.steps <= 9
    events = hm.simulate(Chain(), 2.5, record="events", engine="native")
    assert [jump.x_before[0] for jump in events.jumps] == pytest.approx(
        [0.2 + integral(1.0) - integral(0.0), integral(2.0) - integral(1.0)], abs=2e-14
    )


class Decay(hm.HybridAutomaton):
    x = hm.State(1.0)

    def flow_map(self, s):
        return {"x": -1e3 * s.x}


@pytest.mark.parametrize("parts", [40, 120])
def test_a_network_steps_implicitly_where_it_can_and_says_where_it_cannot(parts):
    network = hm.Composition("decays", {f"d{k}": Decay() for k in range(parts)}, {})
    radau = hm.Solver(method="Radau", rtol=1e-6)
    arc = hm.simulate(network, 1.0, solver=radau)
    assert arc.end["d7.x"] == pytest.approx(0.0, abs=1e-6)
    if parts == 40:
        assert arc.engine.startswith("native")
        assert arc.statistics.jacobians > 0
    else:
        assert arc.engine.startswith(
            "python: the native engine has no method for a stiff flow of a network of 120 states"
        )
        with pytest.raises(hm.SimulationError, match="no method for a stiff flow"):
            hm.simulate(network, 1.0, solver=radau, engine="native")


class SquareWave(hm.HybridAutomaton):
    """A rate that changes its sign twice a period, which nobody has declared."""

    x = hm.State(0.025)

    def flow_map(self, s):
        return {"x": np.sign(np.sin(20.0 * np.pi * s.t))}


class SquareWaveOfState(SquareWave):
    """The same of a phase, and no quadrature: x has a part in its own rate."""

    phase = hm.State(0.025)

    def flow_map(self, s):
        return {"phase": 1.0, "x": np.sign(np.sin(20.0 * np.pi * s.phase)) - 1e-14 * s.x}


@pytest.mark.parametrize("automaton", [SquareWave(), SquareWaveOfState()], ids=lambda automaton: automaton.name)
def test_jumps_of_rates_are_passed_where_floats_of_time_are_coarse(automaton):
    """From t = 64 s on a float of time is 1.4e-14 s: a jump of the rate by 2 leaves 3e-14 of the state open."""
    arc = hm.simulate(automaton, 70.05, t_start=64.025, engine="native")
    assert arc.end.x == pytest.approx(0.05, abs=1e-10)

"""The verifier: what is a hybrid arc passes, whoever made it; whatever is changed in one, or made wrongly, is found."""

import ast
import dataclasses
import io
import itertools
import pathlib
import re
import sys

import fmpy
import fmpy.util
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from small_automata import Corridor, PatientCorridor, Timer

import hybrid_model as hm
from cosim.cli.main import main
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import DeclarationError
from hybrid_model.models import BouncingBall, RelayHysteresis, Thermostat, TwoTank

G, E = 9.81, 0.7


def rules(report):
    return {violation.rule for violation in report.violations}


def changed(samples, **arrays):
    """The samples with other t, j, or values of a variable."""
    values = {name: arrays.pop(name, value) for name, value in samples.values.items()}
    return dataclasses.replace(samples, **arrays, values=values)


def moved(samples, name, k, by):
    value = samples[name].copy()
    value[k] += by
    return changed(samples, **{name: value})


# Hybrid arcs pass: those of the engines do in tests/agreement.


def ball_by_hand(impacts=3, shift=0.0, loss=E, points=5, height=1.0):
    """A bouncing ball in closed form; the second impact is taken `shift` s late."""
    t, j, h, v = [], [], [], []
    t0, h0, v0 = 0.0, height, 0.0
    for n in range(impacts + 1):
        flight = (v0 + np.sqrt(v0**2 + 2.0 * G * h0)) / G + (shift if n == 1 else 0.0)
        since = np.linspace(0.0, flight, points)
        t += list(t0 + since)
        j += [n] * points
        h += list(h0 + v0 * since - G / 2 * since**2)
        v += list(v0 - G * since)
        t0, h0, v0 = t[-1], 0.0, -loss * v[-1]
    return hm.Samples(t, j, {"h": h, "v": v})


@pytest.mark.parametrize("text", ["t,j,h,v\n", "time,h,v\n"])
def test_of_no_data_nothing_can_be_said(tmp_path, text):
    (tmp_path / "empty.csv").write_text(text)
    with pytest.raises(hm.DataError, match="the data hold no sample, so nothing can be said about BouncingBall"):
        hm.verify(BouncingBall(), hm.Samples.from_csv(tmp_path / "empty.csv"))


def test_tables_of_fmpy_and_of_the_command_line_are_read(exported, tmp_path, capsys):
    file = exported(BouncingBall())
    fmpy.util.write_csv(
        tmp_path / "fmpy.csv",
        fmpy.simulate_fmu(
            str(file), stop_time=2.0, use_event_mode=True, early_return_allowed=True, output_interval=0.1
        ),
    )
    report = hm.verify(BouncingBall(), hm.Samples.from_csv(tmp_path / "fmpy.csv"))
    # With both sides of the impacts at 0.45, 1.08, 1.53 and 1.84 s.
    assert (report.ok, report.jumps) == (True, 4)
    assert main(["cosim", str(file), "--stop-time", "2", "--output-file", str(tmp_path / "cosim.csv")]) == 0
    report = hm.verify(BouncingBall(), hm.Samples.from_csv(tmp_path / "cosim.csv"))
    assert (report.ok, report.jumps) == (True, 4)
    assert main(["simulate", "paper-a", "--stop-time", "0.1", "--out", str(tmp_path)]) == 0
    samples = hm.Samples.from_csv(tmp_path / "trajectory.csv")
    assert samples["agent2.x"][0] == 2.0
    capsys.readouterr()


def test_names_with_the_block_before_them_as_in_a_co_simulation():
    samples = ball_by_hand()
    scoped = hm.Samples(samples.t, samples.j, {f"BouncingBall.{name}": samples[name] for name in samples.values})
    assert hm.verify(BouncingBall(), scoped).ok
    with pytest.raises(hm.DataError, match=r"the samples have no h, a state of other: give a column for each of h, v"):
        hm.verify(BouncingBall("other"), scoped)


def test_data_from_elsewhere_that_is_right_passes():
    report = hm.verify(BouncingBall(), ball_by_hand())
    assert report.ok
    assert (report.samples, report.flows, report.jumps) == (20, 4, 3)
    assert str(report) == "a hybrid arc of BouncingBall: 20 samples, 4 flows and 3 jumps checked."


def test_arcs_tables_and_files_of_one_run_all_pass(tmp_path):
    arc = hm.simulate(BouncingBall(), 2.0)
    arc.save(tmp_path / "ball.npz")
    arc.samples().to_csv(tmp_path / "ball.csv")
    for data in (
        arc,
        arc.samples(),
        arc.to_dataframe(),
        hm.load_arc(tmp_path / "ball.npz"),
        hm.Samples.from_csv(tmp_path / "ball.csv"),
    ):
        assert hm.verify(BouncingBall(), data).ok


RUNS = {
    "ball": hm.simulate(BouncingBall(), 2.0),
    "thermostat": hm.simulate(Thermostat(), 60.0),
    "two tanks": hm.simulate(TwoTank(), 3.0),
    "relay": hm.simulate(RelayHysteresis(), 5.0),
}
DRAWN = st.sampled_from(sorted(RUNS))


@settings(deadline=None, max_examples=40)
@given(DRAWN, st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).map(sorted))
def test_parts_of_hybrid_arcs_are_hybrid_arcs(name, ends):
    arc = RUNS[name]
    part = arc.restrict(t=tuple(arc.t[-1] * end for end in ends))
    report = hm.verify(arc.automaton, part)
    assert report.ok, str(report)


@settings(deadline=None, max_examples=40)
@given(DRAWN, st.randoms(use_true_random=False))
def test_samples_between_jumps_may_be_left_out(name, random):
    samples = RUNS[name].samples()
    steps = np.diff(samples.j, prepend=-1) == 0
    inside = steps & (np.diff(samples.j, append=samples.j[-1] + 1) == 0)
    kept = ~inside | (np.array([random.random() for _ in inside]) < 0.5)
    thin = hm.Samples(samples.t[kept], samples.j[kept], {name: value[kept] for name, value in samples.values.items()})
    assert hm.verify(RUNS[name].automaton, thin).ok


@pytest.mark.parametrize("method", ["Radau", "RK45", "DOP853"])
def test_the_integrator_can_be_chosen(method):
    assert hm.verify(Thermostat(), RUNS["thermostat"].restrict(j=(0, 3)), method=method).ok


# Every kind of change is found.


@settings(deadline=None, max_examples=40)
@given(DRAWN, st.floats(0.0, 1.0), st.floats(0.0, 1.0, exclude_max=True), st.floats(1e-5, 1.0), st.booleans())
def test_a_value_moved_anywhere_is_found(name, where, which, by, down):
    # By at least 1e-5: more than atol + rtol |value|, where values are below 100. The first sample may be anything.
    samples = RUNS[name].samples()
    names = [v.name for v in RUNS[name].automaton.of_kind(Kind.STATE, Kind.DISCRETE)]
    k = 1 + round(where * (len(samples) - 2))
    report = hm.verify(RUNS[name].automaton, moved(samples, names[int(which * len(names))], k, -by if down else by))
    assert not report.ok
    assert min(violation.sample for violation in report.violations) in (k - 1, k)


@settings(deadline=None, max_examples=40)
@given(DRAWN, st.floats(0.0, 1.0, exclude_max=True))
def test_a_jump_left_out_is_found(name, which):
    samples = RUNS[name].samples()
    jumps = np.flatnonzero(np.diff(samples.j))
    k = jumps[int(which * len(jumps))]
    report = hm.verify(RUNS[name].automaton, changed(samples, j=samples.j - (np.arange(len(samples)) > k)))
    assert not report.ok
    assert min(violation.sample for violation in report.violations) in (k, k + 1)


@settings(deadline=None, max_examples=40)
@given(st.floats(1e-6, 0.1), st.booleans())
def test_an_event_at_another_time_is_found(by, early):
    # 0.1 s is less than a third of the flight.
    report = hm.verify(BouncingBall(), ball_by_hand(shift=-by if early else by))
    if early:
        assert [violation.rule for violation in report.violations] == [3]
        assert "a jump was taken while none was due: 'jump' has margin -" in report.violations[0].message
    else:
        assert {2, 3} >= rules(report) >= {2}
    assert {violation.j for violation in report.violations} == {1}


def test_a_late_event_is_told_as_a_jump_passed_by():
    report = hm.verify(BouncingBall(), ball_by_hand(shift=0.02))
    assert rules(report) == {2, 3}
    assert "jump 'jump' is due at t = " in str(report)
    assert "the flow is outside the flow set at t = " in str(report)


def test_the_tolerance_of_time_is_the_users():
    late = ball_by_hand(shift=1e-5)
    assert not hm.verify(BouncingBall(), late).ok
    # The ball is 5e-5 m below the floor then, and leaves it from there.
    assert hm.verify(BouncingBall(), late, tolerances=hm.Tolerances(time=2e-5, atol=1e-6)).ok


def test_another_reset_is_found_at_every_jump():
    report = hm.verify(BouncingBall(), ball_by_hand(loss=0.71))
    assert [(v.rule, v.j) for v in report.violations] == [(2, 0), (2, 1), (2, 2)]
    first = report.violations[0].message
    assert first.startswith("jump 'jump' was due and leads to v = 3.1006")
    assert "but the samples go to 3.1449" in first


def test_other_parameters_are_found():
    assert rules(hm.verify(BouncingBall(g=9.8), ball_by_hand())) == {2}
    assert "v is -1.107" in str(hm.verify(BouncingBall(g=9.8), ball_by_hand()))
    assert len(hm.verify(BouncingBall(e=0.8), RUNS["ball"]).violations) == len(RUNS["ball"].jumps)


def test_scipy_falling_through_the_floor_is_found():
    """SciPy restarted at each impact, until it misses one: the ball falls, with status 0."""

    def fall(t, y):
        return [y[1], -G]

    def floor(t, y):
        return y[0]

    floor.terminal, floor.direction = True, -1.0
    t, j, h, v = [], [], [], []
    now, state, number, status = 0.0, [1.0, 0.0], 0, 1
    while status == 1 and number < 200:
        run = solve_ivp(fall, (now, 5.0), state, method="DOP853", events=floor, rtol=1e-10, atol=1e-12)
        t, j = [*t, *run.t], [*j, *[number] * len(run.t)]
        h, v = [*h, *run.y[0]], [*v, *run.y[1]]
        now, state, number, status = run.t[-1], [run.y[0, -1], -E * run.y[1, -1]], number + 1, run.status
    assert status == 0
    assert min(h) < -10.0
    report = hm.verify(BouncingBall(), hm.Samples(t, j, {"h": h, "v": v}))
    assert rules(report) == {2, 3}
    # The impacts before that are right.
    assert all(violation.j == number - 1 for violation in report.violations)
    fallen = next(violation for violation in report.violations if violation.rule == 2)
    assert fallen.t == pytest.approx(np.sqrt(2.0 / G) * (1.0 + E) / (1.0 - E), abs=1e-3)
    assert "the flow is outside the flow set" in fallen.message


def euler_loop(automaton, step, count):
    """What people write by hand: Euler steps, events at the end of the step, the automaton's own maps."""
    layout = Layout(automaton)
    vectors = {kind: layout.start(kind) for kind in (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)}

    def values(t):
        return layout.values(t, *vectors.values())

    def write(assigned):
        for kind in (Kind.STATE, Kind.DISCRETE):
            vectors[kind] = layout.pack(kind, assigned, vectors[kind])

    def due(t):
        margins, times = iter(automaton.jump_margins(values(t))), iter(automaton.event_times(values(t)))
        for index, info in enumerate(automaton.jumps):
            if (next(margins) >= 0.0) if info.trigger is Trigger.STATE else (next(times) <= t):
                return index
        return None

    write(automaton.start_values(values(0.0)))
    rows = [(0.0, 0, dict(vectors))]
    for k in range(1, count + 1):
        rates = layout.pack(Kind.STATE, automaton.derivatives(values((k - 1) * step)))
        vectors[Kind.STATE] = vectors[Kind.STATE] + step * rates
        rows.append((k * step, rows[-1][1], dict(vectors)))
        while (index := due(k * step)) is not None:
            write(automaton.reset(index, values(k * step)))
            rows.append((k * step, rows[-1][1] + 1, dict(vectors)))
    states = automaton.of_kind(Kind.STATE, Kind.DISCRETE)
    table = [layout.values(t, *row.values()) for t, _, row in rows]
    return hm.Samples(
        [t for t, _, _ in rows], [j for _, j, _ in rows], {v.name: [s[v.name] for s in table] for v in states}
    )


def test_a_fixed_step_loop_of_the_papers_example_is_found():
    automaton = closed_loop(load_scenario("paper-a"))
    data = euler_loop(automaton, 0.01, 100)
    assert data.j[-1] > 5
    report = hm.verify(automaton, data)
    # Euler's error in the states, broadcasts and switchings of weights late by up to a step.
    assert rules(report) >= {2, 3}
    assert "but the flow map leads from the sample before to" in str(report)
    assert "broadcast" in str(report) or "is due at" in str(report)


def test_a_fixed_step_loop_is_exact_where_euler_is_and_events_lie_on_the_grid():
    # The timer has no flow, and its ticks come at whole seconds: binary fractions of a second meet them.
    assert hm.verify(Timer(first=1.0), euler_loop(Timer(first=1.0), 0.125, 40)).ok
    # A tick at the very start is left out by the loop.
    assert rules(hm.verify(Timer(), euler_loop(Timer(), 0.125, 40))) == {5}
    report = hm.verify(Timer(first=0.1), euler_loop(Timer(first=0.1), 0.125, 40))
    assert rules(report) == {5}
    assert "time event 'tick' was due at 0.1 s and is passed by" in report.violations[0].message


def test_a_discrete_state_that_changes_in_a_flow_is_found():
    samples = RUNS["thermostat"].samples()
    flow = np.flatnonzero(samples.j == 2)
    heating = samples["heating"].copy()
    heating[flow[1] :] = 1.0 - heating[flow[1] :]
    report = hm.verify(Thermostat(), changed(samples, heating=heating))
    first = report.violations[0]
    assert (first.rule, first.sample) == (1, flow[1])
    assert "heating changes from" in first.message
    assert "without a jump" in first.message


# Hybrid time and numbers.


@pytest.mark.parametrize(
    ("change", "rule", "message"),
    [
        (lambda s: {"j": s.j + (np.arange(len(s)) > 6)}, 1, "j goes from 1 to 2: it counts one by one|took|was due"),
        (lambda s: {"j": s.j + 5 * (s.j > 1)}, 1, "j goes from 1 to 7: it counts one by one"),
        (lambda s: {"j": -s.j}, 1, "j goes from 0 to -1"),
        (lambda s: {"t": np.where(np.arange(len(s)) == 2, 0.9, s.t)}, 1, "t goes back from 0.9 s to"),
        (lambda s: {"t": s.t + 1e-3 * s.j}, 1, "in a jump: jumps take no time"),
        (lambda s: {"t": np.where(np.arange(len(s)) == 2, np.nan, s.t)}, 10, "t is nan: states and times are finite"),
        (lambda s: {"h": np.where(np.arange(len(s)) == 2, np.inf, s["h"])}, 10, "h is inf: states and times are"),
    ],
)
def test_broken_hybrid_time_and_numbers_are_found(change, rule, message):
    samples = ball_by_hand()
    report = hm.verify(BouncingBall(), changed(samples, **change(samples)))
    if rule == 1 and "took" in message:
        # A jump put into a flow: nothing was due there.
        assert rules(report) >= {3}
        return
    assert rule in rules(report)
    assert any(v.rule == rule and message in v.message for v in report.violations)


def test_a_jump_put_into_a_flow_is_found():
    samples = ball_by_hand()
    report = hm.verify(BouncingBall(), changed(samples, j=samples.j + (np.arange(len(samples)) > 6)))
    assert any(v.rule == 1 and "jumps take no time" in v.message for v in report.violations)
    assert any(v.rule == 3 and "while none was due" in v.message for v in report.violations)


# Sets, priorities, order.


def test_priorities_are_told_apart():
    # With priority of jumps the corridor is left at its door, with priority of flow at its wall.
    eager, patient = hm.simulate(Corridor(), 3.5), hm.simulate(PatientCorridor(), 3.5)
    assert hm.verify(Corridor(), eager).ok
    assert hm.verify(PatientCorridor(), patient).ok
    report = hm.verify(PatientCorridor(), eager)
    assert rules(report) == {2}
    assert "jump 'jump' was taken with margin 1 of the flow set left: flow has priority" in str(report)
    report = hm.verify(Corridor(), patient)
    assert rules(report) == {3}
    assert "jump 'jump' is due at t = " in str(report)


class Doors(hm.HybridAutomaton):
    """At 1 s two jumps become due together."""

    armed = hm.DiscreteState(0, integer=True)
    a = hm.DiscreteState(0, integer=True)
    b = hm.DiscreteState(0, integer=True)
    transitions = (
        hm.TimeEvent("arm", lambda self, s: 1.0 + s.armed, lambda self, s: {"armed": s.armed + 1}),
        hm.Jump("first", lambda self, s: hm.least(s.armed - 0.5, 0.5 - s.a), lambda self, s: {"a": 1}),
        hm.Jump("second", lambda self, s: hm.least(s.armed - 0.5, 0.5 - s.b), lambda self, s: {"b": 1}),
    )


def test_the_order_of_simultaneous_jumps_is_checked():
    t, j, armed = [0.0, 1.0, 1.0, 1.0, 1.0, 1.5], [0, 0, 1, 2, 3, 3], [0, 0, 1, 1, 1, 1]
    early, late = [0, 0, 0, 1, 1, 1], [0, 0, 0, 0, 1, 1]
    assert hm.verify(Doors(), hm.Samples(t, j, {"armed": armed, "a": early, "b": late})).ok
    report = hm.verify(Doors(), hm.Samples(t, j, {"armed": armed, "a": late, "b": early}))
    assert [violation.rule for violation in report.violations] == [6]
    assert "jump 'second' was taken although 'first', which comes before it, was due" in report.violations[0].message


def test_a_time_event_taken_early_is_found():
    t, j, k = [0.0, 0.9, 0.9, 1.0], [0, 0, 1, 1], [0, 0, 1, 1]
    report = hm.verify(Timer(first=1.0), hm.Samples(t, j, {"k": k}))
    assert [violation.rule for violation in report.violations] == [5]
    assert "'tick' is due 0.1 s later" in report.violations[0].message


class Window(hm.HybridAutomaton):
    """Passes a window of the jump set at `centre`; its flow set excludes the same window if it has a wall."""

    x = hm.State(0.0)
    centre = hm.Parameter(1.1)
    width = hm.Parameter(0.02)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return s.width**2 - (s.x - s.centre) ** 2

    def jump_map(self, s):
        return {"x": s.x + 1.0}


class Wall(Window):
    """The window is not in the flow set, and nothing jumps."""

    transitions = ()

    def flow_set(self, s):
        return (s.x - s.centre) ** 2 - s.width**2

    def jump_set(self, s):
        return -1.0


@pytest.mark.parametrize(("kind", "rule"), [(Window, 3), (Wall, 2)])
@settings(deadline=None, max_examples=40)
@given(centre=st.floats(0.3, 1.7), width=st.floats(0.005, 0.2))
def test_two_crossings_between_two_samples_are_found(kind, rule, centre, width):
    straight = hm.Samples([0.0, 2.0], [0, 0], {"x": [0.0, 2.0]})
    report = hm.verify(kind(centre=centre, width=width), straight)
    assert [violation.rule for violation in report.violations] == [rule]
    told = float(report.violations[0].message.split("t = ")[1].split(" s")[0])
    # Told with nine digits.
    assert abs(told - centre) <= width + 1e-8


def test_a_margin_that_peaks_below_zero_is_no_event():
    straight = hm.Samples([0.0, 2.0], [0, 0], {"x": [0.0, 2.0]})

    class Near(Window):
        def jump_set(self, s):
            return -1e-6 - (s.x - s.centre) ** 2

    assert hm.verify(Near(), straight).ok


def test_a_flow_map_that_is_not_finite_is_told():
    class Root(hm.HybridAutomaton):
        x = hm.State(1.0)

        def flow_map(self, s):
            return {"x": -2.0 * np.sqrt(s.x)}

    # x = (1 - t)^2 up to t = 1; what comes then is outside the domain of the root.
    t = np.array([0.0, 0.5, 0.75, 1.5, 2.0])
    assert hm.verify(Root(), hm.Samples(t[:3], np.zeros(3), {"x": (1.0 - t[:3]) ** 2})).ok
    report = hm.verify(Root(), hm.Samples(t, np.zeros(5), {"x": np.array([1.0, 0.25, 0.0625, -0.25, -1.0])}))
    assert 10 in rules(report)
    assert "the flow map gives numbers that are not finite at t = " in str(report)


# Inputs.


class Tracker(hm.HybridAutomaton):
    """Integrates a continuous input, and one that is held."""

    x = hm.State(0.0)
    u = hm.Input(0.0)
    d = hm.Input(1.0, discrete=True)

    def flow_map(self, s):
        return {"x": s.u + s.d}


def test_inputs_come_from_where_they_are_known():
    step = hm.Signal(lambda t: 1.0 + (t >= 0.7), [0.7])
    inputs = {"u": np.cos, "d": step}
    arc = hm.simulate(Tracker(), 2.0, inputs=inputs)
    assert hm.verify(Tracker(), arc).ok
    assert hm.verify(Tracker(), arc.samples(), inputs=inputs).ok
    bare = arc.samples(["x"])
    assert hm.verify(Tracker(), bare, inputs=inputs).ok
    # Thinned to the ends, with the breakpoint between them.
    ends = hm.Samples(bare.t[[0, -1]], bare.j[[0, -1]], {"x": bare["x"][[0, -1]]})
    assert hm.verify(Tracker(), ends, inputs=inputs).ok
    assert not hm.verify(Tracker(), bare).ok
    assert not hm.verify(Tracker(), bare, inputs={"u": np.cos}).ok


@pytest.mark.parametrize("wrap", [lambda f: f, hm.Signal], ids=["function", "signal"])
@pytest.mark.parametrize("bare", [False, True])
def test_functions_of_time_are_not_called_outside_the_data(wrap, bare):
    seen = []

    def recorded(t):
        seen.append(t)
        return np.sin(t)

    class Watched(Tracker):
        """With sets, which are looked at a little before and after each sample, and jumps at both ends."""

        k = hm.DiscreteState(0)

        def flow_set(self, s):
            return s.x + 1.0

        def jump_set(self, s):
            return s.t - (1.0 + 2.0 * s.k) + 0.0 * s.u

        def jump_map(self, s):
            return {"k": s.k + 1.0}

    arc = hm.simulate(Watched(), 3.0, t_start=1.0, inputs={"u": wrap(recorded)})
    assert [jump.t for jump in arc.jumps] == [1.0, 3.0]
    seen.clear()
    report = hm.verify(Watched(), arc.samples(["x", "k"]) if bare else arc, inputs={"u": wrap(recorded)})
    assert report.ok, str(report)
    assert (min(seen), max(seen)) == (1.0, 3.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([1.0, 2.0], r"input u has shape \(\), but the value given has shape \(2,\): give one number"),
        (lambda t: [1.0], r"input u has shape \(\), but the value given has shape \(1,\): give one number"),
        ("fast", "input u is 'fast': give numbers"),
        (lambda t: {}, "input u is {}: give numbers"),
    ],
)
def test_inputs_that_do_not_fit_are_refused(given, message):
    samples = hm.Samples([0.0, 1.0], [0, 0], {"x": [0.0, 1.0]})
    with pytest.raises(hm.DeclarationError, match=message):
        hm.verify(Tracker(), samples, inputs={"u": given})


def test_breakpoints_of_inputs_are_never_integrated_across():
    # A pulse of 0.1 ms, which an integrator that does not know of it steps over, between two samples 2 s apart.
    pulse = hm.Signal(lambda t: 1e4 * (0.7 <= t < 0.7001), [0.7, 0.7001])
    samples = hm.Samples([0.0, 2.0], [0, 0], {"x": [0.0, 3.0]})
    assert hm.verify(Tracker(), samples, inputs={"u": pulse}).ok
    # What an input is from a breakpoint on does not belong to the flow that ends there.
    until = hm.Signal(lambda t: 1.0 if t < 1.0 else np.nan, [1.0])
    ends = hm.Samples([0.0, 1.0], [0, 0], {"x": [0.0, 2.0]})
    # Radau evaluates at the very end of a step.
    assert hm.verify(Tracker(), ends, inputs={"u": until}, method="Radau").ok


def test_sampled_inputs_run_straight_or_hold():
    # x' = t + d with d = 1 up to t = 1, then 3.
    t = np.array([0.0, 1.0, 2.0])
    samples = hm.Samples(t, np.zeros(3), {"x": [0.0, 1.5, 6.0], "u": t, "d": [1.0, 3.0, 3.0]})
    assert hm.verify(Tracker(), samples).ok
    assert not hm.verify(Tracker(), moved(samples, "d", 0, 1e-3)).ok
    assert not hm.verify(Tracker(), moved(samples, "u", 1, 1e-3)).ok


# The report, and questions that cannot be answered.


def test_the_same_violation_again_at_the_same_j_is_counted():
    samples = ball_by_hand(impacts=0, points=5)
    falling = changed(samples, h=samples["h"] - 2.0)
    report = hm.verify(BouncingBall(), falling)
    below = next(violation for violation in report.violations if violation.rule == 2)
    assert (below.sample, below.t, below.j) == (0, 0.0, 0)
    assert below.count >= 5
    assert str(below).startswith("(t, j) = (0 s, 0), rule 2: the flow is outside the flow set at t = 0 s: margin -1")
    assert str(below).endswith(f"(and {below.count - 1} times more at this j)")
    assert str(report).startswith("not a hybrid arc of BouncingBall (5 samples, 1 flows and 0 jumps checked):\n(t, j)")


def test_where_the_last_jump_lands_is_free():
    # The run is blocked where it landed; that is the end of a hybrid arc all the same.
    class Out(Corridor):
        def jump_map(self, s):
            return {"x": 5.0}

        def jump_set(self, s):
            return hm.least(s.x - s.door, 3.0 - s.x)

    arc = hm.simulate(Out(), 3.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert hm.verify(Out(), arc).ok


@pytest.mark.parametrize(
    ("data", "options", "error", "message"),
    [
        (
            hm.Samples([0.0], [0], {"h": [1.0]}),
            {},
            hm.DataError,
            "no v, a state of BouncingBall: give a column for each",
        ),
        (hm.Samples([0.0], [0], {"h": [[1.0]], "v": [0.0]}), {}, hm.DataError, r"h has shape \(1,\) in the samples"),
        ({"t": [0.0]}, {}, hm.DataError, "a dict holds no samples of a run: give a HybridArc, Samples or a DataFrame"),
        (ball_by_hand(), {"inputs": {"u": 1.0}}, hm.DeclarationError, "no input 'u'; it has no inputs"),
        (ball_by_hand(), {"inputs": [("u", 1.0)]}, hm.SimulationError, r"inputs = .* is no mapping: write inputs="),
        (ball_by_hand(), {"method": "RK4"}, hm.SimulationError, "method = 'RK4': the methods are RK23, RK45, DOP853,"),
        (ball_by_hand(), {"method": None}, hm.SimulationError, "method = None: the methods are"),
        (
            ball_by_hand(),
            {"tolerances": 1e-6},
            hm.SimulationError,
            r"tolerances = 1e-06 is no Tolerances: write tolerances=Tolerances\(rtol=1e-06\)",
        ),
    ],
)
def test_questions_that_cannot_be_answered_are_refused(data, options, error, message):
    with pytest.raises(error, match=message):
        hm.verify(BouncingBall(), data, **options)


@pytest.mark.parametrize("given", [BouncingBall, "BouncingBall", None])
def test_only_an_instance_is_verified(given):
    remedy = r"write BouncingBall\(\)\." if given is BouncingBall else "give an instance of a HybridAutomaton"
    with pytest.raises(hm.DeclarationError, match=rf"verify was given .*: {remedy}"):
        hm.verify(given, ball_by_hand())


@pytest.mark.parametrize("wrong", [{"time": 0.0}, {"rtol": -1.0}, {"atol": np.nan}])
def test_tolerances_are_positive(wrong):
    with pytest.raises(hm.DataError, match=f"tolerance {next(iter(wrong))} = .*: give a positive number"):
        hm.Tolerances(**wrong)


def test_the_verifier_uses_nothing_of_the_simulator():
    package = pathlib.Path(hm.__file__).parent
    imported = set()
    for file in (package / "verification").glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom):
                imported.add(node.module)
    assert "hybrid_model.declare.automaton" in imported
    forbidden = ("simulate", "reference", "schedule", "native", "solver", "declare.layout")
    assert [name for name in imported if name.startswith(tuple(f"hybrid_model.{room}" for room in forbidden))] == []


def test_a_run_from_other_starts_and_parameters_is_one_with_them_only():
    starts = {"h": 2.5, "e": 0.6}
    arc = hm.simulate(BouncingBall(), 1.5, starts=starts)
    assert hm.verify(BouncingBall(), arc, starts=starts)
    assert hm.verify(BouncingBall(), arc, starts={"e": 0.6})
    assert any("leads to v" in violation.message for violation in hm.verify(BouncingBall(), arc).violations)
    with pytest.raises(DeclarationError, match=r"^starts: BouncingBall .*gravity"):
        hm.verify(BouncingBall(), arc, starts={"gravity": 9.0})


def test_how_far_it_is_is_told_once_it_takes_long(monkeypatch, capsys):
    arc = hm.simulate(BouncingBall(), 1.0)
    # A clock of which each look takes half a second.
    ticks = itertools.count(0.0, 0.5)
    monkeypatch.setattr("hybrid_model.progress.time.monotonic", lambda: next(ticks))
    told = []
    assert hm.verify(BouncingBall(), arc, progress=lambda done, total: told.append((done, total))).ok
    done, totals = zip(*told, strict=True)
    # Two pieces for each step between samples, one for each jump: two seconds are silent, then each second one tells.
    assert set(totals) == {2 * (len(arc.t) - 1 - len(arc.jumps)) + len(arc.jumps)}
    assert done == tuple(range(4, totals[0] + 1, 2))
    assert hm.verify(BouncingBall(), arc, progress=True).ok
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"verifying BouncingBall: \d+%, about \d+ s left", lines[0])
    assert len(lines) == len(told)
    assert hm.verify(BouncingBall(), arc).ok
    assert capsys.readouterr().err == ""


def test_on_a_terminal_one_line_is_kept_up_to_date_and_cleared(monkeypatch):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    ticks = itertools.count(0.0, 0.5)
    monkeypatch.setattr("hybrid_model.progress.time.monotonic", lambda: next(ticks))
    monkeypatch.setattr(sys, "stderr", terminal)
    arc = hm.simulate(BouncingBall(), 1.0)
    assert hm.verify(BouncingBall(), arc).ok
    told = terminal.getvalue()
    assert "\n" not in told
    assert told.startswith("\rverifying BouncingBall: ")
    assert re.search(r"\r +\r$", told)

"""Continuous signals between slaves: the error-controlled master beside composed automata and solutions by hand."""

import itertools

import numpy as np
import pytest
from small_fmus import DESCRIPTIONS, write

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_fixed_step
from cosim.masters.changes import Curve
from cosim.masters.signal_history import SignalHistory
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall
from hybrid_model.models.ball_on_moving_table import BallOnMovingTable, OscillatingTable
from hybrid_model.models.event_triggered_lti_loop import EventTriggeredFeedback, EventTriggeredLtiLoop
from hybrid_model.models.sampled_lti_loop import LtiPlant
from hybrid_model.schedule.blocks import Step

TIME = 1e-7
"""Of events, in s: what is promised. Steps are halved to 1e-13 of the run, and the tolerance of a step is 1e-9."""
ON_A_BALL = {"second.table": "first.h", "second.table_velocity": "first.v"}


class Passes(hm.HybridAutomaton):
    """Its output is its input at once."""

    u = hm.Input(0.0)
    y = hm.Output()
    gain = hm.Parameter(1.0)

    def outputs(self, s):
        return {"y": s.gain * s.u}


class Integrates(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    gain = hm.Parameter(1.0)

    def flow_map(self, s):
        return {"x": s.gain * s.u}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The two balls as FMUs of both versions, made when asked for."""
    folder, made = tmp_path_factory.mktemp("balls"), {}
    blocks = {"first": BouncingBall(), "second": BallOnMovingTable(h=1.2), "wire": Passes()}

    def fmu(name, version):
        if (name, version) not in made:
            made[name, version] = export_fmu(blocks[name], folder / f"{name}{version}.fmu", fmi=version, kinds=("cs",))
        return made[name, version]

    return fmu


@pytest.fixture(scope="module")
def two_balls():
    """A ball that falls on a ball: composed, run in one piece."""
    parts = {"first": BouncingBall(), "second": BallOnMovingTable(h=1.2)}
    return hm.simulate(hm.Composition("two", parts, ON_A_BALL), 1.6)


@pytest.mark.parametrize(
    ("height", "e", "above", "end"), [(0.9, 0.8, 2.0, 2.2), (0.70345524, 0.604925336, 2.175474074, 0.8)]
)
def test_a_ball_falls_on_one_that_falls_too(height, e, above, end):
    """What goes away from the ball moves the event that it has stopped for, be it by a step of no length."""
    parts = {"first": BouncingBall(h=height, e=e), "second": BallOnMovingTable(h=above)}
    composed = hm.simulate(hm.Composition("two", parts, ON_A_BALL), end)
    slaves = [AutomatonSlave(name, part, engine="python") for name, part in parts.items()]
    result = run_error_controlled(System(slaves, ON_A_BALL), end)
    for name in parts:
        np.testing.assert_allclose(result.event_times(name), composed.event_times(f"{name}.jump"), atol=TIME, rtol=0)


def test_a_ball_falls_on_a_table_of_a_file_that_sinks():
    """The table is at 1 - 2 t: relative to it the ball begins at 1 m with 2 m/s, and bounces as on one that rests."""
    given = {"ball.table": Curve(lambda t: 1.0 - 2.0 * t), "ball.table_velocity": -2.0}
    result = run_error_controlled(System([AutomatonSlave("ball", BallOnMovingTable(h=2.0))], {}), 2.2, inputs=given)
    first = (2.0 + np.sqrt(4.0 + 2.0 * 9.81)) / 9.81
    bounce = 2.0 * 0.7 * (9.81 * first - 2.0) / 9.81
    times = [first, first + bounce, first + 1.7 * bounce]
    np.testing.assert_allclose(result.event_times("ball"), times, atol=TIME, rtol=0)


@pytest.mark.parametrize(("first", "second"), [*itertools.product(("2.0", "3.0"), repeat=2)])
def test_a_ball_falls_on_a_ball_in_all_versions(first, second, fmus, two_balls):
    """FMI 2.0 has no events: theirs are seen by what they change."""
    slaves = [FmuSlave("first", fmus("first", first)), FmuSlave("second", fmus("second", second))]
    result = run_error_controlled(System(slaves, ON_A_BALL), 1.6)
    np.testing.assert_allclose(result.event_times("second"), two_balls.event_times("second.jump"), atol=TIME, rtol=0)
    np.testing.assert_allclose(result.event_times("first"), two_balls.event_times("first.jump"), atol=TIME, rtol=0)
    for name in ("first.h", "second.h", "second.v"):
        assert result.final[name] == pytest.approx(two_balls[name][-1], abs=1e-7)


def test_a_signal_goes_through_an_fmu_whose_output_follows_at_once(fmus, two_balls):
    slaves = [FmuSlave("first", fmus("first", "3.0")), FmuSlave("second", fmus("second", "3.0"))]
    slaves[1:1] = [FmuSlave("h", fmus("wire", "2.0")), FmuSlave("v", fmus("wire", "3.0"))]
    wires = {"h.u": "first.h", "v.u": "first.v", "second.table": "h.y", "second.table_velocity": "v.y"}
    result = run_error_controlled(System(slaves, wires), 1.6)
    np.testing.assert_allclose(result.event_times("second"), two_balls.event_times("second.jump"), atol=TIME, rtol=0)


class CountsRises(hm.HybridAutomaton):
    """Counts how often its input has risen above a half."""

    u = hm.Input(0.0)
    above = hm.DiscreteState(0.0)
    count = hm.DiscreteState(0.0, output=True)

    def rises(self, s):
        return hm.least(s.u - 0.5, 0.5 - s.above)

    def falls(self, s):
        return hm.least(0.4 - s.u, s.above - 0.5)

    transitions = (
        hm.Jump("rise", rises, lambda self, s: {"above": 1.0, "count": s.count + 1.0}),
        hm.Jump("fall", falls, lambda self, s: {"above": 0.0}),
    )


class Oscillates(hm.HybridAutomaton):
    a = hm.State(0.0, output=True)
    b = hm.State(1.0)

    def flow_map(self, s):
        return {"a": 3.0 * s.b, "b": -3.0 * s.a}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_events_are_met_that_nobody_else_hears_of(fmi, tmp_path):
    """sin(3 t) rises above a half at (pi/6 + 2 pi k)/3; the count is connected to nothing."""
    parts = {"source": Oscillates(), "sink": CountsRises()}
    slaves = [
        FmuSlave(name, export_fmu(part, tmp_path / f"{name}.fmu", fmi=fmi, kinds=("cs",)))
        for name, part in parts.items()
    ]
    result = run_error_controlled(System(slaves, {"sink.u": "source.a"}), 5.0, output_interval=1.0, record_events=True)
    expected = (np.pi / 6.0 + 2.0 * np.pi * np.arange(3)) / 3.0
    falls = (np.pi - np.arcsin(0.4) + 2.0 * np.pi * np.arange(2)) / 3.0
    # What an FMU of FMI 2.0 does at the very start of a step, and shows nowhere, it keeps to itself.
    found = result.event_times("sink")
    np.testing.assert_allclose(found, sorted([*expected, *(falls if fmi == "3.0" else [])]), atol=TIME, rtol=0)
    for count, t in enumerate(found[:: 2 if fmi == "3.0" else 1]):
        assert _rows(result, t, "sink.count") == [count, count + 1]


def _rows(result, t, name):
    return [value for time, value in zip(result.times, result.signals[name], strict=True) if time == t]


@pytest.mark.parametrize("name", ["static", pytest.param("dynamic", marks=pytest.mark.long)])
def test_jumps_inside_fmus_have_both_rows(name, tmp_path, capsys):
    """The agents as FMI 2.0, which have jumped when their steps end, beside those of 3.0: at jumps both sides count."""
    table = tmp_path / "run.csv"
    for fmi, option in (("3.0", "--output-file"), ("2.0", "--reference-file")):
        assert main(["cosim", f"paper-a-{name}", "--fmi", fmi, option, str(table)]) == 0
    assert "agent1.broadcast differs from run.csv by" in capsys.readouterr().out


def test_a_ball_on_an_oscillating_table():
    wires = {"ball.table": "table.height", "ball.table_velocity": "table.velocity"}
    parts = {"table": OscillatingTable(), "ball": BallOnMovingTable()}
    expected = hm.simulate(hm.Composition("both", parts, wires), 2.0).event_times("ball.jump")
    system = System([AutomatonSlave(name, part) for name, part in parts.items()], wires)
    result = run_error_controlled(system, 2.0)
    assert len(expected) == 3
    np.testing.assert_allclose(result.event_times("ball"), expected, atol=TIME, rtol=0)
    assert [tick.clock for tick in result.ticks] == ["impact"] * 3


@pytest.mark.parametrize("order", [1, -1])
def test_a_continuous_plant_under_an_event_triggered_controller(order):
    A, B, K = ((0.0, 1.0), (-2.0, 3.0)), ((0.0,), (1.0,)), ((1.0, -4.0),)
    expected = hm.simulate(EventTriggeredLtiLoop(), 1.0).event_times("feedback.update")
    slaves = [
        AutomatonSlave("plant", LtiPlant(A=A, B=B, x=(1.0, 0.0))),
        AutomatonSlave("feedback", EventTriggeredFeedback(K=K, sigma=0.05, floor=1e-9)),
    ]
    result = run_error_controlled(System(slaves[::order], {"feedback.x": "plant.x", "plant.u": "feedback.u"}), 1.0)
    assert len(expected) == 15
    np.testing.assert_allclose(result.tick_times("feedback", "updated"), expected, atol=TIME, rtol=0)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_the_error_follows_the_tolerance(tolerance):
    """An oscillator in two slaves: x' = y, y' = -x, so x = cos t. Errors of some hundred steps add up."""
    slaves = [AutomatonSlave("x", Integrates(x=1.0)), AutomatonSlave("y", Integrates(gain=-1.0))]
    result = run_error_controlled(System(slaves, {"x.u": "y.x", "y.u": "x.x"}), 3.0, tolerance=tolerance)
    error = abs(result.final["x.x"] - np.cos(3.0))
    steps = result.steps / 6
    assert error < tolerance * steps
    # Of second order: the number of steps goes with the third root.
    assert steps == pytest.approx(0.35 * 3.0 * tolerance ** (-1.0 / 3.0), rel=0.7)


def test_inputs_from_outside_are_followed():
    """x' = u with u = t and a jump by 1 at 0.5: x = t^2/2 + (t - 0.5)."""
    system = System([AutomatonSlave("x", Integrates())], {})
    ramp = Curve(lambda t: t + (1.0 if t >= 0.5 else 0.0), [0.5])
    result = run_error_controlled(system, 1.0, inputs={"x.u": ramp}, output_interval=0.25)
    assert result.final["x.x"] == pytest.approx(1.0, abs=1e-9)
    assert result.times == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])


def test_signals_that_depend_on_each_other_at_once_are_named():
    slaves = [AutomatonSlave("a", Passes(gain=2.0)), AutomatonSlave("b", Passes(u=1.0))]
    told = r"do not settle in 3 rounds: (a.y -> b.u \(.*\) and b.y -> a.u|b.y -> a.u \(.*\) and a.y -> b.u) \(.*\) form"
    with pytest.raises(CosimError, match=told):
        run_error_controlled(System(slaves, {"a.u": "b.y", "b.u": "a.y"}), 1.0)


def test_a_loop_whose_gain_is_below_one_is_iterated_on_request():
    """a = b/2 and b = a/2 + x with x' = 1: b = x/(1 - 1/4)."""

    class Adds(Passes):
        x = hm.Input(0.0)

        def outputs(self, s):
            return {"y": s.gain * s.u + s.x}

    slaves = [AutomatonSlave("a", Passes(gain=0.5)), AutomatonSlave("b", Adds(gain=0.5))]
    slaves.append(AutomatonSlave("x", Integrates(u=1.0, x=3.0)))
    wires = {"a.u": "b.y", "b.u": "a.y", "b.x": "x.x"}
    result = run_error_controlled(System(slaves, wires, loop_iterations=100), 1.0)
    assert result.final["b.y"] == pytest.approx(4.0 / 0.75, rel=1e-12)
    with pytest.raises(CosimError, match="form a loop"):
        run_error_controlled(System(slaves, wires), 1.0)


def test_what_cannot_be_run_is_refused_by_name(stranger):
    system = System([FmuSlave("stranger", stranger(variable=False))], {})
    with pytest.raises(MisfitError, match="stranger takes steps of one length only"):
        run_error_controlled(system, 1.0)
    with pytest.raises(CosimError, match="the tolerance is 0"):
        run_error_controlled(System([AutomatonSlave("x", Integrates())], {}), 1.0, tolerance=0)


def test_a_slave_that_gets_no_further_ends_the_run_with_its_name():
    class Stuck(AutomatonSlave):
        def step(self, t, t_next):
            return super().step(t, t_next) if t_next < 0.5 else Step(t, True)

    slaves = [Stuck("stuck", Integrates()), AutomatonSlave("x", Integrates(x=1.0))]
    with pytest.raises(CosimError, match=r"stuck.* no further than t = 0\.[45]"):
        run_error_controlled(System(slaves, {"stuck.u": "x.x"}), 1.0)


def test_polynomials_go_on_as_such():
    """A parabola and a line by their values alone, and a cubic by its values and slopes."""
    unknown = [np.nan, np.nan]
    history = SignalHistory(0.0, [0.0, 1.0, 0.0], [*unknown, 0.0])
    for t in (0.5, 0.7):
        history.add(t, [t**2, 1.0 - t, t**3], [*unknown, 3.0 * t**2])
    np.testing.assert_allclose(history.at(1.3), [1.69, -0.3, 2.197], atol=1e-14)
    expected = [[1.69, -0.3, 2.197], [2.6, -1.0, 5.07], [1.0, 0.0, 3.9], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(history.about(1.3), expected, atol=1e-13)
    history.forget(1.0, [5.0, 5.0, 5.0], [*unknown, 2.0])
    np.testing.assert_allclose(history.at(2.0), [5.0, 5.0, 7.0])


def test_each_steps_with_what_those_before_it_have_come_to():
    """x' = 1 for one, y' = x for the other: the sums are those of rectangles from the left, and from the right."""
    system = System([AutomatonSlave("x", Integrates(u=1.0)), AutomatonSlave("y", Integrates())], {"y.u": "x.x"})
    left = run_fixed_step(system, 1.0, 0.1).final["y.x"]
    right = run_fixed_step(system, 1.0, 0.1, order="gauss-seidel").final["y.x"]
    assert (left, right) == pytest.approx((0.45, 0.55))
    with pytest.raises(CosimError, match="the order is 'other': give one of jacobi, gauss-seidel"):
        run_fixed_step(system, 1.0, 0.1, order="other")


def test_the_command_chooses_this_master_for_continuous_signals(tmp_path, capsys):
    (tmp_path / "system.toml").write_text(
        "[experiment]\nstop_time = 2.0\n"
        '[components.table]\nautomaton = "hybrid_model.models.ball_on_moving_table:OscillatingTable"\n'
        '[components.ball]\nautomaton = "hybrid_model.models.ball_on_moving_table:BallOnMovingTable"\n'
        '[connections]\n"ball.table" = "table.height"\n"ball.table_velocity" = "table.velocity"\n'
    )
    assert main(["cosim", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "table, ball: events in event mode, come to by ever shorter steps" in said
    assert "ball.impact: 3 ticks" in said
    assert main(["cosim", str(tmp_path), "--master", "fixed-step", "--order", "gauss-seidel", "--stop-time", "1"]) == 0
    assert "others hear of them at the next communication point, up to 0.01 s late" in capsys.readouterr().out


class Rises(hm.HybridAutomaton):
    power = hm.Parameter(1.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.t**s.power}


@pytest.mark.parametrize("major", [2, 3])
def test_nominal_values_of_outputs_are_read(major, tmp_path):
    own = 'name="y" valueReference="5" causality="output"' + ("/>" if major == 3 else "><Real/>")
    told = own.replace("/>", ' nominal="-20"/>')
    text = DESCRIPTIONS[major]
    assert own in text
    for description, size in ((text, 0.0), (text.replace(own, told), 20.0)):
        path = write(tmp_path / "small.fmu", {"modelDescription.xml": description})
        assert FmuSlave("small", path).outputs["y"].nominal == size


class KnowsItsSize(Integrates):
    x = hm.State(0.0, output=True, nominal=1.0)


@pytest.mark.parametrize(
    ("power", "kind", "most"),
    [(1.0, Integrates, 200), (2.0, Integrates, 3000), (4.0, Integrates, 6000), (4.0, KnowsItsSize, 2000)],
)
def test_signals_that_rise_from_zero_get_on(power, kind, most):
    """x' = t^p from 0: x(1) = 1/(p + 1). All of such a signal is error at first, however short the step is.

    While x has a size to be held against, a step may be some (12 * 1e-6 / p^2)^(1/3) of the time so far: so many steps
    each time that time grows by e. Down from a thousandth of the run it would be as many again each thousandth.
    """
    system = System([AutomatonSlave("rises", Rises(power=power)), AutomatonSlave("x", kind())], {"x.u": "rises.y"})
    result = run_error_controlled(system, 1.0, tolerance=1e-6)
    # Each step is within 1e-6 of the largest value so far, and there are some hundred times as many in one e.
    assert result.final["x.x"] == pytest.approx(1.0 / (power + 1.0), rel=1e-4)
    assert result.steps < most


@pytest.mark.parametrize("kind", ["automaton", "2.0", "3.0"])
def test_jumps_of_curves_have_both_rows(kind, fmus):
    slave = AutomatonSlave("wire", Passes()) if kind == "automaton" else FmuSlave("wire", fmus("wire", kind))
    line = Curve(lambda t: t if t < 0.5 else 3.0 - t, [0.5])
    result = run_error_controlled(System([slave]), 1.0, output_interval=0.4, inputs={"wire.u": line})
    assert _rows(result, 0.5, "wire.y") == pytest.approx([0.5, 2.5], abs=1e-9)


@pytest.mark.parametrize("kind", ["automaton", "2.0", "3.0"])
def test_what_is_read_where_a_signal_changes_is_behind_the_change(kind, fmus):
    """At an output point, and at the end."""
    slave = AutomatonSlave("wire", Passes()) if kind == "automaton" else FmuSlave("wire", fmus("wire", kind))
    steps = hm.Signal(lambda t: np.floor(2.0 * t), [0.5, 1.0])
    inputs = {"wire.u": steps}
    result = run_error_controlled(System([slave]), 1.0, output_interval=0.5, record_events=False, inputs=inputs)
    assert result.signals["wire.y"] == [0.0, 1.0, 2.0]
    assert result.final["wire.y"] == 2.0

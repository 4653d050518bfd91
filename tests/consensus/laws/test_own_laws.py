"""Trigger laws of the user's own: in Python, in scenario files, as FMUs, and what certificates make of them."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from catalogue_triggers import RING

import hybrid_model as hm
from cosim.cli.main import main
from cosim.consensus import fmu_system, network_report
from cosim.masters import run_event_exact
from fmu.export import export_fmu
from hybrid_model.consensus import (
    EventGenerator,
    FunctionWeight,
    Integrator,
    OwnTrigger,
    ScenarioError,
    SineWeight,
    Threshold,
    Trigger,
    TriggerKind,
    certify,
    closed_loop,
    load_scenario,
    read_scenario,
    run_report,
    scenario_agents,
)
from hybrid_model.consensus.figures.run import certified_curves
from hybrid_model.declare.variables import Kind

LAW = '''
import numpy as np
import hybrid_model as hm
from hybrid_model.consensus import EventGenerator, Threshold

class Hyperbolic(EventGenerator):
    """Broadcasts when |e| >= c/(1 + rate t)."""
    c = hm.Parameter(0.2)
    rate = hm.Parameter(0.5, unit="1/s")
    def error_too_large(self, s): return np.abs(s.broadcast - s.x) - s.c / (1 + s.rate * s.t)
    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)
    def error_bound(self, s): return Threshold(s.c)
'''


class Exponential(EventGenerator):
    """The paper's dynamic trigger, as somebody else would write it, with all that it can promise."""

    c = hm.Parameter(0.5)
    beta = hm.Parameter(0.06, unit="1/s")

    def error_too_large(self, s):
        return np.abs(s.broadcast - s.x) - s.c * np.exp(-s.beta * s.t)

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)

    def error_bound(self, s):
        return Threshold(s.c, s.beta)

    least_error = error_bound


class Silent(Exponential):
    """Promises nothing."""

    error_bound = EventGenerator.error_bound
    least_error = EventGenerator.least_error


class Neighbourly(EventGenerator):
    """Hears the neighbours: broadcasts when the error has grown to a share of the largest difference, or to a floor."""

    degree = hm.Dimension("number of neighbours")
    neighbours = hm.Input(0.0, shape="degree", discrete=True)
    weights = hm.Input(0.0, shape="degree")
    gain = hm.Parameter(1.0)
    share = hm.Parameter(0.3)

    def error_too_large(self, s):
        return np.abs(s.broadcast - s.x) - s.share * np.sum(np.abs(s.neighbours - s.broadcast)) - 0.01

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)


@pytest.fixture
def law_file(tmp_path):
    (tmp_path / "laws.py").write_text(LAW)
    return tmp_path / "laws.py"


def ring(**trigger):
    return {**copy.deepcopy(RING), "trigger": trigger}


def errors_at_events(arc, agent):
    """``|xhat - x|`` of an agent just before each of its broadcasts, and the times."""
    times = arc.event_times(f"{agent}.trigger.broadcast")
    sent, state = (arc.at(f"{agent}.{name}", times, before=True) for name in ("broadcast", "x"))
    return times, np.abs(sent - state)


def test_a_law_written_anew_gives_the_run_of_the_one_that_comes_along():
    scenario = load_scenario("paper-a")
    built_in, own = (
        hm.simulate(loop, scenario.stop_time)
        for loop in (closed_loop(scenario), closed_loop(scenario, trigger=Exponential))
    )
    assert [jump.name for jump in own.jumps] == [jump.name for jump in built_in.jumps]
    np.testing.assert_allclose([jump.t for jump in own.jumps], [jump.t for jump in built_in.jumps], rtol=0, atol=1e-9)


def test_a_scenario_file_names_a_class_beside_it(law_file):
    scenario = read_scenario(ring(kind="laws.py:Hyperbolic", c=0.1), law_file.parent)
    assert scenario.trigger.name == "Hyperbolic"
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    times, errors = errors_at_events(arc, "agent1")
    assert len(times) >= 2
    # Each broadcast comes when the error meets the threshold, located to rounding.
    np.testing.assert_allclose(errors, 0.1 / (1 + 0.5 * times), rtol=0, atol=1e-9)
    assert run_report(scenario, arc).events_per_agent[0] == len(times)


@pytest.mark.parametrize(
    ("trigger", "numbers"),
    [
        ({"kind": "laws.py:Hyperbolic"}, {"c", "rate"}),
        ({"kind": "mixed", "threshold": 0.3, "decay": 0.2, "offset": 0.1}, {"threshold", "decay", "offset"}),
        ({"kind": "self-triggered", "threshold": 0.3, "decay": 0.2}, {"threshold", "decay"}),
    ],
)
def test_numbers_of_a_law_have_names_of_the_agent(law_file, trigger, numbers):
    """As they stand in [trigger], whosever law it is; what the law copies of its surroundings keeps to itself."""
    agent = scenario_agents(read_scenario(ring(**trigger), law_file.parent))["agent1"]
    shown = {variable.name for variable in agent.of_kind(Kind.PARAMETER) if "." not in variable.name}
    assert shown == {"gain"} | numbers


def test_the_command_line_runs_and_certifies_it(law_file, capsys):
    lines = (
        'name = "own"', "stop_time = 3.0", "[network]", "agents = 2", "edges = [[1, 2]]", "initial = [0.0, 1.0]",
        "[weights]", 'kind = "constant"', "value = 1.0", "[trigger]", 'kind = "laws.py:Hyperbolic"', "rate = 0.2",
    )  # fmt: skip
    file = law_file.parent / "own.toml"
    file.write_text("\n".join(lines))
    assert main(["simulate", str(file), "--json"]) == 0
    assert main(["certify", str(file)]) == 0
    assert "The trigger is 'Hyperbolic'" in capsys.readouterr().out


def test_agents_with_a_law_of_ones_own_are_fmus_too(tmp_path):
    scenario = replace(read_scenario(RING), trigger=OwnTrigger(law=Neighbourly))
    fmus = {name: export_fmu(agent, tmp_path / f"{name}.fmu") for name, agent in scenario_agents(scenario).items()}
    result = run_event_exact(fmu_system(scenario, fmus), scenario.stop_time)
    report = network_report(scenario, result)
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    assert report.events_per_agent == run_report(scenario, arc).events_per_agent
    assert min(report.events_per_agent) >= 1


def test_promises_give_the_bounds_of_a_law_that_keeps_the_same():
    paper = replace(load_scenario("paper-a"), trigger=Trigger(TriggerKind.DYNAMIC, 0.02, 0.001))
    own = replace(paper, trigger=OwnTrigger(law=Exponential, values={"c": 0.02, "beta": 0.001}))
    known, promised = (certify(scenario) for scenario in (paper, own))
    for quantity, form in (("radius", "exact"), ("radius", "energy"), ("min_gap", "improved")):
        assert known.value(quantity, form) > 0
        assert promised.value(quantity, form) == pytest.approx(known.value(quantity, form), rel=1e-12)
    # What is said beside the bounds goes by the promise too: beta in the hypotheses and curves, C in the notes.
    hypotheses = [
        {h.name: h.detail for h in found.hypotheses if h.name.startswith("beta")} for found in (known, promised)
    ]
    assert hypotheses[1] == hypotheses[0]
    assert len(hypotheses[0]) == 4
    assert all("beta is 0.001/s" in detail for detail in hypotheses[0].values())
    constants = [next(note for note in found.notes if "C = 2 c" in note) for found in (known, promised)]
    assert constants[1] == constants[0]
    t = np.linspace(0.0, 50.0, 5)
    curves = [certified_curves(found, t) for found in (known, promised)]
    for form, values in curves[0].items():
        np.testing.assert_allclose(curves[1][form], values, rtol=1e-12)
    assert curves[0]


def test_a_law_that_promises_nothing_gets_no_radius_and_no_gap():
    scenario = replace(load_scenario("paper-a"), trigger=OwnTrigger(law=Silent))
    found = certify(scenario)
    assert found.value("radius", "exact") is None
    assert found.value("min_gap", "improved") is None
    assert found.value("rate", "floquet") > 0
    assert not any("C = 2 c" in note for note in found.notes)


def test_weights_are_a_function_of_ones_own(tmp_path):
    (tmp_path / "waves.py").write_text(
        "import numpy as np\ndef ripple(t, mean): return mean * (1 + 0.5 * np.sin(2 * t))\n"
    )
    table = {"kind": "waves.py:ripple", "mean": [1.0, 0.6, 0.3], "period": np.pi}
    from_file = read_scenario({**copy.deepcopy(RING), "weights": table}, tmp_path)
    known = [SineWeight(mean, 0.5, 2.0) for mean in (1.0, 0.6, 0.3)]
    given = [FunctionWeight(lambda t, mean=mean: mean * (1 + 0.5 * np.sin(2 * t))) for mean in (1.0, 0.6, 0.3)]
    ring = read_scenario(RING)
    loops = closed_loop(from_file), closed_loop(ring, weights=known), closed_loop(ring, weights=given)
    own, sine, function = (hm.simulate(loop, ring.stop_time).jumps for loop in loops)
    assert len(sine) > 5
    for jumps in (own, function):
        assert [jump.name for jump in jumps] == [jump.name for jump in sine]
        np.testing.assert_allclose([jump.t for jump in jumps], [jump.t for jump in sine], rtol=0, atol=1e-9)


def test_agents_may_move_in_another_way():
    class Leaky(Integrator):
        """Forgets with the rate `leak`: one agent alone decays as exp(-leak t)."""

        leak = hm.Parameter(0.5, unit="1/s")

        def flow_map(self, s):
            return {"x": super().flow_map(s)["x"] - s.leak * s.x}

    ring = read_scenario(RING)
    arc = hm.simulate(closed_loop(ring, motion=Leaky), ring.stop_time)
    # The protocol conserves the mean, so the mean decays alone.
    mean = np.mean([arc.at(f"agent{i}.x", 5.0) for i in (1, 2, 3)])
    assert mean == pytest.approx(0.3 * np.exp(-0.5 * 5.0), rel=1e-9)


class TestRefusals:
    @pytest.mark.parametrize(
        ("kind", "message"),
        [
            ("laws.py:Hyperbola", "laws.py:Hyperbola cannot be found: .*no attribute 'Hyperbola'"),
            ("nowhere.py:Hyperbolic", "there is no file .*nowhere.py"),
            ("failing.py:Law", r"failing.py' cannot be imported, because it fails with ZeroDivisionError: .*line 1"),
            ("laws.py:np", "the trigger .*numpy.* is no class of automata; derive one from .*EventGenerator"),
        ],
    )
    def test_of_what_cannot_be_had(self, law_file, kind, message):
        (law_file.parent / "failing.py").write_text("1 / 0\n")
        with pytest.raises(ScenarioError, match=message):
            read_scenario(ring(kind=kind), law_file.parent)

    def test_of_numbers_that_it_does_not_have(self, law_file):
        with pytest.raises(ScenarioError, match=r"rates is given, but Hyperbolic has nothing .* Did you mean 'rate'"):
            read_scenario(ring(kind="laws.py:Hyperbolic", rates=1.0), law_file.parent)
        with pytest.raises(ScenarioError, match="c is 'big'; it must be a number"):
            read_scenario(ring(kind="laws.py:Hyperbolic", c="big"), law_file.parent)

    def test_of_automata_that_generate_no_events(self):
        class Lamp(hm.HybridAutomaton):
            on = hm.DiscreteState(0.0, output=True)

        with pytest.raises(ScenarioError, match="Lamp has no input x and no output broadcast and no output events"):
            OwnTrigger(law=Lamp)

    def test_of_inputs_that_no_agent_has(self):
        class Meddling(Exponential):
            wind = hm.Input(0.0)

        with pytest.raises(ScenarioError, match="Meddling has the input wind; an event generator hears x, neighbours"):
            closed_loop(read_scenario(RING), trigger=Meddling)

    def test_of_weights_and_agents_that_are_none(self, tmp_path):
        ring = read_scenario(RING)
        with pytest.raises(ScenarioError, match=r"weights is \[1.0, 2.0, 3.0\]; give waveforms"):
            closed_loop(ring, weights=[1.0, 2.0, 3.0])
        with pytest.raises(ScenarioError, match=r"motion is .*Exponential.*; give a class derived from .*Integrator"):
            closed_loop(ring, motion=Exponential)
        (tmp_path / "waves.py").write_text(
            "NUMBER = 1.0\nclass Wave: pass\ndef falling(t, slope=1.0): return 1 - slope * t\n"
        )
        for kind, message in [
            ("waves.py:NUMBER", r"kind is 'waves.py:NUMBER', which is 1.0; it must be a function"),
            ("waves.py:Wave", r"kind is 'waves.py:Wave', which is <class .*>; it must be a function"),
            (
                "waves.py:falling",
                r"edge 1: 'waves.py:falling' cannot be used: the weight at t = .* must not be negative",
            ),
        ]:
            with pytest.raises(ScenarioError, match=message):
                read_scenario({**copy.deepcopy(RING), "weights": {"kind": kind}}, tmp_path)
        with pytest.raises(ScenarioError, match=r"cannot be used: .*unexpected keyword argument 'tilt'"):
            read_scenario({**RING, "weights": {"kind": "waves.py:falling", "tilt": 1.0}}, tmp_path)

    def test_of_promises_that_are_no_threshold(self):
        class Vague(Exponential):
            def error_bound(self, s):
                return 0.5

        with pytest.raises(ScenarioError, match=r"error_bound of the trigger Vague gives .*must give a Threshold"):
            certify(replace(read_scenario(RING), trigger=OwnTrigger(law=Vague)))

    @pytest.mark.parametrize("values", [{"c": -0.1}, {"c": 0.0}, {"beta": -0.1}])
    def test_of_promises_that_cannot_be_kept(self, values):
        with pytest.raises(
            ScenarioError, match=r"error_bound of the trigger Exponential gives c = .*finite and not negative"
        ):
            certify(replace(read_scenario(RING), trigger=OwnTrigger(law=Exponential, values=values)))

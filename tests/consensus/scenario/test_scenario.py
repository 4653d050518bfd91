"""Scenario files: the example of the interface, every default, and every refusal with its message."""

import copy
import math

import numpy as np
import pytest

from hybrid_model.consensus.graphs.undirected import complete_edges
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Underlying, replace_trigger
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.scenario.sources import preset_names
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap
from hybrid_model.consensus.weights.kinds import WeightKind

VALID = {
    "name": "three",
    "stop_time": 10,
    "network": {"agents": 3, "edges": [[1, 2], [2, 3]], "initial": [1, 0.5, -2.0]},
    "weights": {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": [5.0, 6.0], "duty_percent": 20},
    "switching": {"dwell": 2.0, "active": [[1], [1, 2]]},
    "trigger": {"kind": "dynamic", "threshold": 0.5, "decay": 0.1},
}
MISSING = object()


def changed(path, value):
    """VALID with one entry replaced, added or (MISSING) removed."""
    entries = copy.deepcopy(VALID)
    *tables, key = path.split(".")
    place = entries
    for table in tables:
        place = place[table]
    if value is MISSING:
        del place[key]
    else:
        place[key] = value
    return entries


class TestPresets:
    def test_paper_a_is_the_scenario_of_the_paper(self):
        scenario = load_scenario("paper-a")
        assert scenario.name == "paper-a"
        assert scenario.stop_time == 50.0
        network = scenario.network
        assert network.edges == ((1, 2), (2, 3), (3, 4), (4, 1))
        assert network.underlying_edges == complete_edges(4, network.edges)
        assert network.initial == (1.0, 2.0, 0.3, 0.4)
        duties = [20 - i * 0.1 * math.pi for i in range(4)]
        for waveform, duty in zip(scenario.weights.waveforms, duties, strict=True):
            assert waveform.duty_percent == pytest.approx(duty, rel=1e-15)
            assert waveform == GatedSine(4.0, 5.0, waveform.duty_percent, 0.0, WeightMap.SQUARE)
        assert scenario.switching == SwitchingCycle(math.pi, ((1, 2, 3), (2, 3, 4)), 4)
        assert scenario.trigger == Trigger(TriggerKind.DYNAMIC, 0.5, 0.06)

    def test_both_triggers_have_a_name(self):
        static = load_scenario("paper-a-static")
        assert static.name == "paper-a-static"
        assert static.trigger == Trigger(TriggerKind.STATIC, 0.5)
        assert load_scenario("paper-a-dynamic").trigger == load_scenario("paper-a").trigger

    @pytest.mark.parametrize("name", preset_names())
    def test_every_preset_loads_under_its_own_name(self, name):
        assert load_scenario(name).name == name

    def test_an_unknown_name_is_answered_with_the_nearest(self):
        with pytest.raises(ScenarioError, match=r"no preset 'papera'. Did you mean 'paper-a'\?"):
            load_scenario("papera")


class TestFiles:
    def test_a_path_is_read(self, tmp_path):
        file = tmp_path / "two.toml"
        file.write_text(
            'name = "two"\nstop_time = 1.0\n[network]\nagents = 2\nedges = [[1, 2]]\ninitial = [0.0, 1.0]\n'
            '[weights]\nkind = "constant"\nvalue = 1.0\n[trigger]\nkind = "static"\nthreshold = 0.1\n'
        )
        assert load_scenario(file) == load_scenario(str(file))
        assert load_scenario(file).weights.kind is WeightKind.CONSTANT

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(ScenarioError, match=r"absent.toml cannot be read: No such file"):
            load_scenario(tmp_path / "absent.toml")

    def test_a_syntax_error_tells_the_line(self, tmp_path):
        file = tmp_path / "broken.toml"
        file.write_text('name = "x"\nstop_time = = 3\n')
        with pytest.raises(ScenarioError, match=r"broken.toml is not valid TOML: .*line 2"):
            load_scenario(file)

    def test_a_broken_rule_tells_the_file(self, tmp_path):
        file = tmp_path / "wrong.toml"
        file.write_text("stop_tim = 3\n")
        with pytest.raises(
            ScenarioError, match=r"wrong.toml: the scenario has the unknown key 'stop_tim'. Did you mean"
        ):
            load_scenario(file)

    def test_a_file_that_is_not_text(self, tmp_path):
        file = tmp_path / "binary.toml"
        file.write_bytes(b'name = "\xff"')
        with pytest.raises(ScenarioError, match=r"not a text in UTF-8: byte 8"):
            load_scenario(file)


class TestValues:
    def test_scalars_stand_for_all_edges_and_whole_numbers_for_real_ones(self):
        scenario = read_scenario(VALID)
        first, second = scenario.weights.waveforms
        assert first == GatedSine(4.0, 5.0, 20.0)
        assert second == GatedSine(4.0, 6.0, 20.0)
        assert isinstance(scenario.stop_time, float)
        assert isinstance(scenario.network.initial[0], float)

    def test_defaults(self):
        scenario = read_scenario(changed("switching", MISSING))
        assert scenario.switching == NoSwitching(2)
        assert scenario.network.gain == 1.0
        assert scenario.network.underlying is Underlying.LISTED
        assert scenario.network.underlying_edges == scenario.network.edges
        assert scenario.weights.waveforms[0].phase == 0.0
        assert scenario.weights.waveforms[0].map is WeightMap.SQUARE

    def test_constant_weights_and_an_idle_phase(self):
        entries = changed("weights", {"kind": "constant", "value": [1, 0]})
        entries["switching"]["active"] = [[1, 2], []]
        scenario = read_scenario(entries)
        assert scenario.weights.waveforms == (ConstantWeight(1.0), ConstantWeight(0.0))
        np.testing.assert_array_equal(scenario.edge_weights.value(3.0), [0.0, 0.0])

    def test_threshold_decays(self):
        trigger = read_scenario(VALID).trigger
        np.testing.assert_allclose(trigger.level([0.0, 10.0]), [0.5, 0.5 / math.e], rtol=1e-15)

    def test_a_static_trigger_may_say_decay_zero(self):
        scenario = read_scenario(changed("trigger", {"kind": "static", "threshold": 1, "decay": 0}))
        assert scenario.trigger == Trigger(TriggerKind.STATIC, 1.0, 0.0)

    def test_scenarios_are_values(self):
        assert read_scenario(VALID) == read_scenario(copy.deepcopy(VALID))
        assert hash(read_scenario(VALID)) == hash(read_scenario(VALID))

    def test_replace_trigger(self):
        dynamic = read_scenario(VALID)
        static = replace_trigger(dynamic, "static")
        assert static.trigger == Trigger(TriggerKind.STATIC, 0.5)
        assert static.network == dynamic.network
        assert replace_trigger(static, TriggerKind.STATIC) is static
        with pytest.raises(ScenarioError, match="no decay for a dynamic one"):
            replace_trigger(static, "dynamic")
        with pytest.raises(ScenarioError, match="trigger kind is 'statc'; it must be one of"):
            replace_trigger(static, "statc")


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("nme", "x", r"the scenario has the unknown key 'nme'. Did you mean 'name'\?"),
        ("network.edge", [], r"\[network\] has the unknown key 'edge'. Did you mean 'edges'\?"),
        ("network.zzz", 1, r"\[network\] has the unknown key 'zzz'. Known keys: agents,"),
        ("weights.gaterate", 1, r"\[weights\] has the unknown key 'gaterate'. Did you mean 'gate_rate'\?"),
        ("weights.value", 1.0, r"\[weights\] has the unknown key 'value'"),
        ("weights.kind", "constant", r"\[weights\] has the unknown key 'gate_rate'"),
        ("switching.dwel", 1, r"\[switching\] has the unknown key 'dwel'. Did you mean 'dwell'\?"),
        ("trigger.beta", 1, r"\[trigger\] has the unknown key 'beta'"),
        ("name", MISSING, "the scenario has no 'name'"),
        ("name", 3, "name is 3; it must be a string"),
        ("name", "", "name is empty"),
        ("network", MISSING, r"has no 'network'; it must be a table, written \[network\]"),
        ("network", 3, r"network is 3; it must be a table, written \[network\]"),
        ("trigger", MISSING, "has no 'trigger'"),
        ("stop_time", 0.0, "stop_time is 0.0; it must be positive"),
        ("stop_time", -1, "stop_time is -1.0; it must be positive"),
        ("stop_time", math.inf, "stop_time is inf; it must be a finite number"),
        ("stop_time", math.nan, "stop_time is nan; it must be a finite number"),
        ("stop_time", True, "stop_time is true; it must be a number"),
        ("stop_time", "10", "stop_time is '10'; it must be a number"),
        ("stop_time", 10**400, "stop_time is 1000.*it must be a finite number"),
        ("network.agents", 3.0, "agents is 3.0; it must be a whole number"),
        ("network.agents", 1, "agents is 1; consensus needs at least 2"),
        ("network.edges", [], "edges is empty"),
        ("network.edges", [[1, 2], [2]], r"edges\[2\] is \[2\]; it must be a pair of agents"),
        ("network.edges", [[1, 2], 3], r"edges\[2\] is 3; it must be a list of whole numbers"),
        ("network.edges", [[1, 2], [2, 3.0]], r"edges\[2\]\[2\] is 3.0; it must be a whole number"),
        ("network.edges", [[1, 2], [2, 4]], "edge 2 .* names agent 4; agents are numbered from 1 to 3"),
        ("network.edges", [[1, 2], [2, 2]], r"\[network\] edges: edge 2 is \[2, 2\], a self-loop"),
        ("network.edges", [[1, 2], [2, 1]], "edge 2 .* repeats edge 1"),
        ("network.initial", [1.0, 2.0], "initial lists 2 numbers for 3 agents"),
        ("network.initial", [1.0, math.nan, 0.0], r"initial\[2\] is nan; it must be a finite number"),
        ("network.initial", 1.0, "initial is 1.0; it must be a list of numbers"),
        ("network.gain", 0, "gain is 0.0; it must be positive"),
        ("network.underlying", "complet", r"underlying is 'complet'; .*Did you mean 'complete'\?"),
        ("weights.kind", MISSING, r"\[weights\] has no 'kind'; it must be one of 'gated-sine', 'constant'"),
        ("weights.kind", "gated_sine", r"kind is 'gated_sine'; .*Did you mean 'gated-sine'\?"),
        ("weights.map", "cube", "map is 'cube'; it must be one of 'square', 'abs'"),
        ("weights.gate_rate", 0.0, r"\[weights\] of edge 1: gate_rate is 0.0; it must be positive"),
        ("weights.sine_rate", [5.0, -1.0], r"\[weights\] of edge 2: sine_rate is -1.0; it must be positive"),
        ("weights.sine_rate", [5.0, 6.0, 7.0], "sine_rate lists 3 numbers for 2 edges"),
        ("weights.sine_rate", MISSING, "has no 'sine_rate'"),
        ("weights.duty_percent", 101, "duty_percent is 101.0; it must lie between 0 and 100"),
        ("weights.phase", "0", "phase is '0'; it must be a number"),
        (
            "weights",
            {"kind": "constant", "value": -1.0},
            r"\[weights\] value is -1.0; it must not be negative",
        ),
        ("switching.dwell", 0.0, "dwell is 0.0; it must be a positive"),
        ("switching.dwell", MISSING, "has no 'dwell'"),
        ("switching.active", [], "active is empty"),
        ("switching.active", [1, 2], r"active\[1\] is 1; it must be a list of whole numbers"),
        ("switching.active", [[1], [3]], "phase 2 names edge 3; edges are numbered from 1 to 2"),
        ("switching.active", [[1, 1]], "each edge may be listed only once"),
        ("trigger.kind", "quarterly", "kind is 'quarterly'; it must be one of 'static', 'dynamic'"),
        ("trigger.kind", "static", "decay is 0.1, but the static trigger has a constant threshold"),
        ("trigger.threshold", 0, "threshold is 0.0; it must be positive"),
        ("trigger.threshold", MISSING, "has no 'threshold'"),
        ("trigger.decay", -0.1, "decay is -0.1; it must not be negative"),
        ("trigger.decay", MISSING, "has no 'decay'"),
    ],
)
def test_refusals_name_the_entry_the_value_and_the_rule(path, value, message):
    with pytest.raises(ScenarioError, match=message):
        read_scenario(changed(path, value))


@pytest.mark.parametrize("given", ["paper-a", None, {"name": "paper-a"}])
def test_a_closed_loop_of_what_is_no_scenario(given):
    with pytest.raises(
        ScenarioError, match=r"^closed_loop was given .*: write closed_loop\(load_scenario\(name or path\)\)"
    ):
        closed_loop(given)

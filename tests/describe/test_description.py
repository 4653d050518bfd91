"""The model description: valid by the schema and by fmpy's rules, for every model of the repository."""

import math

import pytest
from catalogue import cases
from description_cases import BOTH, only_clocks
from fmpy import read_model_description
from fmpy.validation import validate_fmu

import hybrid_model as hm
from fmu.describe.variable_table import fmu_variables
from fmu.errors import ExportError
from fmu.export import export_fmu
from hybrid_model.native.trace import trace

QUICK = ("bouncing_ball", "agent2_dynamic")
"""fmpy takes its time with names of many parts; `test_description_catalogue` asks it about further descriptions."""
MODELS = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in cases()]


@pytest.mark.parametrize("name", MODELS)
def test_fmpy_finds_nothing(name, exported):
    automaton = cases()[name].automaton
    clocks = {clock.name for clock in automaton.clocks}
    assert [
        problem for problem in validate_fmu(str(exported(automaton, name))) if not only_clocks(problem, clocks)
    ] == []


def test_agent_has_the_parameters_inputs_and_outputs_that_its_users_need(exported):
    description = read_model_description(str(exported(cases()["agent2_dynamic"].automaton, "agent2_dynamic")))
    found = {v.name: (v.causality, v.variability, v.type) for v in description.modelVariables}
    for name in ("gain", "threshold", "decay", "switching.dwell", "switching.active", "weights.duty_percent"):
        assert found[name] == ("parameter", "fixed", "Float64")
    assert found["neighbours[1]"] == ("input", "discrete", "Float64")
    assert found["x"] == ("output", "continuous", "Float64")
    assert found["broadcast"] == ("output", "discrete", "Float64")
    assert found["events"] == ("output", "discrete", "Int32")
    assert found["broadcast_clock"] == ("output", "discrete", "Clock")
    assert description.coSimulation.hasEventMode
    assert description.coSimulation.canGetAndSetFMUstate
    assert description.coSimulation.canHandleVariableCommunicationStepSize


def test_the_log_category_that_the_fmu_uses_is_declared(exported):
    description = read_model_description(str(exported(cases()["bouncing_ball"].automaton, "bouncing_ball")))
    assert [category.name for category in description.logCategories] == ["logStatusError", "logEvents"]


def test_bookkeeping_of_schedules_is_not_shown(exported):
    description = read_model_description(str(exported(cases()["agent2_dynamic"].automaton, "agent2_dynamic")))
    assert not [v.name for v in description.modelVariables if "segment" in v.name or "interval" in v.name]


def test_hostile_names_are_escaped(tmp_path):
    """Names of the C library, of C, of XML and of format strings are names like any other."""
    declared = {name: hm.State(1.0, output=True, description='<&">%s%n*/\\') for name in ("gamma", "j1", "y0", "int")}

    def flow_map(self, s):
        return {"gamma": -s.gamma, "j1": -2 * s.j1, "y0": -s["int"], "int": 0.0}

    block = type("Hostile", (hm.HybridAutomaton,), {**declared, "flow_map": flow_map})(name='a; "b" <&> %s é')
    path = export_fmu(block, tmp_path / "hostile.fmu")
    assert validate_fmu(str(path)) == []
    assert read_model_description(str(path)).modelName == 'a; "b" <&> %s é'


def test_a_variable_called_time_is_refused(tmp_path):
    block = type("Block", (hm.HybridAutomaton,), {"time": hm.State(0.0), "flow_map": lambda self, s: {"time": 1.0}})()
    with pytest.raises(ExportError, match="two variables called 'time'"):
        export_fmu(block, tmp_path / "block.fmu")


def _with(declaration):
    return type("Block", (hm.HybridAutomaton,), {"n": declaration, "flow_map": lambda self, s: {}})()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("declaration", "text"),
    [
        (hm.Parameter(2**31, integer=True), "'n' starts at 2147483648:"),
        (hm.Parameter(-(2**31) - 1, integer=True), "'n' starts at -2147483649:"),
        (hm.Parameter([0, 2**40], integer=True), "'n' starts at 1099511627776:"),
        (hm.DiscreteState(2**31, integer=True), "'n' starts at 2147483648:"),
        (hm.Parameter(0, integer=True, maximum=2**31), "'n' has the maximum 2147483648:"),
        (hm.Parameter(0, integer=True, minimum=-(2**31) - 1), "'n' has the minimum -2147483649:"),
        (hm.Parameter(0, integer=True, maximum=math.inf), "'n' has the maximum inf:"),
        (hm.Parameter(1, integer=True, minimum=0.5), "'n' has the minimum 0.5:"),
    ],
)
def test_integers_beyond_32_bits_are_refused(declaration, text, fmi, tmp_path):
    with pytest.raises(ExportError, match=rf"{text} .* from -2147483648 to 2147483647, so give"):
        export_fmu(_with(declaration), tmp_path / "block.fmu", fmi=fmi)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("fmi", BOTH)
def test_integers_of_32_bits_are_written(fmi):
    """The least and the greatest, as start and as range; beyond them floats are no integers."""
    widest = hm.Parameter([-(2**31), 2**31 - 1], integer=True, minimum=-(2**31), maximum=2**31 - 1)
    variables = fmu_variables(trace(_with(widest)), fmi)
    starts = [start for v in variables if v.name.startswith("n") for start in v.start]
    assert starts == [-(2**31), 2**31 - 1]
    fmu_variables(trace(_with(hm.Parameter(2.0**40, maximum=math.inf))), fmi)


def test_unknown_versions_are_refused(tmp_path):
    with pytest.raises(ExportError, match=r"'1\.0' is not one that can be exported: choose from 2\.0, 3\.0"):
        export_fmu(cases()["bouncing_ball"].automaton, tmp_path / "ball.fmu", fmi="1.0")

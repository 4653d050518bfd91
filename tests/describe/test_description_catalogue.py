"""Descriptions of the models of the repository, in both versions of the standard."""

import xml.etree.ElementTree as ET

import pytest
from catalogue import cases
from description_cases import BOTH, described, elements, findings, schema
from lxml import etree

import hybrid_model as hm
from fmu.describe.description import summary
from fmu.describe.model_description import model_description
from fmu.describe.variables import Bank, Fmi
from fmu.describe.xml_text import number
from hybrid_model.models import BouncingBall

QUICK = ("bouncing_ball", "stiff_thermostat", "newtons_cradle", "agent2_dynamic", "vector_agent", "firefly_network")


def check(name, fmi, folder):
    description = described(cases()[name].automaton, fmi, stop_time=1.0, step_size=0.1)
    document = model_description(description)
    validator = schema(fmi)
    assert validator.validate(etree.fromstring(document)), validator.error_log
    # Both versions have the same names by the same convention.
    clocks = {clock.name for clock in description.automaton.clocks}
    assert findings(document, folder, clocks, names=fmi is Fmi.V3_0) == []
    # A state and its derivative are told apart by place: unknowns are listed as often as they exist.
    tag = "ModelStructure/Derivatives/Unknown" if fmi is Fmi.V2_0 else "ModelStructure/ContinuousStateDerivative"
    derivatives = [v for v in description.variables if v.bank is Bank.DERIVATIVE]
    assert len(elements(document, tag)) == len(derivatives)


@pytest.mark.parametrize("fmi", BOTH)
@pytest.mark.parametrize("name", QUICK)
def test_schema_and_fmpy_find_nothing(name, fmi, tmp_path):
    check(name, fmi, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in cases() if name not in QUICK])
def test_schema_and_fmpy_find_nothing_in_any_model(name, tmp_path):
    for fmi in BOTH:
        check(name, fmi, tmp_path)


def ball(fmi, **options):
    return ET.fromstring(model_description(described(BouncingBall(), fmi, **options)))


def test_capabilities_of_fmi_3():
    root = ball(Fmi.V3_0)
    simulation, exchange = root.find("CoSimulation").attrib, root.find("ModelExchange").attrib
    for flag in (
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "providesDirectionalDerivatives",
        "providesAdjointDerivatives",
    ):
        assert simulation[flag] == exchange[flag] == "true"
    for flag in (
        "canHandleVariableCommunicationStepSize",
        "providesIntermediateUpdate",
        "canReturnEarlyAfterIntermediateUpdate",
        "mightReturnEarlyFromDoStep",
        "hasEventMode",
    ):
        assert simulation[flag] == "true"
    assert simulation["maxOutputDerivativeOrder"] == "1"
    assert exchange["needsCompletedIntegratorStep"] == "true"
    assert not {"canBeInstantiatedOnlyOncePerProcess", "recommendedIntermediateInputSmoothness"} & set(simulation)


def test_capabilities_of_fmi_2():
    root = ball(Fmi.V2_0, sources=["model.c", "engine.c"])
    for kind in ("CoSimulation", "ModelExchange"):
        element = root.find(kind)
        for flag in ("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"):
            assert element.get(flag) == "true"
        assert element.get("canNotUseMemoryManagementFunctions") == "true"
        assert [file.get("name") for file in element.iter("File")] == ["model.c", "engine.c"]
    # The margin of the impact and that of the flow set.
    assert root.get("numberOfEventIndicators") == "2"
    assert root.find("ModelExchange").get("completedIntegratorStepNotNeeded") == "false"


@pytest.mark.parametrize("fmi", BOTH)
def test_only_the_kinds_asked_for(fmi):
    root = ball(fmi, kinds=("cs",))
    assert root.find("CoSimulation") is not None
    assert root.find("ModelExchange") is None
    assert root.get("numberOfEventIndicators") is None


@pytest.mark.parametrize("fmi", BOTH)
def test_units_types_and_start_values_of_the_ball(fmi):
    root = ball(fmi, stop_time=2.5, step_size=0.01)
    units = {unit.get("name"): unit.find("BaseUnit").attrib for unit in root.find("UnitDefinitions")}
    assert units["m/s2"] == {"m": "1", "s": "-2"}
    assert units["m"] == {"m": "1"}
    items = root.find("ModelVariables")
    typed = {
        item.get("name"): (item if fmi is Fmi.V3_0 else item[0]).attrib
        for item in items
        if fmi is Fmi.V3_0 or len(item)
    }
    assert (typed["h"]["start"], typed["h"]["unit"], typed["h"]["declaredType"]) == ("1", "m", "Length")
    assert typed["v"]["reinit"] == "true"
    assert typed["g"]["start"] == "9.81"
    experiment = root.find("DefaultExperiment").attrib
    assert experiment == {"startTime": "0", "stopTime": "2.5", "tolerance": "1e-10", "stepSize": "0.01"}
    names = [item.get("name") for item in items]
    offset = 1 if fmi is Fmi.V2_0 else 0
    assert names[int(typed["der(v)"]["derivative"]) - offset] == "v"
    assert root.get("description") == "A ball on a floor; impacts lose energy."


@pytest.mark.parametrize("fmi", BOTH)
def test_a_quantity_whose_display_unit_has_an_offset_has_no_declared_type(fmi):
    class Body(hm.HybridAutomaton):
        T = hm.State(300.0, unit="K")
        p = hm.Parameter(1e5, unit="Pa")

        def flow_map(self, s):
            return {"T": 0.0}

    root = ET.fromstring(model_description(described(Body(), fmi)))
    typed = {e.get("name"): (e if fmi is Fmi.V3_0 else e[0]).attrib for e in root.find("ModelVariables")}
    assert "declaredType" not in typed["T"]
    assert (typed["T"]["quantity"], typed["T"]["unit"]) == ("ThermodynamicTemperature", "K")
    assert typed["p"]["declaredType"] == "Pressure"
    assert [e.get("name") for e in root.find("TypeDefinitions")] == ["Pressure", "Time"]
    [kelvin] = [e for e in root.find("UnitDefinitions") if e.get("name") == "K"]
    assert float(kelvin.find("DisplayUnit").get("offset")) == -273.15


def test_states_that_no_jump_changes_are_not_reinitialised():
    class Block(hm.HybridAutomaton):
        kept = hm.State(1.0)
        cycled = hm.State(1.0)

        def flow_map(self, s):
            return {"kept": -s.kept, "cycled": 1.0}

        def jump_set(self, s):
            return s.cycled - 2.0

        def jump_map(self, s):
            return {"cycled": 0.0, "kept": s.kept}

    items = elements(model_description(described(Block(), Fmi.V3_0)), "ModelVariables/Float64")
    assert {item.get("name"): item.get("reinit") for item in items}["kept"] is None
    assert {item.get("name"): item.get("reinit") for item in items}["cycled"] == "true"


def test_a_variable_may_be_called_like_a_type():
    class Block(hm.HybridAutomaton):
        Length = hm.State(1.0, unit="m")

        def flow_map(self, s):
            return {"Length": 0.0}

    for fmi in BOTH:
        document = model_description(described(Block(), fmi))
        types = {item.get("name") for item in elements(document, "TypeDefinitions/*")}
        names = {item.get("name") for item in elements(document, "ModelVariables/*")}
        assert "LengthType" in types
        assert not types & names


def test_arrays_have_structural_parameters_as_dimensions():
    root = ET.fromstring(model_description(described(cases()["agent2_dynamic"].automaton, Fmi.V3_0)))
    variables = {item.get("name"): item for item in root.find("ModelVariables")}
    references = {item.get("valueReference"): name for name, item in variables.items()}
    dimensions = [references[d.get("valueReference")] for d in variables["switching.active"].iter("Dimension")]
    assert dimensions == ["switching.phases", "switching.degree"]
    length = variables["switching.degree"]
    assert (length.tag, length.get("causality")) == ("UInt64", "structuralParameter")
    assert length.get("min") == length.get("max") == length.get("start") == "2"
    assert variables["weights.duty_percent"].get("start").split()[0] == "20"


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.0, "1"), (0.1, "0.1"), (-0.0, "-0"), (1e300, "1e+300"), (float("inf"), "INF"), (-float("inf"), "-INF")],
)
def test_numbers_are_written_without_loss(value, text):
    assert number(value) == text
    assert float(text) == value


def test_summary_is_the_first_paragraph_on_one_line():
    class Block(hm.HybridAutomaton):
        """One line
        and another.

        Not this.
        """

    assert summary(Block()) == "One line and another."
    assert summary(hm.Composition("pair", {"a": Block(), "b": Block()})) == "composed of a, b"

"""Systems in SSP files: read and written, both versions; the folder for libcosim; what must not be read."""

import shutil
import zipfile
from importlib import resources

import fmpy
import pytest
from lxml import etree

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import MisfitError
from cosim.masters import run_fixed_step
from cosim.sources import Linear
from cosim.system import System
from cosim.systems.assembly import assemble
from cosim.systems.definition import Component, SystemDefinition
from cosim.systems.files import read_system
from cosim.systems.ssp_reading import read_ssp
from cosim.systems.ssp_writing import write_osp, write_ssp

SYSTEM = """
name = "pair"
[experiment]
stop_time = 1.7
[components.a]
fmu = "stranger.fmu"
start = { rate = 2.0, string_in = "a text", boolean_in = true, enumeration_in = "high", int64_in = 9007199254740993 }
[components.b]
fmu = "stranger.fmu"
[connections]
"b.int32_in" = "a.sent"
"""
SSD = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" version="1.0" name="by hand">
  <ssd:System name="top">
    <ssd:Connectors><ssd:Connector name="speed" kind="parameter"/></ssd:Connectors>
    <ssd:ParameterBindings><ssd:ParameterBinding source="system.ssv"/></ssd:ParameterBindings>
    <ssd:Elements>
      <ssd:Component name="a" source="resources/stranger.fmu" {attributes}>
        <ssd:ParameterBindings><ssd:ParameterBinding source="a.ssv">
          <ssd:ParameterMapping source="a.ssm"/>
        </ssd:ParameterBinding></ssd:ParameterBindings>
      </ssd:Component>
      {more}
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="speed" endElement="a" endConnector="rate"/>{wires}
    </ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="1"/>
</ssd:SystemStructureDescription>
"""
WIRE = """<ssd:Connection xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" startElement="a"
  startConnector="x" endElement="a" endConnector="heard">{}</ssd:Connection>"""
INNER = """
<ssd:System name="inner" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssd:Connectors>
    <ssd:Connector name="in" kind="input"/><ssd:Connector name="out" kind="output"/>
    <ssd:Connector name="speed" kind="parameter"/>
  </ssd:Connectors>
  <ssd:Elements><ssd:Component name="b" source="resources/stranger.fmu"/></ssd:Elements>
  <ssd:Connections>
    <ssd:Connection startConnector="in" endElement="b" endConnector="heard">
      <ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>
    <ssd:Connection startElement="b" startConnector="total" endConnector="out"/>
    <ssd:Connection startConnector="speed" endElement="b" endConnector="rate"/>
  </ssd:Connections>
</ssd:System>"""
ACROSS = """
<ssd:Connection xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" startElement="a" startConnector="total"
  endElement="inner" endConnector="in"><ssc:LinearTransformation factor="10"/></ssd:Connection>
<ssd:Connection startElement="inner" startConnector="out" endElement="a" endConnector="heard"/>
<ssd:Connection xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" startConnector="speed"
  endElement="inner" endConnector="speed"><ssc:LinearTransformation offset="1"/></ssd:Connection>"""
VALUES = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0"
  name="x">
<ssv:Parameters><ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter></ssv:Parameters>
</ssv:ParameterSet>"""
MAPPING = """<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
  version="1.0">
<ssm:MappingEntry source="weight" target="weights[1]"/></ssm:ParameterMapping>"""


class Gain(hm.HybridAutomaton):
    u = hm.Input(5.0)
    y = hm.Output()
    k = hm.Parameter(1.0)

    def outputs(self, s):
        return {"y": s.k * s.u}


GAINS = {"a": "", "b": "start = { k = 3.0 }", "c": "start.k = 3.0"}


class Rod(hm.HybridAutomaton):
    length = hm.Parameter(1.0, unit="m")
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.length}


@pytest.fixture
def by_hand(stranger, tmp_path):
    """Write an SSP as another tool may have."""

    def write(attributes="", more="", wires="", prefix="", source=True):
        path, content = tmp_path / "hand.ssp", SSD.format(attributes=attributes, more=more, wires=wires)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("SystemStructure.ssd", prefix + content if prefix else content)
            archive.writestr("system.ssv", VALUES.format(name="speed", value=2.0))
            archive.writestr("a.ssv", VALUES.format(name="weight", value=5.0))
            archive.writestr("a.ssm", MAPPING)
            if source:
                archive.write(stranger(), "resources/stranger.fmu")
        return path

    return write


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_a_system_comes_back_as_it_was_written(version, stranger, tmp_path, capsys):
    stranger()
    (tmp_path / "system.toml").write_text(SYSTEM)
    target = tmp_path / "out" / "pair.ssp"
    target.parent.mkdir()
    assert main(["cosim", str(tmp_path / "system.toml")]) == 0
    expected = capsys.readouterr().out
    assert main(["cosim", str(tmp_path / "system.toml"), "--save-as", str(target), "--ssp-version", version]) == 0
    assert capsys.readouterr().out == f"{target}\n"
    assert main(["cosim", str(target)]) == 0
    assert capsys.readouterr().out == expected
    assert "a.int64_out = 9007199254740993" in expected
    assert "b.int32_out = 3" in expected


def test_what_is_written_fits_the_schema(stranger, tmp_path):
    stranger()
    (tmp_path / "system.toml").write_text(SYSTEM)
    assert main(["cosim", str(tmp_path / "system.toml"), "--save-as", str(tmp_path / "pair.ssp")]) == 0
    with zipfile.ZipFile(tmp_path / "pair.ssp") as archive:
        document = etree.fromstring(archive.read("SystemStructure.ssd"))
    schema = resources.files("fmpy") / "ssp" / "schema" / "SystemStructureDescription.xsd"
    etree.XMLSchema(etree.parse(str(schema))).assertValid(document)


def test_parameters_come_from_files_by_mappings_and_from_the_system(by_hand):
    definition = read_ssp(by_hand())
    (a,) = definition.components
    assert a.start == {"weights[1]": "5.0", "rate": "2.0"}
    assert definition.experiment.stop_time == 1.0
    slave = assemble(definition).slaves["a"]
    assert slave.inputs


def test_systems_in_systems_are_followed_through_their_borders(by_hand):
    """b hears 2 (10 total) + 1, and its rate is the system's speed, 2, and 1."""
    definition = read_ssp(by_hand(more=INNER, wires=ACROSS))
    assert definition.connections == {"inner.b.heard": Linear("a.total", 20.0, 1.0), "a.heard": "inner.b.total"}
    assert definition.components[1].name == "inner.b"
    assert definition.components[1].start == {"rate": 3.0}


def test_signals_are_scaled_and_written_as_they_are(tmp_path, exported):
    (tmp_path / "system.toml").write_text(
        f'[experiment]\nstop_time = 1.0\n[components.a]\nfmu = "{exported(Gain(), "gain", "2.0")}"\n'
        f'[components.b]\nfmu = "{exported(Gain(), "gain", "2.0")}"\nstart = {{ k = 3.0 }}\n'
        '[connections]\n"b.u" = { from = "a.y", factor = 10.0, offset = 1.0 }\n'
    )
    path = tmp_path / "system.ssp"
    definition = read_system(tmp_path / "system.toml")
    write_ssp(definition, assemble(definition), path)
    for given in (tmp_path, path):
        # b's input is 10 * 5 + 1.
        assert run_fixed_step(assemble(read_system(given)), 1.0, 0.5).final["b.y"] == pytest.approx(153.0)
    with pytest.raises(
        MisfitError, match=r"a.y -> b.u is scaled, or converted to another unit, which is not written for libcosim"
    ):
        write_osp(definition, assemble(definition), tmp_path / "osp", 0.1)


def test_automata_are_written_as_fmus_with_their_values_as_defaults(tmp_path, capsys):
    """Many tools apply no bindings. What one set of values makes is made once, and the same for all."""
    (tmp_path / "system.toml").write_text(
        "[experiment]\nstop_time = 1.0\n"
        + "".join(f'[components.{name}]\nautomaton = "{__file__}:Gain"\n{given}\n' for name, given in GAINS.items())
        + '[connections]\n"b.u" = "a.y"\n'
    )
    path = tmp_path / "system.ssp"
    assert main(["cosim", str(tmp_path / "system.toml"), "--save-as", str(path)]) == 0
    (tmp_path / "parts").mkdir()
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "parts")
        fmus = {name: archive.read(f"resources/{name}.fmu") for name in GAINS}
    assert fmus["b"] == fmus["c"] != fmus["a"]
    for name, gain in (("a", "1"), ("b", "3")):
        variables = fmpy.read_model_description(str(tmp_path / "parts" / "resources" / f"{name}.fmu")).modelVariables
        assert [float(v.start) for v in variables if v.name == "k"] == [float(gain)]
    # The bindings are there as well.
    assert [component.start for component in read_system(path).components] == [{}, {"k": "3.0"}, {"k": "3.0"}]
    capsys.readouterr()
    for given in (tmp_path / "system.toml", path):
        assert main(["cosim", str(given), "--master", "fixed-step"]) == 0
        assert "b.y = 15\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ({"source": False}, "component a is said to be in 'resources/stranger.fmu', which is no file in it"),
        (
            {"attributes": 'type="application/x-matlab"'},
            "is of type 'application/x-matlab', and FMUs and systems alone",
        ),
        ({"attributes": 'implementation="ScheduledExecution"'}, "is for ScheduledExecution, which no master runs"),
        ({"more": '<ssd:SignalDictionaryReference name="bus"/>'}, "it has a SignalDictionaryReference 'bus'"),
        (
            {"wires": WIRE.format("<ssc:BooleanMappingTransformation/>")},
            "BooleanMappingTransformation, and linear ones",
        ),
        (
            {"wires": '<ssd:Connection startElement="a" startConnector="y" endElement="a"/>'},
            "a connection of a has no endConnector",
        ),
        (
            {"wires": '<ssd:Connection startElement="z" startConnector="y" endElement="a" endConnector="heard"/>'},
            "a connection names 'z', which is no component",
        ),
        (
            {"wires": WIRE.format('<ssc:LinearTransformation factor="two"/>')},
            "the factor of its connection .* is 'two'",
        ),
        (
            {"wires": WIRE.format('<ssc:LinearTransformation factor="nan"/>')},
            "the factor of its connection .* is 'nan', which is not finite",
        ),
        ({"more": '<ssd:Component name="a" source="resources/stranger.fmu"/>'}, "two of its components are called a"),
        ({"more": '<ssd:Component source="resources/stranger.fmu"/>'}, "it has a Component without a name"),
        ({"prefix": "<!DOCTYPE x [<!ENTITY e 'e'>]>"}, "SystemStructure.ssd has a DOCTYPE"),
        ({"prefix": "\0"}, "is not in UTF-8"),
        ({"prefix": "<"}, "is no XML"),
    ],
)
def test_what_cannot_be_run_is_refused(told, sentence, by_hand):
    with pytest.raises(MisfitError, match=sentence):
        read_ssp(by_hand(**told))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_parameters_in_another_unit_than_the_fmus_are_refused(fmi, tmp_path, exported):
    """The value is not converted, and would be a hundred times too long."""
    (tmp_path / "system.toml").write_text(
        f'[components.rod]\nfmu = "{exported(Rod(), "rod", fmi)}"\nstart = {{ length = 250.0 }}\n'
    )
    definition, path = read_system(tmp_path / "system.toml"), tmp_path / "rod.ssp"
    write_ssp(definition, assemble(definition), path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    value = b'<ssv:Real value="250.0"'
    assert value in members["SystemStructure.ssd"]
    for unit in ("cm", "m"):
        content = members["SystemStructure.ssd"].replace(value, value + b' unit="%s"' % unit.encode())
        with zipfile.ZipFile(path, "w") as archive:
            for name, old in members.items():
                archive.writestr(name, content if name == "SystemStructure.ssd" else old)
        if unit == "cm":
            with pytest.raises(MisfitError, match=r"rod\.length is given in 'cm', but the FMU has it in 'm'"):
                read_ssp(path)
    assert read_ssp(path).components[0].start == {"length": "250.0"}


class Metres(hm.HybridAutomaton):
    height = hm.Parameter(2.0, unit="m")
    y = hm.Output(unit="m")

    def outputs(self, s):
        return {"y": s.height}


class Millimetres(hm.HybridAutomaton):
    u = hm.Input(0.0, unit="mm")
    y = hm.Output(unit="mm")

    def outputs(self, s):
        return {"y": s.u}


@pytest.mark.parametrize("suppressed", [True, False])
def test_units_are_converted_unless_a_connection_suppresses_it(suppressed, tmp_path, exported):
    """2 m are 2000 mm; without conversion the number is what it was. It is written as it was read."""
    fmus = {"a": exported(Metres(), "metres"), "b": exported(Millimetres(), "millimetres")}
    source = Linear("a.y", converted=False) if suppressed else "a.y"
    definition = SystemDefinition("units", [Component(n, "fmu", str(p)) for n, p in fmus.items()], {"b.u": source})
    path = write_ssp(definition, assemble(definition), tmp_path / "units.ssp")
    again = read_ssp(path)
    assert again.connections == {"b.u": source}
    assert run_fixed_step(assemble(again), 1.0, 0.5).final["b.y"] == (2.0 if suppressed else 2000.0)
    if suppressed:
        write_osp(definition, assemble(definition), tmp_path / "osp", 0.1)
    else:
        with pytest.raises(MisfitError, match=r"a.y -> b.u is scaled, or converted to another unit"):
            write_osp(definition, assemble(definition), tmp_path / "osp", 0.1)


CONNECTORS = """<ssd:SystemStructureDescription version="2.0" name="units"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssd:System name="top"><ssd:Elements>
    <ssd:Component name="a" source="metres.fmu"><ssd:Connectors>
      <ssd:Connector name="y" kind="output"><ssc:Real unit="{out}"/></ssd:Connector>
      <ssd:Connector name="height" kind="parameter"><ssc:Real unit="cm"/></ssd:Connector></ssd:Connectors>
      <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" name="p">
        <ssv:Parameters><ssv:Parameter name="height"><ssv:Real value="250"/></ssv:Parameter></ssv:Parameters>
      </ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
    </ssd:Component>
    <ssd:Component name="b" source="millimetres.fmu"><ssd:Connectors>
      <ssd:Connector name="u" kind="input"><ssc:Float64 unit="m"/></ssd:Connector></ssd:Connectors></ssd:Component>
  </ssd:Elements><ssd:Connections>
    <ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u" {suppressed}>{more}
    </ssd:Connection></ssd:Connections></ssd:System>
  <ssd:Units>
    <ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit>
    <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
    <ssc:Unit name="kg"><ssc:BaseUnit kg="1"/></ssc:Unit></ssd:Units>
</ssd:SystemStructureDescription>"""
TRIPLE = '<ssc:LinearTransformation factor="3" offset="1"/>'
SUPPRESSED = 'suppressUnitConversion="true"'


@pytest.mark.parametrize(
    ("suppressed", "more", "expected"),
    [("", "", 2500.0), ("", TRIPLE, 8500.0), (SUPPRESSED, "", 250e3), (SUPPRESSED, TRIPLE, 751e3)],
)
def test_units_of_connectors_are_those_of_what_goes_over_them(suppressed, more, expected, tmp_path, exported):
    """250 cm in a parameter are 2.5 m in the FMU and 250 cm at its connector, 2.5 m at the other, and mm behind it."""
    shutil.copy(exported(Metres(), "metres"), tmp_path / "metres.fmu")
    shutil.copy(exported(Millimetres(), "millimetres"), tmp_path / "millimetres.fmu")
    path = tmp_path / "SystemStructure.ssd"
    path.write_text(CONNECTORS.format(out="cm", suppressed=suppressed, more=more))
    assert run_fixed_step(assemble(read_system(path.parent)), 1.0, 0.5).final["b.y"] == pytest.approx(expected)
    for unit, why in (("kg", "they measure differently"), ("yd", "both are not declared in SI base units")):
        path.write_text(CONNECTORS.format(out=unit, suppressed=suppressed, more=more))
        with pytest.raises(MisfitError, match=rf"a\.y is given in 'm', but its connector is in '{unit}', and {why}"):
            read_system(path.parent)


ARRAYS = """<ssd:SystemStructureDescription version="2.0" name="units"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssd:System name="top"><ssd:Elements>
    <ssd:Component name="a" source="a.fmu"><ssd:Connectors><ssd:Connector name="y" kind="output">
      <ssc:Float64 unit="cm"/><ssc:Dimension size="2"/></ssd:Connector></ssd:Connectors>
      <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" name="p">
        <ssv:Parameters><ssv:Parameter name="heights"><ssv:Float64 unit="cm">{values}</ssv:Float64>
        <ssv:Dimension size="2"/></ssv:Parameter></ssv:Parameters>
      </ssv:ParameterSet></ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings></ssd:Component>
    <ssd:Component name="b" source="b.fmu"/>
  </ssd:Elements><ssd:Connections>
    <ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"/>
  </ssd:Connections></ssd:System>
  <ssd:Units><ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit></ssd:Units>
</ssd:SystemStructureDescription>"""
TWO = '<ssv:Value value="250"/><ssv:Value value="300"/>'


class ManyMetres(hm.HybridAutomaton):
    heights = hm.Parameter([1.0, 2.0], unit="m")
    y = hm.Output(unit="m", shape=2)

    def outputs(self, s):
        return {"y": s.heights}


class ManyMillimetres(hm.HybridAutomaton):
    u = hm.Input([0.0, 0.0], unit="mm")
    y = hm.Output(unit="mm", shape=2)

    def outputs(self, s):
        return {"y": s.u}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_units_of_arrays_are_those_of_their_elements(fmi, tmp_path, exported):
    """Cm in a set of parameters, whose unit its file declares, are m in the FMU, cm at its connector, and then mm."""
    shutil.copy(exported(ManyMetres(), "many-metres", fmi), tmp_path / "a.fmu")
    shutil.copy(exported(ManyMillimetres(), "many-millimetres", fmi), tmp_path / "b.fmu")
    path = tmp_path / "SystemStructure.ssd"
    path.write_text(ARRAYS.format(values=TWO, mapping=""))
    final = run_fixed_step(assemble(read_system(tmp_path)), 1.0, 0.5).final
    assert [final["b.y[1]"], final["b.y[2]"]] == pytest.approx([2500.0, 3000.0])
    entry = (
        '<ssd:ParameterMapping><ssm:ParameterMapping xmlns:ssm="x" version="1.0"><ssm:MappingEntry source="heights"/>'
        "</ssm:ParameterMapping></ssd:ParameterMapping>"
    )
    path.write_text(ARRAYS.format(values=TWO, mapping=entry))
    with pytest.raises(MisfitError, match="the mapping of heights has no target"):
        read_system(tmp_path)
    path.write_text(ARRAYS.format(values=TWO.replace(' value="250"', ""), mapping=""))
    with pytest.raises(MisfitError, match="its parameter 'heights' has a Value that gives none"):
        read_system(tmp_path)


BOUND = """<ssd:SystemStructureDescription version="{version}" name="bound"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssd:System name="top"><ssd:Connectors>{border}</ssd:Connectors>{outer}<ssd:Elements>
    <ssd:System name="inner">{middle}<ssd:Elements>
      <ssd:Component name="rod" source="metres.fmu">{own}</ssd:Component></ssd:Elements></ssd:System>
    <ssd:Component name="other" source="metres.fmu"/>
  </ssd:Elements><ssd:Connections>{wires}</ssd:Connections></ssd:System>
  <ssd:Units>
    <ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit>
    <ssc:Unit name="kg"><ssc:BaseUnit kg="1"/></ssc:Unit></ssd:Units>
</ssd:SystemStructureDescription>"""


def bound(mapping="", prefix="", **values):
    """A binding of parameters in cm."""
    listed = "".join(
        f'<ssv:Parameter name="{name.replace("_", ".")}"><ssv:Real value="{value}" unit="cm"/></ssv:Parameter>'
        for name, value in values.items()
    )
    return (
        f'<ssd:ParameterBindings><ssd:ParameterBinding prefix="{prefix}"><ssd:ParameterValues>'
        f'<ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>{listed}</ssv:Parameters></ssv:ParameterSet>'
        f"</ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def mapped(*entries):
    """A mapping with entries of source, target, further attributes and transformation."""
    listed = "".join(
        f'<ssm:MappingEntry source="{source}" target="{target}" {more}>{scale}</ssm:MappingEntry>'
        for source, target, more, scale in entries
    )
    return (
        f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{listed}</ssm:ParameterMapping>'
        "</ssd:ParameterMapping>"
    )


@pytest.fixture
def heights(tmp_path, exported):
    """Give the start values, in m, of a system by hand."""
    shutil.copy(exported(Metres(), "metres"), tmp_path / "metres.fmu")

    def read(version="1.0", **parts):
        names = ("border", "outer", "middle", "own", "wires")
        content = BOUND.format(version=version, **dict.fromkeys(names, "") | parts)
        (tmp_path / "SystemStructure.ssd").write_text(content)
        definition = read_system(tmp_path)
        final = run_fixed_step(assemble(definition), 1.0, 0.5).final
        return [final["inner.rod.y"], final["other.y"]], list(definition.left_out)

    return read


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize(
    ("suppressed", "scale", "expected"),
    [("", "", 2.5), ("", TRIPLE, 8.5), (SUPPRESSED, "", 250.0), (SUPPRESSED, TRIPLE, 751.0)],
)
def test_a_mapping_transforms_what_has_been_converted(version, suppressed, scale, expected, heights):
    """250 cm are 2.5 m, and 3 * 2.5 m + 1 m are 8.5 m (SSP 2.0, section 7.1.1)."""
    mapping = mapped(("long", "height", suppressed, scale))
    assert heights(version, own=bound(mapping, long=250.0)) == ([pytest.approx(expected), 2.0], [])


@pytest.mark.parametrize(("wire", "expected"), [("", 8.5), (TRIPLE, 26.5)])
def test_a_parameter_of_a_system_is_converted_before_it_is_transformed(wire, expected, heights):
    """Its connector says no unit, and so has that of what it is connected to: 3 (3 * 2.5 m + 1 m) + 1 m."""
    mapping = mapped(("long", "size", "", TRIPLE))
    parts = {
        "border": '<ssd:Connector name="size" kind="parameter"/>',
        "outer": bound(mapping, long=250.0),
        "wires": joined("size", "other.height", wire),
    }
    assert heights(**parts) == ([2.0, pytest.approx(expected)], [])


def test_values_of_systems_further_up_go_before_those_inside(heights):
    """By names with points, or a prefix (section 5.2.3)."""
    own, middle = bound(height=100.0), bound(rod_height=300.0)
    assert heights(own=own)[0] == [1.0, 2.0]
    assert heights(own=own, middle=middle)[0] == [3.0, 2.0]
    outer = bound(inner_rod_height=400.0, other_height=500.0)
    assert heights(own=own, middle=middle, outer=outer)[0] == [4.0, 5.0]
    assert heights(own=own, outer=bound(prefix="inner.rod.", height=600.0))[0] == [6.0, 2.0]
    wires = joined("size", "other.height")
    assert heights(outer=bound(size=700.0, other_height=500.0), wires=wires)[0] == [2.0, 7.0]


def test_a_value_may_have_several_targets_and_what_a_mapping_does_not_name_is_not_applied(heights):
    mapping = mapped(("long", "inner.rod.height", "", ""), ("long", "other.height", "", TRIPLE))
    assert heights(outer=bound(mapping, long=250.0)) == ([2.5, pytest.approx(8.5)], [])
    assert heights(own=bound(mapped(("long", "y", "", "")), height=250.0))[0] == [2.0, 2.0]
    twice = mapped(("long", "height", "", ""), ("wide", "height", "", ""))
    with pytest.raises(MisfitError, match="the mapping of wide has the target height, which another entry has too"):
        heights(own=bound(twice, long=250.0, wide=1.0))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('value="250.0"', "", "its parameter 'height' has no value"),
        ('name="height"', "", "it has a parameter without a name"),
    ],
)
def test_parameters_without_a_name_or_a_value_are_refused(old, new, sentence, heights):
    with pytest.raises(MisfitError, match=sentence):
        heights(own=bound(height=250.0).replace(old, new))


def test_values_for_what_is_not_there_are_left_out_and_told(heights, tmp_path, capsys):
    """A set of parameters may be for more than a system has (section 6.2)."""
    parts = {"own": bound(height=250.0, wide=1.0), "outer": bound(inner_deep=1.0)}
    assert heights(**parts) == ([2.5, 2.0], ["inner.rod.wide", "inner.deep"])
    assert main(["cosim", str(tmp_path), "--stop-time", "1"]) == 0
    assert main(["cosim", str(tmp_path / "SystemStructure.ssd"), "--stop-time", "1"]) == 0
    told = f"{tmp_path} gives values to what is not in it, and they are left out: inner.rod.wide, inner.deep."
    assert f"hybrid-fmu: {told}" in capsys.readouterr().err


def test_a_value_in_a_unit_that_measures_differently_is_refused_unless_that_is_suppressed(heights):
    mass = bound(height=250.0).replace('unit="cm"', 'unit="kg"')
    with pytest.raises(MisfitError, match=r"inner\.rod\.height is given in 'kg', but the FMU has it in 'm', and they"):
        heights(own=mass)
    mapping = mapped(("height", "height", SUPPRESSED, ""))
    assert heights(own=bound(mapping, height=250.0).replace('unit="cm"', 'unit="kg"'))[0] == [250.0, 2.0]


CROSSING = """<ssd:SystemStructureDescription version="2.0" name="crossing"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssd:System name="top"><ssd:Elements>
    <ssd:System name="inner"><ssd:Connectors><ssd:Connector name="{border}" kind="{kind}"/></ssd:Connectors>
      <ssd:Elements>{inside}</ssd:Elements><ssd:Connections>{first}</ssd:Connections></ssd:System>{outside}
  </ssd:Elements><ssd:Connections>{second}</ssd:Connections></ssd:System>
</ssd:SystemStructureDescription>"""
PART = """<ssd:Component name="{}" source="{}.fmu"><ssd:Connectors>
  <ssd:Connector name="{}" kind="{}"/></ssd:Connectors></ssd:Component>"""
A, B = PART.format("a", "metres", "y", "output"), PART.format("b", "millimetres", "u", "input")
OUT = {"border": "out", "kind": "output", "inside": A, "outside": B}
IN = {"border": "in", "kind": "input", "inside": B, "outside": A}


def joined(start, end, scale=""):
    """A connection between two of "element.connector", or connectors of the system itself."""
    (a, y), (b, u) = (place.rpartition(".")[::2] for place in (start, end))
    ends = "".join(f' {which}Element="{name}"' for which, name in (("start", a), ("end", b)) if name)
    return f'<ssd:Connection{ends} startConnector="{y}" endConnector="{u}">{scale}</ssd:Connection>'


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("parts", "first", "second", "expected"),
    [
        # 2 m out of a system, whose connector has the unit of the inside: 3 * 2 m + 1 m, in mm.
        (OUT, ("a.y", "out", TRIPLE), ("inner.out", "b.u", ""), 7000.0),
        (OUT, ("a.y", "out", ""), ("inner.out", "b.u", TRIPLE), 6001.0),
        # 2 m into a system, whose connector has the unit of the inside too: 3 * 2000 mm + 1 mm.
        (IN, ("in", "b.u", ""), ("a.y", "inner.in", TRIPLE), 6001.0),
        (IN, ("in", "b.u", TRIPLE), ("a.y", "inner.in", TRIPLE), 18004.0),
    ],
)
def test_signals_are_converted_before_each_transformation(turned, parts, first, second, expected, tmp_path, exported):
    """Kinds of connectors say where a signal goes, and not which end of a connection is called start."""
    shutil.copy(exported(Metres(), "metres"), tmp_path / "metres.fmu")
    shutil.copy(exported(Millimetres(), "millimetres"), tmp_path / "millimetres.fmu")
    wires = [joined(b, a, scale) if turned else joined(a, b, scale) for a, b, scale in (first, second)]
    path = tmp_path / "SystemStructure.ssd"
    path.write_text(CROSSING.format(first=wires[0], second=wires[1], **parts))
    final = run_fixed_step(assemble(read_system(tmp_path)), 1.0, 0.5).final
    assert final["inner.b.y" if parts is IN else "b.y"] == pytest.approx(expected)
    path.write_text(CROSSING.format(first=wires[0], second=wires[1], **parts).replace('kind="input"', 'kind="output"'))
    with pytest.raises(MisfitError, match=r"a connection joins .* which both"):
        read_system(tmp_path)


def test_elements_of_arrays_are_connected_by_their_indices(tmp_path, exported):
    shutil.copy(exported(ManyMetres(), "many-metres"), tmp_path / "a.fmu")
    shutil.copy(exported(ManyMillimetres(), "many-millimetres"), tmp_path / "b.fmu")
    path, plain = tmp_path / "SystemStructure.ssd", '" endElement="b" endConnector="u"'
    content = ARRAYS.format(values=TWO, mapping="")
    assert plain in content
    path.write_text(content.replace(plain, f'{plain[:1]} startIndices="2" {plain[2:]} endIndices="1"'))
    final = run_fixed_step(assemble(read_system(tmp_path)), 1.0, 0.5).final
    # 300 cm; the other element keeps its start value.
    assert [final["b.y[1]"], final["b.y[2]"]] == pytest.approx([3000.0, 0.0])


def test_a_system_in_a_file_of_its_own_is_one_in_its_place(tmp_path, exported):
    """As .ssd beside and as .ssp; the files have units of their own, and values from outside go first."""
    shutil.copy(exported(Metres(), "metres"), tmp_path / "metres.fmu")
    inner = BOUND.format(version="1.0", border="", outer="", middle="", own=bound(height=100.0), wires="")
    (tmp_path / "parts").mkdir()
    shutil.copy(tmp_path / "metres.fmu", tmp_path / "parts" / "metres.fmu")
    (tmp_path / "parts" / "inner.ssd").write_text(inner)
    with zipfile.ZipFile(tmp_path / "parts" / "inner.ssp", "w") as archive:
        archive.write(tmp_path / "metres.fmu", "metres.fmu")
        archive.writestr("SystemStructure.ssd", inner)
    for kind, source in (("definition", "inner.ssd"), ("package", "inner.ssp")):
        used = (
            f'<ssd:Component name="part" type="application/x-ssp-{kind}" source="parts/{source}">'
            f"{bound(other_height=300.0)}</ssd:Component>"
        )
        outer = BOUND.format(version="1.0", border="", outer="", middle="", own="", wires="")
        (tmp_path / "SystemStructure.ssd").write_text(
            outer.replace("<ssd:Component name=", f"{used}<ssd:Component name=", 1).replace('name="m"', 'name="cm"')
        )
        definition = read_system(tmp_path)
        final = run_fixed_step(assemble(definition), 1.0, 0.5).final
        found = {name.removesuffix(".y"): value for name, value in final.items()}
        assert found == {"inner.rod": 2.0, "other": 2.0, "inner.part.inner.rod": 1.0, "inner.part.other": 3.0}


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ('type="application/x-matlab"', "its parameters are of type 'application/x-matlab', and application/x-ssp-p"),
        ('sourceBase="component"', r"its parameters lie inside a component \(sourceBase\): put them beside"),
    ],
)
def test_parameters_that_lie_elsewhere_are_refused(given, sentence, heights):
    with pytest.raises(MisfitError, match=sentence):
        heights(own=bound(height=1.0).replace("<ssd:ParameterBinding ", f"<ssd:ParameterBinding {given} "))


def test_a_path_out_of_the_archive_is_refused(by_hand, tmp_path):
    path = by_hand()
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../evil", "")
    with pytest.raises(MisfitError, match=r"cannot be read as an SSP: .*\.\./evil"):
        read_system(path)
    assert not (tmp_path.parent / "evil").exists()


def test_a_description_of_an_fmu_with_a_doctype_is_refused(stranger, tmp_path, capsys):
    source, path = stranger(), tmp_path / "typed.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b"?>", b"?><!DOCTYPE x>", 1) if name.endswith(".xml") else content)
    assert main(["cosim", str(path)]) == 1
    assert "modelDescription.xml has a DOCTYPE" in capsys.readouterr().err


def test_what_is_wrong_in_an_ssp_is_wrong_usage_as_in_toml(by_hand, tmp_path, capsys):
    broken = tmp_path / "broken.ssp"
    broken.write_text("no archive")
    for path, sentence in (
        (broken, "File is not a zip file. Pack the SSP anew"),
        (by_hand(source=False), "which is no file in it"),
    ):
        assert main(["cosim", str(path)]) == 2
        assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(("given", "version"), [([], "2.0"), (["--fmi", "3.0"], "3.0")])
def test_folders_for_libcosim_have_fmus_that_it_reads(given, version, tmp_path):
    file = tmp_path / "system.toml"
    file.write_text(f'[experiment]\nstop_time = 1.0\n[components.a]\nautomaton = "{__file__}:Gain"\n')
    assert main(["cosim", str(file), "--save-as", str(tmp_path / "out"), *given]) == 0
    assert fmpy.read_model_description(str(tmp_path / "out" / "a.fmu")).fmiVersion == version


def test_a_folder_for_libcosim_names_everything(stranger, tmp_path):
    stranger()
    (tmp_path / "system.toml").write_text(SYSTEM)
    assert main(["cosim", str(tmp_path / "system.toml"), "--save-as", str(tmp_path / "osp"), "--step-size", "0.1"]) == 0
    root = etree.parse(str(tmp_path / "osp" / "OspSystemStructure.xml")).getroot()
    names = {"o": root.nsmap[None]}
    assert root.xpath("//o:Simulator/@source", namespaces=names) == ["a.fmu", "b.fmu"]
    assert root.xpath("//o:InitialValue[@variable='rate']/o:Real/@value", namespaces=names) == ["2.0"]
    assert root.xpath("//o:VariableConnection/o:Variable/@name", namespaces=names) == ["sent", "int32_in"]
    assert (tmp_path / "osp" / "a.fmu").is_file()


class Sends(hm.HybridAutomaton):
    table = hm.DiscreteState([[1.0, 2.0], [3.0, 4.0]], output=True)
    pair = hm.DiscreteState([5.0, 6.0], output=True)
    free = hm.DiscreteState([7.0, 8.0, 9.0], output=True)


class Takes(hm.HybridAutomaton):
    table = hm.Input([[0.0, 0.0], [0.0, 0.0]], discrete=True)
    pair = hm.Input([0.0, 0.0], discrete=True)


def test_arrays_are_connectors_of_version_2_where_no_connection_takes_them_apart(stranger, tmp_path):
    """The FMUs in the file stand for others: a system in this process has the arrays."""
    wires = {"b.table": Linear("a.table", 2.0, 1.0), "b.pair": ["a.pair[2]", "a.pair[1]"]}
    system = System([AutomatonSlave("a", Sends()), AutomatonSlave("b", Takes())], wires)
    definition = SystemDefinition("arrays", [Component(name, "fmu", str(stranger())) for name in "ab"], wires)
    for version, expected in (
        ("2.0", {"table": ["2", "2"], "pair[1]": [], "pair[2]": [], "free": ["3"]}),
        ("1.0", {f"table[{i},{j}]": [] for i in (1, 2) for j in (1, 2)}),
    ):
        path = write_ssp(definition, system, tmp_path / f"arrays{version}.ssp", version)
        with zipfile.ZipFile(path) as archive:
            root = etree.fromstring(archive.read("SystemStructure.ssd"))
        shapes = {c.get("name"): [d.get("size") for d in c.iterfind("{*}Dimension")] for c in root.iter("{*}Connector")}
        assert shapes.items() >= expected.items()
        assert ("table" in shapes) == (version == "2.0")
        again = System(list(system.slaves.values()), read_ssp(path).connections)
        assert set(again.connections) == set(system.connections)


def test_arrays_of_parameters_are_one_parameter_of_version_2(stranger, tmp_path, capsys):
    (tmp_path / "system.toml").write_text(f"[components.a]\nfmu = '{stranger()}'\nstart.weights = [2.5, 4]\n")
    for version, names in (("1.0", ["weights[1]", "weights[2]"]), ("2.0", ["weights"])):
        path = tmp_path / f"weights{version}.ssp"
        command = ["cosim", str(tmp_path / "system.toml"), "--save-as", str(path), "--ssp-version", version]
        assert main([*command, "--stop-time", "1"]) == 0
        with zipfile.ZipFile(path) as archive:
            root = etree.fromstring(archive.read("SystemStructure.ssd"))
        assert [parameter.get("name") for parameter in root.iter("{*}Parameter")] == names
        assert main(["cosim", str(path)]) == 0
        assert "a.total = 6.5" in capsys.readouterr().out

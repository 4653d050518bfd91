"""Semantic rules: each edit of a sound description gives the finding that names it, and no other rule is touched."""
# ruff: noqa: E501 - XML keeps its lines

import pytest
from small_fmus import DESCRIPTIONS, EXTENSION, FOLDERS, MACHINE, SCHEDULED, binary, members, write

from fmu.standard.platforms import parts_of
from fmu.validate.check import check_fmu
from fmu.validate.findings import LIMIT, Severity

X3 = '<Float64 name="x" valueReference="1" initial="exact" start="1" unit="m" min="-10" max="10"/>'
DER3 = '<Float64 name="der(x)" valueReference="2" derivative="1"/>'
RATE3 = '<Float64 name="rate" valueReference="3" causality="parameter" variability="fixed" start="1"/>'
MARGIN3 = '<Float64 name="margin" valueReference="4"/>'
END3 = "  </ModelVariables>"
OUTPUT3 = '<Output valueReference="5" dependencies="1" dependenciesKind="dependent"/>'
TICK = '<Clock name="tick" valueReference="6" causality="output" intervalVariability="triggered"/>'


def edited(text, *edits):
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def check(tmp_path, text, extra=()):
    major = 2 if 'fmiVersion="2.0"' in text else 3
    return check_fmu(write(tmp_path / "a.fmu", {**members(major, description=text), **dict(extra)}), run=False)


def wrong(report):
    return {
        finding.rule for finding in report.findings if finding.severity is not Severity.NOTE and finding.group != "fmpy"
    }


def with_variables(*more):
    return edited(DESCRIPTIONS[3], (END3, "\n".join(more) + END3))


EDITS_3 = [
    ([("<Unit ", '<Unit name="s"/><Unit '), ('name="margin"', 'name="margin" unit="s"')], set()),
    ([('name="margin"', 'name="x"')], {"variable.name"}),
    ([('name="margin"', 'name="1margin"')], {"variable.name"}),
    ([('name="margin"', "name=\"'any name! [m]'.part[2,3]\"")], set()),
    ([('name="margin"', 'name="der(x"')], {"variable.name"}),
    ([(MARGIN3, MARGIN3.replace("/>", '><Alias name="x"/></Float64>'))], {"variable.name"}),
    ([('min="-10" max="10"', 'min="10" max="-10"')], {"variable.bounds"}),
    ([('min="-10" max="10"', 'min="2" max="10"')], {"variable.bounds"}),
    ([('min="-10" max="10"', 'nominal="0"')], {"variable.nominal"}),
    ([('derivative="1"', 'derivative="99"')], {"variable.derivative", "structure.dependency"}),
    ([('derivative="1"', 'derivative="2"')], {"variable.derivative", "structure.dependency"}),
    ([('derivative="1"', 'derivative="3"')], {"variable.derivative", "structure.dependency"}),
    ([(MARGIN3, MARGIN3.replace("/>", ' declaredType="Length"/>'))], {"variable.type"}),
    (
        [('valueReference="5" dependencies="1"', 'valueReference="77" dependencies="1"')],
        {"structure.reference", "structure.output"},
    ),
    ([('dependencies="1" dependenciesKind', 'dependencies="77" dependenciesKind')], {"structure.dependency"}),
    ([('dependencies="1" dependenciesKind', 'dependencies="4" dependenciesKind')], {"structure.dependency"}),
    ([(OUTPUT3, "")], {"structure.output"}),
    ([(OUTPUT3, OUTPUT3 * 2)], {"structure.twice"}),
    (
        [('<ContinuousStateDerivative valueReference="2" dependencies="1 3"/>', "")],
        {"structure.derivative", "structure.dependency"},
    ),
    (
        [('<ContinuousStateDerivative valueReference="2"', '<ContinuousStateDerivative valueReference="4"')],
        {"structure.derivative", "structure.dependency"},
    ),
    ([('<EventIndicator valueReference="4"', '<EventIndicator valueReference="3"')], {"structure.continuous"}),
    ([('"5" dependencies="1"/>', '"5" dependencies="1" dependenciesKind="fixed"/>')], {"structure.kind"}),
    ([('instantiationToken="token"', 'instantiationToken=" "')], {"interface.token"}),
    ([('canGetAndSetFMUState="true"', "")], {"interface.flags"}),
    ([('hasEventMode="true"', 'canReturnEarlyAfterIntermediateUpdate="true"')], {"interface.flags"}),
    ([('hasEventMode="true"', 'recommendedIntermediateInputSmoothness="1"')], {"interface.flags"}),
    ([('hasEventMode="true"', 'fixedInternalStepSize="-1"')], {"interface.flags"}),
    ([('stopTime="1"', 'stopTime="-1"')], {"experiment.stop"}),
    ([('stepSize="0.1"', 'stepSize="2"')], {"experiment.step"}),
    ([('stepSize="0.1"', 'stepSize="0"')], {"experiment.step"}),
    ([('stepSize="0.1"', 'tolerance="0"')], {"experiment.tolerance"}),
    ([('stopTime="1"', 'stopTime="INF"')], {"experiment.finite"}),
]


@pytest.mark.parametrize(
    ("edits", "rules"), EDITS_3, ids=lambda value: "" if isinstance(value, list) else "+".join(sorted(value))
)
def test_fmi_3_descriptions(edits, rules, tmp_path):
    assert wrong(check(tmp_path, edited(DESCRIPTIONS[3], *edits))) == rules


EDITS_2 = [
    ([('derivative="2"', 'derivative="77"')], {"variable.derivative", "structure.dependency"}),
    ([('index="6" dependencies="2"', 'index="6" dependencies="9"')], {"structure.dependency"}),
    (
        [('index="3" dependencies="2"', 'index="0" dependencies="2"')],
        {"structure.reference", "structure.derivative", "structure.dependency"},
    ),
    ([('guid="token"', 'guid=""')], {"interface.token"}),
    ([('name="rate" valueReference="3"', 'name="rate" valueReference="1"')], {"variable.alias"}),
    ([('name="margin" valueReference="4"', 'name="margin" valueReference="3"')], set()),
    ([('<Real start="1" unit="m" min="-10"', '<Real start="-11" unit="m" min="-10"')], {"variable.bounds"}),
    ([('canGetAndSetFMUstate="true"', "")], {"interface.flags"}),
]


@pytest.mark.parametrize(
    ("edits", "rules"), EDITS_2, ids=lambda value: "" if isinstance(value, list) else "+".join(sorted(value))
)
def test_fmi_2_descriptions(edits, rules, tmp_path):
    assert wrong(check(tmp_path, edited(DESCRIPTIONS[2], *edits))) == rules


CLOCKS = [
    ([TICK], {}, set()),
    ([TICK.replace("triggered", "constant")], {}, {"clock.output", "clock.interval"}),
    ([TICK], {'hasEventMode="true"': ""}, {"clock.event_mode"}),
    ([TICK.replace('"output"', '"input"').replace("triggered", "fixed")], {}, {"clock.interval"}),
    ([TICK.replace('"output"', '"input"').replace("triggered", "countdown")], {}, set()),
    (['<Float64 name="q" valueReference="7" clocks="1" variability="discrete"/>'], {}, {"clock.reference"}),
    ([TICK, '<Float64 name="q" valueReference="7" clocks="6" variability="continuous"/>'], {}, {"clock.variability"}),
    (
        [TICK, '<Float64 name="q" valueReference="7" clocks="6" variability="discrete" previous="7"/>'],
        {},
        {"clock.previous"},
    ),
    (
        [
            TICK,
            '<Float64 name="p" valueReference="8" clocks="6" variability="discrete"/>',
            '<Float64 name="q" valueReference="7" clocks="6" variability="discrete" previous="8"/>',
        ],
        {},
        set(),
    ),
]


@pytest.mark.parametrize(("variables", "edits", "rules"), CLOCKS)
def test_clocks(variables, edits, rules, tmp_path):
    text = edited(with_variables(*variables), *edits.items())
    if variables[0] is TICK or 'causality="output"' in variables[0]:
        text = text.replace(OUTPUT3, OUTPUT3 + '<Output valueReference="6"/>')
    assert wrong(check(tmp_path, text)) == rules


def test_fmpy_s_demand_for_clocks_is_a_note(tmp_path):
    text = with_variables(TICK).replace(OUTPUT3, OUTPUT3 + '<Output valueReference="6"/>')
    report = check(tmp_path, text)
    assert report.ok
    assert {finding.rule for finding in report.findings} == {"fmpy.clocks", "run.off"}
    # A second, real gap beside the clock stays an error.
    broken = edited(text, ('<InitialUnknown valueReference="2" dependencies="1 3"/>', ""))
    assert "fmpy.validation" in {f.rule for f in check(tmp_path, broken).findings if f.severity is Severity.ERROR}


ARRAYS = [
    (
        '<Float64 name="a" valueReference="7" causality="parameter" start="1 2 3"><Dimension start="3"/></Float64>',
        set(),
    ),
    (
        '<Float64 name="a" valueReference="7" causality="parameter" start="1 2"><Dimension start="3"/></Float64>',
        {"start"},
    ),
    ('<Float64 name="a" valueReference="7"><Dimension valueReference="3"/></Float64>', {"dimension"}),
    ('<Float64 name="a" valueReference="7"><Dimension valueReference="8"/></Float64>', {"dimension"}),
    (
        '<UInt64 name="n" valueReference="8" causality="structuralParameter" variability="fixed" start="2"/>'
        '<Float64 name="a" valueReference="7" causality="parameter" start="1 2"><Dimension valueReference="8"/></Float64>',
        set(),
    ),
    (
        '<UInt64 name="n" valueReference="8" causality="structuralParameter" variability="fixed" start="0"/>'
        '<Float64 name="a" valueReference="7"><Dimension valueReference="8"/></Float64>',
        {"dimension"},
    ),
]


@pytest.mark.parametrize(("variables", "rules"), ARRAYS)
def test_arrays(variables, rules, tmp_path):
    assert wrong(check(tmp_path, with_variables(variables))) == {f"variable.{rule}" for rule in rules}


def test_what_fmpy_finds_is_passed_on(tmp_path):
    text = edited(DESCRIPTIONS[3], ('unit="m"', 'unit="parsec"'))
    assert any("parsec" in finding.message for finding in check(tmp_path, text).findings if finding.group == "fmpy")
    text = edited(
        DESCRIPTIONS[3], ('causality="parameter" variability="fixed"', 'causality="parameter" variability="discrete"')
    )
    assert not check(tmp_path, text).ok


def test_findings_of_one_rule_are_bounded(tmp_path):
    more = [f'<Float64 name="{n}" valueReference="{n}"/>' for n in range(100, 200)]
    found = [finding for finding in check(tmp_path, with_variables(*more)).findings if finding.rule == "variable.name"]
    assert len(found) == LIMIT + 1
    assert "There are more" in found[-1].message


def test_ten_thousand_variables_and_a_name_of_ten_thousand_characters(tmp_path):
    """The grammar of names takes linear time; a general parser would need minutes."""
    more = [f'<Float64 name="part[{n}].x{n}" valueReference="{n}"/>' for n in range(100, 10_100)]
    more.append(f"""<Float64 name="{"ab." * 3000}c'" valueReference="99"/>""")
    assert wrong(check(tmp_path, with_variables(*more))) == {"variable.name"}


BUILD = """<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="{name}"><SourceFileSet>
<SourceFile name="{file}"/><IncludeDirectory name="{folder}"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>"""


@pytest.mark.parametrize(
    ("fields", "rules"),
    [
        ({}, set()),
        ({"file": "gone.c"}, {"source.missing"}),
        ({"folder": "gone"}, {"source.missing"}),
        ({"name": "other"}, {"source.identifier"}),
    ],
)
def test_build_descriptions(fields, rules, tmp_path):
    text = BUILD.format(**{"name": "small", "file": "small.c", "folder": "include", **fields})
    files = {"sources/buildDescription.xml": text, "sources/small.c": "", "sources/include/small.h": ""}
    assert wrong(check(tmp_path, DESCRIPTIONS[3], files)) == rules


def test_missing_sources_are_told_in_one_sentence(tmp_path):
    """Beside a binary they are a warning; an FMU of sources alone cannot be used without them."""
    files = "".join(f'<SourceFile name="part{n}.c"/>' for n in range(21))
    configuration = (
        f'<BuildConfiguration modelIdentifier="small"><SourceFileSet>{files}</SourceFileSet></BuildConfiguration>'
    )
    text = f'<fmiBuildDescription fmiVersion="3.0">{configuration * 2}</fmiBuildDescription>'
    extra = {"sources/buildDescription.xml": text}
    [finding] = [f for f in check(tmp_path, DESCRIPTIONS[3], extra).findings if f.rule == "source.missing"]
    assert finding.severity is Severity.WARNING
    assert "'part0.c', 'part1.c'" in finding.message
    assert "(21 in all)" in finding.message
    alone = check_fmu(write(tmp_path / "b.fmu", {"modelDescription.xml": DESCRIPTIONS[3], **extra}), run=False)
    assert [f.severity for f in alone.findings if f.rule == "source.missing"] == [Severity.ERROR]


def test_manifests_are_no_part_of_fmi_2_and_decide_nothing_in_fmi_3(tmp_path):
    name = "extra/org.x/fmi-ls-manifest.xml"
    assert wrong(check(tmp_path, DESCRIPTIONS[2], {name: "<anything/>"})) == set()
    report = check(tmp_path, DESCRIPTIONS[3], {name: "<anything/>"})
    assert wrong(report) == {"layered.manifest"}
    assert report.ok


def test_manifests_of_layered_standards_have_three_attributes_and_any_root(tmp_path):
    name, space = "extra/org.x/fmi-ls-manifest.xml", 'xmlns:l="http://fmi-standard.org/fmi-ls-manifest"'
    sound = f'<anything {space} l:fmi-ls-name="org.x" l:fmi-ls-version="1" l:fmi-ls-description="d"><more/></anything>'
    assert wrong(check(tmp_path, DESCRIPTIONS[3], {name: sound})) == set()
    assert wrong(check(tmp_path, DESCRIPTIONS[3], {name: sound.replace("l:fmi-ls-name", "fmi-ls-name")})) == {
        "layered.manifest"
    }
    assert wrong(check(tmp_path, DESCRIPTIONS[3], {name: sound.replace(space, "")})) == {"xml.syntax"}


def test_sources_that_nobody_can_build(tmp_path):
    assert wrong(check(tmp_path, DESCRIPTIONS[3], {"sources/a.c": ""})) == {"source.description"}
    text = edited(
        DESCRIPTIONS[2],
        (
            'canHandleVariableCommunicationStepSize="true"/>',
            '><SourceFiles><File name="a.c"/></SourceFiles></CoSimulation>',
        ),
    )
    assert wrong(check(tmp_path, text)) == {"source.missing"}
    assert wrong(check(tmp_path, text, {"sources/a.c": ""})) == set()


TERMINALS = """<fmiTerminalsAndIcons fmiVersion="{version}"><Terminals><Terminal name="port" matchingRule="{rule}">
<TerminalMemberVariable variableName="{variable}" {member} variableKind="signal"/>
<TerminalMemberVariable variableName="rate" memberName="rate" variableKind="signal"/>{icon}
</Terminal></Terminals></fmiTerminalsAndIcons>"""
ICON = '<TerminalGraphicalRepresentation x1="0" y1="0" x2="1" y2="1" iconBaseName="port"/>'


@pytest.mark.parametrize(
    ("fields", "rules"),
    [
        ({}, set()),
        ({"variable": "gone"}, {"terminal.variable"}),
        ({"variable": "x"}, {"terminal.variable"}),
        ({"member": ""}, {"terminal.member"}),
        ({"member": "", "rule": "sequence"}, set()),
        ({"member": 'memberName="rate"'}, {"terminal.member"}),
        ({"version": "3.0.1"}, {"terminal.version"}),
        ({"icon": ICON}, {"terminal.icon"}),
    ],
)
def test_terminals(fields, rules, tmp_path):
    usual = {"version": "3.0", "rule": "bus", "variable": "y", "member": 'memberName="y"', "icon": ""}
    text = TERMINALS.format(**{**usual, **fields})
    assert wrong(check(tmp_path, DESCRIPTIONS[3], {"terminalsAndIcons/terminalsAndIcons.xml": text})) == rules


@pytest.mark.parametrize(
    ("place", "rules"),
    [
        (f"binaries/{FOLDERS[3]}/small{EXTENSION}", set()),
        (f"binaries/{FOLDERS[3]}/other{EXTENSION}", {"binary.missing"}),
        ("binaries/x86_64-windows/small.dll", {"binary.machine"}),
        ("binaries/amiga/small.so", {"binary.platform"}),
        ("binaries/i686-linux/small.so", {"binary.platform"}),
        ("binaries/x86-linux/small.so", {"binary.machine"}),
        ("binaries/x86-windows/small.dll", {"binary.machine"}),
        ("elsewhere/small.so", {"binary.none"}),
    ],
)
def test_places_of_binaries(place, rules, tmp_path):
    path = write(tmp_path / "a.fmu", {"modelDescription.xml": DESCRIPTIONS[3], place: binary(3)})
    assert wrong(check_fmu(path, run=False)) == rules


@pytest.mark.parametrize(
    ("folder", "parts"),
    [
        ("x86-windows", ("x86", "windows", "")),
        ("x86-linux", ("x86", "linux", "")),
        ("x86_64-windows-msvc140mt", ("x86_64", "windows", "msvc140mt")),
        ("aarch32-linux", ("aarch32", "linux", "")),
        ("riscv64-linux", ("riscv64", "linux", "")),
        ("darwin32", ("x86", "darwin", "")),
        ("darwin64", ("x86_64", "darwin", "")),
        ("win32", ("x86", "windows", "")),
        ("i386-linux", None),
        ("i586-linux", None),
        ("x86_64-linux-Gnu", None),
        ("x86_64-amiga", None),
    ],
)
def test_names_of_platforms_are_those_of_the_standards(folder, parts):
    """FMI 3.0.2 section 2.5.1 and FMI 2.0.4 section 2.3, name by name."""
    assert parts_of(folder) == parts


@pytest.mark.parametrize(("file", "severity"), [("readme.txt", Severity.WARNING), ("other.dll", Severity.ERROR)])
def test_a_platform_without_its_binary_is_no_fault_of_the_others(file, severity, tmp_path):
    report = check(tmp_path, DESCRIPTIONS[3], {f"binaries/x86-windows/{file}": b""})
    assert [finding.severity for finding in report.findings if finding.rule == "binary.missing"] == [severity]


def test_darwin32_is_a_name_of_fmi_2(tmp_path):
    for major, rules in ((2, set()), (3, {"binary.platform"})):
        files = {"modelDescription.xml": DESCRIPTIONS[major], "binaries/darwin32/small.dylib": b""}
        report = check_fmu(write(tmp_path / "a.fmu", files), run=False)
        assert wrong(report) - {"binary.damaged"} == rules


SYMBOLS = [
    ((), set()),
    (("SYMBOLS",), {"symbol.exported"}),
    (("PYTHON",), {"symbol.runtime"}),
    (("-fvisibility=default",), {"symbol.exported"}),
    (("-Wl,-rpath,/opt/vendor/lib",), {"binary.rpath"}),
    (("-Wl,-rpath,$ORIGIN",), set()),
    (("-Wl,-z,execstack",), {"binary.execstack"}),
    (("-DfmiThreeDoStep=1", "-Dfmi3DoStep=hidden_step"), {"symbol.missing", "symbol.exported"}),
]


@pytest.mark.skipif(EXTENSION != ".so", reason="options of the ELF linker")
@pytest.mark.parametrize(("flags", "rules"), SYMBOLS)
def test_symbols_and_flaws_of_a_binary(flags, rules, tmp_path):
    if flags == ("-fvisibility=default",):  # the small FMU has static functions only
        flags = ("SYMBOLS", *flags)
    assert wrong(check_fmu(write(tmp_path / "a.fmu", members(3, *flags)), run=False)) == rules


def test_a_scheduled_fmu_without_clocks_is_a_warning(tmp_path):
    text = SCHEDULED.replace('causality="input" intervalVariability', 'causality="local" intervalVariability')
    report = check(tmp_path, text)
    assert "clock.scheduled" in wrong(report)


def test_the_platform_of_this_machine_is_known():
    assert MACHINE.count("-") == 1

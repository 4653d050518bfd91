"""Small FMUs written by hand, with one fault at a time."""
# ruff: noqa: E501 - XML keeps its lines

import functools
import re
import subprocess
import tempfile
import zipfile
from pathlib import Path

from fmu.standard import functions
from fmu.standard.platforms import EXTENSIONS, this_machine

SOURCE = Path(__file__).with_name("small_fmu.c")
MACHINE = "-".join(this_machine())
FOLDERS = {2: {"x86_64-linux": "linux64", "x86_64-darwin": "darwin64"}.get(MACHINE, MACHINE), 3: MACHINE}
EXTENSION = EXTENSIONS[this_machine()[1]]

DESCRIPTIONS = {
    3: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Small" instantiationToken="token" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="small" canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <CoSimulation modelIdentifier="small" canGetAndSetFMUState="true" canSerializeFMUState="true" hasEventMode="true"
    canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions><Unit name="m"/></UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="x" valueReference="1" initial="exact" start="1" unit="m" min="-10" max="10"/>
    <Float64 name="der(x)" valueReference="2" derivative="1"/>
    <Float64 name="rate" valueReference="3" causality="parameter" variability="fixed" start="1"/>
    <Float64 name="margin" valueReference="4"/>
    <Float64 name="y" valueReference="5" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="5" dependencies="1" dependenciesKind="dependent"/>
    <ContinuousStateDerivative valueReference="2" dependencies="1 3"/>
    <InitialUnknown valueReference="2" dependencies="1 3"/>
    <InitialUnknown valueReference="5" dependencies="1"/>
    <EventIndicator valueReference="4"/>
  </ModelStructure>
</fmiModelDescription>
""",
    2: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Small" guid="token" variableNamingConvention="structured"
  numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="small" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
  <CoSimulation modelIdentifier="small" canGetAndSetFMUstate="true" canSerializeFMUstate="true"
    canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions><Unit name="m"/></UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" initial="exact"><Real start="1" unit="m" min="-10" max="10"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="rate" valueReference="3" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="margin" valueReference="4"><Real/></ScalarVariable>
    <ScalarVariable name="y" valueReference="5" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="6" dependencies="2" dependenciesKind="dependent"/></Outputs>
    <Derivatives><Unknown index="3" dependencies="2"/></Derivatives>
    <InitialUnknowns>
      <Unknown index="3" dependencies="2 4"/>
      <Unknown index="6" dependencies="2"/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
""",
}
SCHEDULED = (
    DESCRIPTIONS[3]
    .replace("<CoSimulation", "<ScheduledExecution")
    .replace('hasEventMode="true"', "")
    .replace('canHandleVariableCommunicationStepSize="true"', "")
    .replace("  <ModelExchange", "<!--")
    .replace('canSerializeFMUState="true"/>', "-->", 1)
    .replace(
        "  </ModelVariables>",
        '<Clock name="tick" valueReference="6" causality="input" intervalVariability="constant" intervalDecimal="0.1"/>\n'
        "  </ModelVariables>",
    )
)


def only(kind, description):
    """Return a description with one of its interface types."""
    other = {"CoSimulation": "ModelExchange", "ModelExchange": "CoSimulation"}[kind]
    return re.sub(rf"<{other}[^>]*/>", "", description)


# Co-simulation without capabilities: the fewest experiments, for faults on which each one takes its whole time.
PLAIN = re.sub(
    r'(canGetAndSetFMUState|canSerializeFMUState|hasEventMode)="true"', "", only("CoSimulation", DESCRIPTIONS[3])
)


def stubs(folder, major):
    """Write a C file with all functions of a version, weak: those of another file take their places."""
    path = Path(folder) / "stubs.c"
    weak = '__attribute__((weak, visibility("default"))) long'
    kinds = ("CoSimulation", "ModelExchange", "ScheduledExecution")
    needed = sorted({name for kind in kinds for name in functions.required(major, kind)})
    path.write_text(
        "".join(f"{weak} {name}(void) {{ return {0 if 'Instantiate' in name else 3}; }}\n" for name in needed)
    )
    return path


@functools.cache
def binary(major, *flags):
    """Compile the small FMU; flags are names of faults, or options of the compiler that start with a dash."""
    options = [flag if flag.startswith("-") else f"-DFAULT_{flag}" for flag in flags]
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / f"small{EXTENSION}"
        base = ["cc", "-O0", "-w", "-shared", "-fPIC", "-fvisibility=hidden", f"-DFMI={major}", "-fno-builtin"]
        subprocess.run([*base, *options, SOURCE, stubs(folder, major), "-o", output, "-lm"], check=True)
        return output.read_bytes()


def write(path, members, method=zipfile.ZIP_DEFLATED):
    """Write an archive of members by name."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def members(major, *faults, description=None):
    """Return the members of the small FMU."""
    return {
        "modelDescription.xml": DESCRIPTIONS[major] if description is None else description,
        f"binaries/{FOLDERS[major]}/small{EXTENSION}": binary(major, *faults),
    }

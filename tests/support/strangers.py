"""FMUs that are not ours, as other tools write them: what they are told to be, and their descriptions."""

import zipfile

import fmpy

WELL, STALLS, REPEATS, CREEPS, DIES, FAILS, PANTS, HANGS, ABORTS, ITERATES, PASTS, BEYOND, BACKWARD, THRICE = range(14)
LEAVES, BLINDED = 14, 15
"""Behaviours of `stranger3.c`."""
TYPES = {
    "Float64": 'min="-0.1" max="1e6"',
    "Float32": "",
    "Int8": "",
    "UInt8": "",
    "Int16": "",
    "UInt16": "",
    "Int32": 'min="-5" max="3000000"',
    "UInt32": "",
    "Int64": "",
    "UInt64": "",
}
"""Numbers that the stranger echoes, and their attributes."""

_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="stranger" instantiationToken="stranger {token}">
  <{kind} modelIdentifier="stranger" {flags}/>
  <TypeDefinitions>
    <EnumerationType name="Level"><Item name="low" value="1"/><Item name="high" value="7"/></EnumerationType>
  </TypeDefinitions>
  <DefaultExperiment {experiment}/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="x" valueReference="1" causality="output"/>
    <Int32 name="count" valueReference="2" causality="output" variability="discrete"/>
    <Float64 name="rate" valueReference="3" causality="parameter" variability="fixed" start="1" min="0"/>
    <Int32 name="ends" valueReference="4" causality="parameter" variability="fixed" start="1000000"/>
    <Int32 name="behaviour" valueReference="5" causality="parameter" variability="fixed" start="0"/>
    <Boolean name="announces" valueReference="6" causality="parameter" variability="fixed" start="false"/>
    <UInt64 name="size" valueReference="7" causality="structuralParameter" variability="fixed" start="2" min="1"/>
    <Float64 name="weights" valueReference="8" causality="parameter" variability="fixed" start="1 1">
      <Dimension valueReference="7"/>
    </Float64>
    <Float64 name="total" valueReference="9" causality="output"/>
    <Int32 name="steps" valueReference="10" causality="output" variability="discrete"/>
    <Int32 name="sent" valueReference="11" causality="output" variability="discrete"/>
    <Float64 name="heard" valueReference="12" causality="input" variability="discrete" start="0"/>
    <Float64 name="stranger.h" valueReference="13" causality="parameter" variability="fixed" start="1"/>
{pulse}
{echoes}
  </ModelVariables>
  <ModelStructure><Output valueReference="1"/><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>
"""
_PULSE = '    <Clock name="pulse" valueReference="15" causality="output" intervalVariability="triggered"/>'
_ECHO = '<{type} name="{name}" valueReference="{reference}" causality="{causality}" variability="discrete" {more}'


def _echoes():
    kinds = {**dict.fromkeys(TYPES, 'start="0"'), "Boolean": 'start="false"'}
    kinds |= {"Enumeration": 'declaredType="Level" start="1"', "String": "", "Binary": ""}
    for place, (kind, start) in enumerate(kinds.items()):
        reference, more = 20 + 2 * place, "" if kind != "Enumeration" else 'declaredType="Level"'
        open_, close = f"{start} {TYPES.get(kind, '')}", "/>"
        if kind in ("String", "Binary"):
            open_, close = "", f'><Start value="{"00" if kind == "Binary" else "nothing"}"/></{kind}>'
        lines = {"in": ("input", open_ + close), "out": ("output", more + "/>")}
        for suffix, (causality, rest) in lines.items():
            yield _ECHO.format(
                type=kind,
                name=f"{kind.lower()}_{suffix}",
                reference=reference if suffix == "in" else reference + 1,
                causality=causality,
                more=rest,
            )


def write_stranger3(
    path,
    binary,
    *,
    events=True,
    states=True,
    variable=True,
    alone=False,
    experiment='stopTime="2"',
    kind=None,
    pulse=False,
):
    """Write an FMU of FMI 3.0: flags, default experiment, another interface than Co-Simulation, a clock."""
    flags = {"hasEventMode": events, "canGetAndSetFMUState": states, "canHandleVariableCommunicationStepSize": variable}
    flags["canBeInstantiatedOnlyOncePerProcess"] = alone
    content = _DESCRIPTION.format(
        token=f"{'' if states else 'stateless'} {'' if variable else 'rigid'}",
        kind=kind or "CoSimulation",
        flags=" ".join(f'{name}="true"' for name, given in flags.items() if given) if kind is None else "",
        experiment=experiment,
        pulse=_PULSE if pulse else "",
        echoes="\n".join(f"    {line}" for line in _echoes()),
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", content)
        archive.write(binary, f"binaries/{fmpy.platform_tuple}/stranger.so")
    return path

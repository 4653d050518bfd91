"""Systems of FMUs written for other tools: SSP 1.0 and 2.0, and the configuration of the Open Simulation Platform."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lxml import etree

from cosim.errors import MisfitError
from cosim.slave import Port, Slave
from cosim.sources import Linear
from cosim.system import System
from cosim.systems.definition import FMU, SystemDefinition
from cosim.systems.ssp_reading import DESCRIPTION, VERSIONS
from fmu.archives.writing import package

_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV = f"{_SSP}Description", f"{_SSP}Common", f"{_SSP}ParameterValues"
OSP = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"
OSP_FILE = "OspSystemStructure.xml"
_TYPES = {"truth": "Boolean", "text": "String", "bytes": "Binary"}


def write_ssp(definition: SystemDefinition, system: System, path: str | Path, version: str = "1.0") -> Path:
    """Write a system of FMUs as an SSP file: its FMUs, connectors, connections and start values.

    Parameters
    ----------
    definition : SystemDefinition
        Whose components are FMUs.
    system : System
        Made of it.
    path : str or Path
        The file.
    version : {"1.0", "2.0"}

    Raises
    ------
    MisfitError
        If a component is no FMU, or the version is another.
    """
    if version not in VERSIONS:
        raise MisfitError(f"the version of SSP is {version!r}: give one of {', '.join(VERSIONS)}.")
    content: dict[str, bytes | Path] = {DESCRIPTION: _bytes(_description(definition, system, version))}
    content |= {f"resources/{name}.fmu": source for name, source in _fmus(definition)}
    return package(content, Path(path), DESCRIPTION)


def write_osp(definition: SystemDefinition, system: System, folder: str | Path, step: float) -> Path:
    """Write a system of FMUs as a folder with the configuration that libcosim reads, which runs FMI 2.0.

    Parameters
    ----------
    definition, system
        As for `write_ssp`.
    folder : str or Path
    step : float
        Its communication step in s.

    Raises
    ------
    MisfitError
        If a component is no FMU.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    root = etree.Element(f"{{{OSP}}}OspSystemStructure", nsmap={None: OSP}, version="0.1")
    _add(root, OSP, "StartTime").text = repr(definition.experiment.start_time or 0.0)
    _add(root, OSP, "BaseStepSize").text = repr(step)
    _add(root, OSP, "Algorithm").text = "fixedStep"
    simulators = _add(root, OSP, "Simulators")
    for (name, source), component in zip(_fmus(definition), definition.components, strict=True):
        shutil.copyfile(source, folder / f"{name}.fmu")
        simulator = _add(simulators, OSP, "Simulator", name=name, source=f"{name}.fmu", stepSize=repr(step))
        if component.start:
            values = _add(simulator, OSP, "InitialValues")
            for variable, value in _scalars(system.slaves[name], component.start):
                kind = _type(value)
                initial = _add(values, OSP, "InitialValue", variable=variable)
                _add(initial, OSP, kind, value=_text(value))
    connections = _add(root, OSP, "Connections")
    for wire in system.connections:
        if _linear(definition, f"{wire.target}.{wire.input}") is not None:
            raise MisfitError(f"{wire} is scaled, which is not written for libcosim: scale in one of the FMUs.")
        element = _add(connections, OSP, "VariableConnection")
        _add(element, OSP, "Variable", simulator=wire.source, name=wire.output)
        _add(element, OSP, "Variable", simulator=wire.target, name=wire.input)
    (folder / OSP_FILE).write_bytes(_bytes(root))
    return folder


def _description(definition: SystemDefinition, system: System, version: str) -> Any:
    names = {"ssd": SSD, "ssc": SSC, "ssv": SSV}
    root = etree.Element(f"{{{SSD}}}SystemStructureDescription", nsmap=names, version=version, name=definition.name)
    whole = _add(root, SSD, "System", name=definition.name)
    elements = _add(whole, SSD, "Elements")
    for component in definition.components:
        slave = system.slaves[component.name]
        element = _add(
            elements,
            SSD,
            "Component",
            name=component.name,
            type="application/x-fmu-sharedlibrary",
            source=f"resources/{component.name}.fmu",
        )
        connectors = _add(element, SSD, "Connectors")
        for kind, ports in (("input", slave.inputs), ("output", slave.outputs)):
            for port in ports.values():
                connector = _add(connectors, SSD, "Connector", name=port.name, kind=kind)
                _add(connector, SSC, _port_type(port))
        if component.start:
            bindings = _add(_add(element, SSD, "ParameterBindings"), SSD, "ParameterBinding")
            values = _add(bindings, SSD, "ParameterValues")
            parameters = _add(
                _add(values, SSV, "ParameterSet", version=version, name=f"{component.name}-start"), SSV, "Parameters"
            )
            for variable, value in _scalars(slave, component.start):
                parameter = _add(parameters, SSV, "Parameter", name=variable)
                _add(parameter, SSV, _type(value), value=_text(value))
    if system.connections:
        connections = _add(whole, SSD, "Connections")
        for wire in system.connections:
            ends = {"startElement": wire.source, "startConnector": wire.output}
            element = _add(connections, SSD, "Connection", **ends, endElement=wire.target, endConnector=wire.input)
            linear = _linear(definition, f"{wire.target}.{wire.input}")
            if linear is not None:
                _add(element, SSC, "LinearTransformation", factor=repr(linear.factor), offset=repr(linear.offset))
    times = {"startTime": definition.experiment.start_time, "stopTime": definition.experiment.stop_time}
    given = {name: repr(value) for name, value in times.items() if value is not None}
    if given:
        _add(root, SSD, "DefaultExperiment", **given)
    return root


def _linear(definition: SystemDefinition, target: str) -> Linear | None:
    """Return how what an input is driven by is scaled; an element is as its array is."""
    given = definition.connections.get(target, definition.connections.get(target.partition("[")[0]))
    return given if isinstance(given, Linear) else None


def _fmus(definition: SystemDefinition) -> Iterator[tuple[str, Path]]:
    for component in definition.components:
        if component.kind != FMU:
            raise MisfitError(f"{component.name} is an automaton: export it (`hybrid-fmu export`), and name its FMU.")
        yield component.name, Path(component.source)


def _scalars(slave: Slave, start: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield start values element by element, as values of their types where they are texts."""
    for name, value in start.items():
        if isinstance(value, (list, tuple)):
            elements = [own for own in slave.variable_names if own.startswith(f"{name}[")]
            yield from zip(elements, value, strict=True)
        else:
            yield name, slave.parse(name, value) if isinstance(value, str) else value


def _port_type(port: Port) -> str:
    return _TYPES.get(port.kind, "Integer" if port.whole else "Real")


def _type(value: Any) -> str:
    kinds = {bool: "Boolean", int: "Integer", str: "String", bytes: "Binary"}
    return kinds.get(type(value), "Real")


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return value.hex() if isinstance(value, bytes) else value if isinstance(value, str) else repr(value)


def _add(parent: Any, namespace: str, tag: str, /, **attributes: str) -> Any:
    return etree.SubElement(parent, f"{{{namespace}}}{tag}", attributes)


def _bytes(root: Any) -> bytes:
    return bytes(etree.tostring(root, encoding="UTF-8", xml_declaration=True, pretty_print=True))

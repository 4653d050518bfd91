"""Systems of FMUs written for other tools: SSP 1.0 and 2.0, and the configuration of the Open Simulation Platform."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lxml import etree

from cosim.errors import MisfitError
from cosim.slave import Port, Slave
from cosim.sources import Linear
from cosim.system import Connection, System
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
        If a component is no FMU, or a connection scales what it carries or converts its unit.
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
        if wire.converts:
            raise MisfitError(
                f"{wire} is scaled, or converted to another unit, which is not written for libcosim: do so in one of "
                "the FMUs."
            )
        element = _add(connections, OSP, "VariableConnection")
        _add(element, OSP, "Variable", simulator=wire.source, name=wire.output)
        _add(element, OSP, "Variable", simulator=wire.target, name=wire.input)
    (folder / OSP_FILE).write_bytes(_bytes(root))
    return folder


def _description(definition: SystemDefinition, system: System, version: str) -> Any:
    names = {"ssd": SSD, "ssc": SSC, "ssv": SSV}
    root = etree.Element(f"{{{SSD}}}SystemStructureDescription", nsmap=names, version=version, name=definition.name)
    whole = _add(root, SSD, "System", name=definition.name)
    whole_arrays = _whole_arrays(definition, system) if version == "2.0" else set()
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
            for name, port, shape in _connectors(component.name, ports, whole_arrays):
                connector = _add(connectors, SSD, "Connector", name=name, kind=kind)
                _add(connector, SSC, _port_type(port))
                _add_dimensions(connector, shape)
        if component.start:
            bindings = _add(_add(element, SSD, "ParameterBindings"), SSD, "ParameterBinding")
            values = _add(bindings, SSD, "ParameterValues")
            parameters = _add(
                _add(values, SSV, "ParameterSet", version=version, name=f"{component.name}-start"), SSV, "Parameters"
            )
            for variable, value in component.start.items():
                _add_parameters(parameters, slave, variable, value, in_arrays=version == "2.0")
    if system.connections:
        _add_connections(_add(whole, SSD, "Connections"), definition, system, whole_arrays)
    times = {"startTime": definition.experiment.start_time, "stopTime": definition.experiment.stop_time}
    given = {name: repr(value) for name, value in times.items() if value is not None}
    if given:
        _add(root, SSD, "DefaultExperiment", **given)
    return root


def _add_connections(
    parent: Any, definition: SystemDefinition, system: System, whole_arrays: set[tuple[str, str]]
) -> None:
    told = set[tuple[str, str]]()
    for wire in system.connections:
        output, into = wire.output, wire.input
        if (wire.target, _arrays(system, wire)[1]) in whole_arrays:
            output, into = _arrays(system, wire)
        if (wire.target, into) in told:
            continue
        told.add((wire.target, into))
        ends = {"startElement": wire.source, "startConnector": output, "endElement": wire.target, "endConnector": into}
        element = _add(parent, SSD, "Connection", **ends)
        linear = _linear(definition, f"{wire.target}.{into}")
        if linear is not None and not linear.converted:
            element.set("suppressUnitConversion", "true")
        if linear is not None and (linear.factor, linear.offset) != (1.0, 0.0):
            _add(element, SSC, "LinearTransformation", factor=repr(linear.factor), offset=repr(linear.offset))


def _whole_arrays(definition: SystemDefinition, system: System) -> set[tuple[str, str]]:
    """Return the arrays, by slave and name, that no connection takes apart: their own connectors are enough."""
    arrays = {
        (slave.name, port.array)
        for slave in system.slaves.values()
        for port in (*slave.inputs.values(), *slave.outputs.values())
        if port.array
    }
    ends = [((wire.source, a), (wire.target, b)) for wire in system.connections for a, b in [_arrays(system, wire)]]
    named = {name for name, source in definition.connections.items() if not isinstance(source, list)}
    apart = {end for pair in ends if ".".join(pair[1]) not in named for end in pair}
    # What one connection takes apart is so at the other ends of its other connections too.
    while more := {end for pair in ends if apart & set(pair) for end in pair} - apart:
        apart |= more
    return arrays - apart


def _arrays(system: System, wire: Connection) -> tuple[str, str]:
    """Return the arrays that an output and an input are elements of, or nothing."""
    return system.slaves[wire.source].outputs[wire.output].array, system.slaves[wire.target].inputs[wire.input].array


def _connectors(
    slave: str, ports: Mapping[str, Port], whole_arrays: set[tuple[str, str]]
) -> Iterator[tuple[str, Port, Sequence[str]]]:
    """Yield connectors with their names, a port each, and the shapes of arrays."""
    last = {port.array: port for port in ports.values() if (slave, port.array) in whole_arrays}
    for port in ports.values():
        if port.array not in last:
            yield port.name, port, ()
        elif last[port.array] is port:
            yield port.array, port, _shape(port.name, port.array)


def _shape(last: str, array: str) -> Sequence[str]:
    """Return the shape of an array whose last element is called ``array[2,3]``."""
    return last[len(array) + 1 : -1].split(",")


def _add_dimensions(parent: Any, shape: Sequence[str]) -> None:
    for size in shape:
        _add(parent, SSC, "Dimension", size=size)


def _add_parameters(parent: Any, slave: Slave, name: str, value: Any, *, in_arrays: bool) -> None:
    scalars = list(_scalars(slave, {name: value}))
    kinds = {_type(v) for _, v in scalars}
    kinds = {"Real"} if kinds == {"Real", "Integer"} else kinds
    if not in_arrays or scalars[0][0] == name or len(kinds) > 1 or kinds & {"String", "Binary"}:
        for variable, one in scalars:
            _add(_add(parent, SSV, "Parameter", name=variable), SSV, _type(one), value=_text(one))
        return
    parameter = _add(parent, SSV, "Parameter", name=name)
    _add(parameter, SSV, kinds.pop(), value=" ".join(_text(one) for _, one in scalars))
    _add_dimensions(parameter, _shape(scalars[-1][0], name))


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

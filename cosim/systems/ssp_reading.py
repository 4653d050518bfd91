"""Systems in SSP files, versions 1.0 and 2.0: components that are FMUs, in systems and systems in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.errors import MisfitError
from cosim.measure import Measure
from cosim.sources import Linear, Source
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
from cosim.systems.ssp_units import REAL, Node, SspUnits, Unit, Wire, measure_of, told
from fmu.archives.checks import LIMITS
from fmu.archives.reading import Archive, ArchiveError
from fmu.importer.plain_xml import PlainXmlError, parse_plain
from fmu.importer.temporary_folders import temporary_folder

DESCRIPTION = "SystemStructure.ssd"
VERSIONS = ("1.0", "2.0")
_FMU_TYPES = (None, "application/x-fmu-sharedlibrary")
_IMPLEMENTATIONS = {None: None, "any": None, "CoSimulation": "cs", "ModelExchange": "me"}


def read_ssp(path: str | Path) -> SystemDefinition:
    """Read a system; its FMUs are unpacked to a temporary folder.

    Parameters of components and of the system, inline or in files, become start values.

    Raises
    ------
    MisfitError
        If the archive or its XML must not be read, a component is missing, or the system needs what is not supported:
        components that are no FMUs, signal dictionaries, transformations that are not linear.
    """
    folder = temporary_folder()
    try:
        with Archive(path, replace(LIMITS, description=DESCRIPTION)) as archive:
            archive.extract(folder)
    except (ArchiveError, OSError) as error:
        raise MisfitError(f"{path} cannot be read as an SSP: {error}") from error
    return read_ssd(folder / DESCRIPTION, str(path))


def read_ssd(path: Path, told: str | None = None) -> SystemDefinition:
    """Read the description of a system whose parts lie beside it; `told` is what messages call it."""
    told = told or str(path)
    return _Reading(path.parent, told).definition(path)


class _Reading:
    """Reads one system; names of elements without their namespaces, which both versions share."""

    def __init__(self, folder: Path, told: str) -> None:
        self._folder, self._told = folder.resolve(), told
        self._elements: dict[str, Any] = {}
        self._starts: dict[str, dict[str, Any]] = {}
        self._given: dict[Node, Any] = {}
        self._units: dict[Node, Unit] = {}
        self._as_they_are: set[Node] = set()
        self._into: dict[Node, tuple[Node, Wire]] = {}
        self._ssp_units = SspUnits(self._fmu, self._misfit)

    def definition(self, path: Path) -> SystemDefinition:
        root = self._parsed(path)
        version = root.get("version", "1.0")
        if version not in VERSIONS:
            raise self._misfit(f"it is of version {version}, and {' and '.join(VERSIONS)} are read")
        system = next(iter(_children(root, "System")), None)
        if system is None:
            raise self._misfit(f"{DESCRIPTION} has no System")
        self._read_system(system, "", self._declared(root))
        connections = self._connections()
        components = [self._component(name, element) for name, element in self._elements.items()]
        if not components:
            raise self._misfit("it has no components")
        experiment = next(iter(_children(root, "DefaultExperiment")), None)
        times = {} if experiment is None else {k: self._time(experiment, k) for k in ("startTime", "stopTime")}
        return SystemDefinition(
            system.get("name", path.stem),
            components,
            connections,
            None,
            Experiment(start_time=times.get("startTime"), stop_time=times.get("stopTime")),
        )

    def _read_system(self, system: Any, path: str, units: Mapping[str, Measure]) -> None:
        """Note the components, wires and parameters of a system and of those in it; `path` is its name with a point."""
        self._read_connectors(system, path, units)
        self._given |= {(path, name): value for name, value in self._parameters(system, path, units).items()}
        paths = {None: path}
        for element in next(iter(_children(system, "Elements")), ()):
            name, kind = f"{path}{element.get('name')}", _local(element)
            paths[element.get("name")] = f"{name}." if kind == "System" else name
            if kind in ("System", "Component") and not element.get("name"):
                raise self._misfit(f"it has a {kind} without a name")
            if name in self._elements:
                raise self._misfit(f"two of its components are called {name}")
            if kind == "System":
                self._read_system(element, f"{name}.", units)
            elif kind == "Component":
                self._read_connectors(element, name, units)
                self._elements[name], self._starts[name] = element, self._parameters(element, name, units)
            elif kind not in ("Annotations", ""):
                raise self._misfit(f"it has a {kind} {name!r}, and components and systems alone are supported")
        for wire in _children_of(next(iter(_children(system, "Connections")), ()), "Connection"):
            for name in (wire.get("startElement"), wire.get("endElement")):
                if name not in paths:
                    raise self._misfit(f"a connection names {name!r}, which is no component")
            source = paths[wire.get("startElement")], wire.get("startConnector")
            target = paths[wire.get("endElement")], wire.get("endConnector")
            scale = self._scale(wire, f"its connection {told(source)} -> {told(target)}")
            if target in self._into:
                raise self._misfit(f"{told(target)} is connected twice")
            self._into[target] = source, Wire(target, *scale, converted=not _suppressed(wire))

    def _read_connectors(self, element: Any, place: str, units: Mapping[str, Measure]) -> None:
        for connector in _children_of(next(iter(_children(element, "Connectors")), ()), "Connector"):
            for typed in connector:
                if _local(typed) in REAL and typed.get("unit"):
                    unit = Unit(typed.get("unit"), units.get(typed.get("unit")))
                    self._ssp_units.say((place, connector.get("name")), unit)

    def _declared(self, root: Any) -> dict[str, Measure]:
        """Return what the units of a file are in SI units."""
        found = {}
        for unit in _children_of(next(iter(_children(root, "Units")), ()), "Unit"):
            for base in _children(unit, "BaseUnit"):
                try:
                    found[unit.get("name", "")] = measure_of(base.attrib)
                except ValueError as error:
                    raise self._misfit(f"its unit {unit.get('name')!r} is no unit: {error}") from error
        return found

    def _connections(self) -> dict[str, Source]:
        """Follow the wires from each input through the borders of systems to an output, or to a parameter."""
        connections: dict[str, Source] = {}
        for target in self._into:
            if target[0] not in self._elements:
                continue
            at, wires = target, list[Wire]()
            for _ in self._into:
                if at not in self._into:
                    break
                at, wire = self._into[at]
                wires.insert(0, wire)
            if at[0] in self._elements:
                connections[told(target)] = self._wired(at, wires)
            elif at in self._given and target[1] not in self._starts[target[0]]:
                line = self._ssp_units.along(at, wires, self._units.get(at))
                self._starts[target[0]][target[1]] = self._scaled(self._given[at], *line, at)
                self._as_they_are.add(target)
        return connections

    def _wired(self, start: Node, wires: list[Wire]) -> Source:
        """Return what drives an input: units are the matter of the slaves where no connector has one of its own."""
        converted, line = all(wire.converted for wire in wires), (1.0, 0.0)
        for wire in wires:
            line = wire.factor * line[0], wire.factor * line[1] + wire.offset
        if self._ssp_units.are_said([start, *(wire.target for wire in wires)]):
            converted, line = False, self._ssp_units.along(start, wires)
        return told(start) if converted and line == (1.0, 0.0) else Linear(told(start), *line, converted)

    def _scale(self, element: Any, told: str) -> tuple[float, float]:
        """Return factor and offset of an element with or without a transformation."""
        found = [child for child in element if _local(child).endswith("Transformation")]
        if not found:
            return 1.0, 0.0
        if _local(found[0]) != "LinearTransformation":
            raise self._misfit(f"{told} has a {_local(found[0])}, and linear ones alone are supported")
        factor, offset = (
            self._number(found[0].get(name, default), f"the {name} of {told}")
            for name, default in (("factor", "1"), ("offset", "0"))
        )
        return factor, offset

    def _component(self, name: str, element: Any) -> Component:
        kind = element.get("type")
        if kind not in _FMU_TYPES:
            raise self._misfit(f"its component {name} is of type {kind!r}, and FMUs alone are supported")
        implementation = element.get("implementation")
        if implementation not in _IMPLEMENTATIONS:
            raise self._misfit(f"its component {name} is for {implementation}, which no master runs")
        start = {variable: self._converted((name, variable), value) for variable, value in self._starts[name].items()}
        return Component(name, FMU, str(self._fmu(name)), start, {}, _IMPLEMENTATIONS[implementation])

    def _fmu(self, name: str) -> Path:
        return self._file(self._elements[name].get("source"), f"component {name}")

    def _converted(self, node: Node, value: Any) -> Any:
        """Return a start value in the unit of the FMU."""
        if node in self._as_they_are or not (node in self._units or self._ssp_units.are_said([node])):
            return value
        wire = Wire(node)
        return self._scaled(value, *self._ssp_units.along(("", ""), [wire], self._units.get(node)), node)

    def _parameters(self, element: Any, place: str, units: Mapping[str, Measure]) -> dict[str, Any]:
        """Return start values; `units` are those of the file, which sets of parameters in it may use too."""
        values: dict[str, Any] = {}
        for binding in _children_of(next(iter(_children(element, "ParameterBindings")), ()), "ParameterBinding"):
            prefix = binding.get("prefix", "")
            if binding.get("source") is not None:
                sets, around = [self._parsed(self._file(binding.get("source"), "parameters"))], {}
            else:
                around = dict(units)
                sets = [s for v in _children(binding, "ParameterValues") for s in _children(v, "ParameterSet")]
            found = {
                name: value for one in sets for name, value in self._set(one, around | self._declared(one)).items()
            }
            mapping = self._mapping(binding)
            for name, (value, unit) in found.items():
                same = prefix + name, 1.0, 0.0, True
                target, factor, offset, converted = mapping.get(prefix + name, same)
                values[target] = self._scaled(value, factor, offset, (place, target))
                if not converted:
                    self._as_they_are.add((place, target))
                elif unit is not None:
                    self._units[place, target] = unit
        return values

    def _set(self, root: Any, units: Mapping[str, Measure]) -> dict[str, tuple[str | list[str], Unit | None]]:
        """Return the values of a set of parameters as they are written, and their units."""
        values: dict[str, tuple[str | list[str], Unit | None]] = {}
        for parameter in _children_of(next(iter(_children(root, "Parameters")), ()), "Parameter"):
            is_array, name = bool(_children(parameter, "Dimension")), parameter.get("name", "")
            for typed in parameter:
                listed, unit = [element.get("value") for element in _children(typed, "Value")], typed.get("unit")
                if None in listed:
                    raise self._misfit(f"its parameter {name!r} has a Value that gives none")
                known = Unit(unit, units.get(unit)) if unit else None
                if listed:
                    values[name] = listed if is_array else listed[0], known
                elif typed.get("value") is not None:
                    values[name] = typed.get("value").split() if is_array else typed.get("value"), known
        return values

    def _mapping(self, binding: Any) -> dict[str, tuple[str, float, float, bool]]:
        found: dict[str, tuple[str, float, float, bool]] = {}
        for element in _children(binding, "ParameterMapping"):
            source = element.get("source")
            inner = _children(element, "ParameterMapping") or [element]
            for root in [self._parsed(self._file(source, "a mapping"))] if source is not None else inner:
                for entry in _children(root, "MappingEntry"):
                    told = f"the mapping of {entry.get('source')}"
                    if entry.get("target") is None:
                        raise self._misfit(f"{told} has no target")
                    scale = self._scale(entry, told)
                    found[entry.get("source")] = entry.get("target"), *scale, not _suppressed(entry)
        return found

    def _file(self, source: str | None, what: str) -> Path:
        path = (self._folder / (source or "")).resolve()
        if not path.is_relative_to(self._folder) or not path.is_file():
            raise self._misfit(f"{what} is said to be in {source!r}, which is no file in it")
        return path

    def _parsed(self, path: Path) -> Any:
        try:
            return parse_plain(path.read_bytes(), path.name)
        except (PlainXmlError, OSError) as error:
            raise self._misfit(str(error)) from error

    def _time(self, experiment: Any, name: str) -> float | None:
        text = experiment.get(name)
        return None if text is None else self._number(text, name)

    def _number(self, text: str, what: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise self._misfit(f"{what} is {text!r}, which is no number") from None
        if not math.isfinite(number):
            raise self._misfit(f"{what} is {text!r}, which is not finite")
        return number

    def _scaled(self, value: Any, factor: float, offset: float, node: Node) -> Any:
        if (factor, offset) == (1.0, 0.0):
            return value
        if isinstance(value, list):
            return [self._scaled(one, factor, offset, node) for one in value]
        return factor * self._number(value, told(node)) + offset

    def _misfit(self, why: str) -> MisfitError:
        return MisfitError(f"{self._told} cannot be run: {why}.")


def _suppressed(element: Any) -> bool:
    return element.get("suppressUnitConversion") in ("true", "1")


def _local(element: Any) -> str:
    return str(element.tag).rpartition("}")[2] if isinstance(element.tag, str) else ""


def _children(element: Any, name: str) -> list[Any]:
    return _children_of(element, name)


def _children_of(elements: Any, name: str) -> list[Any]:
    return [element for element in elements if _local(element) == name]

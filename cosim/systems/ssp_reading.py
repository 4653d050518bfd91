"""Systems in SSP files, versions 1.0 and 2.0: components that are FMUs, in systems and systems in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.errors import MisfitError
from cosim.sources import Linear, Source
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
from fmu.archives.checks import LIMITS
from fmu.archives.reading import Archive, ArchiveError
from fmu.importer.plain_xml import PlainXmlError, parse_plain
from fmu.importer.temporary_folders import temporary_folder

DESCRIPTION = "SystemStructure.ssd"
VERSIONS = ("1.0", "2.0")
Node = tuple[str, str]
"""A connector: of a component, by its path, or of a system, by its path with a point behind."""
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
        self._units: dict[Node, str] = {}
        self._into: dict[Node, tuple[Node, float, float]] = {}
        self._unconverted: set[Node] = set()

    def definition(self, path: Path) -> SystemDefinition:
        root = self._parsed(path)
        version = root.get("version", "1.0")
        if version not in VERSIONS:
            raise self._misfit(f"it is of version {version}, and {' and '.join(VERSIONS)} are read")
        system = next(iter(_children(root, "System")), None)
        if system is None:
            raise self._misfit(f"{DESCRIPTION} has no System")
        self._read_system(system, "")
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

    def _read_system(self, system: Any, path: str) -> None:
        """Note the components, wires and parameters of a system and of those in it; `path` is its name with a point."""
        self._given |= {(path, name): value for name, value in self._parameters(system, path).items()}
        paths = {None: path}
        for element in next(iter(_children(system, "Elements")), ()):
            name, kind = f"{path}{element.get('name')}", _local(element)
            paths[element.get("name")] = f"{name}." if kind == "System" else name
            if kind in ("System", "Component") and not element.get("name"):
                raise self._misfit(f"it has a {kind} without a name")
            if name in self._elements:
                raise self._misfit(f"two of its components are called {name}")
            if kind == "System":
                self._read_system(element, f"{name}.")
            elif kind == "Component":
                self._elements[name], self._starts[name] = element, self._parameters(element, name)
            elif kind not in ("Annotations", ""):
                raise self._misfit(f"it has a {kind} {name!r}, and components and systems alone are supported")
        for wire in _children_of(next(iter(_children(system, "Connections")), ()), "Connection"):
            for name in (wire.get("startElement"), wire.get("endElement")):
                if name not in paths:
                    raise self._misfit(f"a connection names {name!r}, which is no component")
            source = paths[wire.get("startElement")], wire.get("startConnector")
            target = paths[wire.get("endElement")], wire.get("endConnector")
            told = f"its connection {_told(source)} -> {_told(target)}"
            if _suppressed(wire):
                self._unconverted.add(target)
            if target in self._into:
                raise self._misfit(f"{_told(target)} is connected twice")
            self._into[target] = source, *self._scale(wire, told)

    def _connections(self) -> dict[str, Source]:
        """Follow the wires from each input through the borders of systems to an output, or to a parameter."""
        connections: dict[str, Source] = {}
        for target in self._into:
            if target[0] not in self._elements:
                continue
            at, factor, offset, converted = target, 1.0, 0.0, True
            for _ in self._into:
                if at not in self._into:
                    break
                converted = converted and at not in self._unconverted
                at, by, plus = self._into[at]
                factor, offset = factor * by, factor * plus + offset
            if at[0] in self._elements:
                plain = converted and (factor, offset) == (1.0, 0.0)
                connections[_told(target)] = _told(at) if plain else Linear(_told(at), factor, offset, converted)
            elif at in self._given:
                if target[1] not in self._starts[target[0]] and at in self._units and converted:
                    self._units[target] = self._units[at]
                self._starts[target[0]].setdefault(target[1], self._scaled(self._given[at], factor, offset, at))
        return connections

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
        source, kind = element.get("source"), element.get("type")
        if kind not in _FMU_TYPES:
            raise self._misfit(f"its component {name} is of type {kind!r}, and FMUs alone are supported")
        implementation = element.get("implementation")
        if implementation not in _IMPLEMENTATIONS:
            raise self._misfit(f"its component {name} is for {implementation}, which no master runs")
        file, start = self._file(source, f"component {name}"), self._starts[name]
        self._require_units(name, file)
        return Component(name, FMU, str(file), start, {}, _IMPLEMENTATIONS[implementation])

    def _require_units(self, name: str, file: Path) -> None:
        """Refuse parameters in other units than the FMU has them in, which are not converted."""
        told = {variable: unit for (place, variable), unit in self._units.items() if place == name}
        if not told:
            return
        # fmpy is imported by whoever reads a system, not by whoever asks for the versions there are.
        from fmu.importer.loading import read_description

        try:
            description = read_description(str(file), validate=False)
        except Exception:  # noqa: BLE001 - whatever fmpy raises, the slave says what is wrong
            return
        own = {v.name: v.unit or (v.declaredType.unit if v.declaredType else None) for v in description.modelVariables}
        for variable, unit in told.items():
            wanted = own.get(variable, own.get(variable.partition("[")[0]))
            if wanted and wanted != unit:
                told_in = f"its parameter {name}.{variable} is in {unit!r}, but the FMU has it in {wanted!r}"
                raise self._misfit(f"{told_in}, and parameters are not converted: give it in that unit")

    def _parameters(self, element: Any, place: str) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for binding in _children_of(next(iter(_children(element, "ParameterBindings")), ()), "ParameterBinding"):
            prefix = binding.get("prefix", "")
            if binding.get("source") is not None:
                found = self._set(self._parsed(self._file(binding.get("source"), "parameters")))
            else:
                inline = [s for v in _children(binding, "ParameterValues") for s in _children(v, "ParameterSet")]
                found = {name: value for one in inline for name, value in self._set(one).items()}
            mapping = self._mapping(binding)
            for name, (value, unit) in found.items():
                same = prefix + name, 1.0, 0.0, True
                target, factor, offset, converted = mapping.get(prefix + name, same)
                values[target] = self._scaled(value, factor, offset, (place, target))
                if unit is not None and converted:
                    self._units[place, target] = unit
        return values

    def _set(self, root: Any) -> dict[str, tuple[str | list[str], str | None]]:
        """Return the values of a set of parameters and their units, as they are written."""
        values: dict[str, tuple[str | list[str], str | None]] = {}
        for parameter in _children_of(next(iter(_children(root, "Parameters")), ()), "Parameter"):
            is_array, name = bool(_children(parameter, "Dimension")), parameter.get("name", "")
            for typed in parameter:
                listed = [element.get("value") for element in _children(typed, "Value")]
                if listed:
                    values[name] = listed if is_array else listed[0], typed.get("unit")
                elif typed.get("value") is not None:
                    values[name] = typed.get("value").split() if is_array else typed.get("value"), typed.get("unit")
        return values

    def _mapping(self, binding: Any) -> dict[str, tuple[str, float, float, bool]]:
        found: dict[str, tuple[str, float, float, bool]] = {}
        for element in _children(binding, "ParameterMapping"):
            source = element.get("source")
            inner = _children(element, "ParameterMapping") or [element]
            for root in [self._parsed(self._file(source, "a mapping"))] if source is not None else inner:
                for entry in _children(root, "MappingEntry"):
                    told = f"the mapping of {entry.get('source')}"
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
            return float(text)
        except ValueError:
            raise self._misfit(f"{what} is {text!r}, which is no number") from None

    def _scaled(self, value: Any, factor: float, offset: float, node: Node) -> Any:
        if (factor, offset) == (1.0, 0.0):
            return value
        if isinstance(value, list):
            return [self._scaled(one, factor, offset, node) for one in value]
        return factor * self._number(value, _told(node)) + offset

    def _misfit(self, why: str) -> MisfitError:
        return MisfitError(f"{self._told} cannot be run: {why}.")


def _told(node: Node) -> str:
    return f"{node[0]}.{node[1]}" if node[0] and not node[0].endswith(".") else f"{node[0]}{node[1]}"


def _suppressed(element: Any) -> bool:
    return element.get("suppressUnitConversion") in ("true", "1")


def _local(element: Any) -> str:
    return str(element.tag).rpartition("}")[2] if isinstance(element.tag, str) else ""


def _children(element: Any, name: str) -> list[Any]:
    return _children_of(element, name)


def _children_of(elements: Any, name: str) -> list[Any]:
    return [element for element in elements if _local(element) == name]

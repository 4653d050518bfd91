"""Systems in SSP files, versions 1.0 and 2.0: one level of components that are FMUs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.errors import MisfitError
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
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
        systems in systems, components that are no FMUs, signal dictionaries, transformations of signals.
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

    def definition(self, path: Path) -> SystemDefinition:
        root = self._parsed(path)
        version = root.get("version", "1.0")
        if version not in VERSIONS:
            raise self._misfit(f"it is of version {version}, and {' and '.join(VERSIONS)} are read")
        system = next(iter(_children(root, "System")), None)
        if system is None:
            raise self._misfit(f"{DESCRIPTION} has no System")
        elements = next(iter(_children(system, "Elements")), ())
        for element in elements:
            kind = _local(element)
            if kind not in ("Component", "Annotations", ""):
                raise self._misfit(f"it has a {kind} {element.get('name')!r}, and components alone are supported")
        starts = {c.get("name"): self._parameters(c) for c in _children_of(elements, "Component")}
        connections = self._connections(system, starts, self._parameters(system))
        components = [self._component(c, starts[c.get("name")]) for c in _children_of(elements, "Component")]
        if not components:
            raise self._misfit("it has no components")
        experiment = next(iter(_children(root, "DefaultExperiment")), None)
        times = {} if experiment is None else {k: _number(experiment.get(k)) for k in ("startTime", "stopTime")}
        return SystemDefinition(
            system.get("name", path.stem),
            components,
            connections,
            None,
            Experiment(start_time=times.get("startTime"), stop_time=times.get("stopTime")),
        )

    def _component(self, element: Any, start: dict[str, Any]) -> Component:
        name, source, kind = element.get("name"), element.get("source"), element.get("type")
        if kind not in _FMU_TYPES:
            raise self._misfit(f"its component {name} is of type {kind!r}, and FMUs alone are supported")
        implementation = element.get("implementation")
        if implementation not in _IMPLEMENTATIONS:
            raise self._misfit(f"its component {name} is for {implementation}, which no master runs")
        return Component(
            name, FMU, str(self._file(source, f"component {name}")), start, {}, _IMPLEMENTATIONS[implementation]
        )

    def _connections(self, system: Any, starts: dict[str, dict[str, Any]], given: dict[str, Any]) -> dict[str, str]:
        connections: dict[str, str] = {}
        for wire in _children_of(next(iter(_children(system, "Connections")), ()), "Connection"):
            start, end = wire.get("startElement"), wire.get("endElement")
            out, into = wire.get("startConnector"), wire.get("endConnector")
            if any(_local(child).endswith("Transformation") for child in wire):
                raise self._misfit(
                    f"its connection {start}.{out} -> {end}.{into} is transformed, which is not supported"
                )
            for name in (start, end):
                if name is not None and name not in starts:
                    raise self._misfit(f"a connection names {name!r}, which is no component")
            if start is not None and end is not None:
                if f"{end}.{into}" in connections:
                    raise self._misfit(f"{end}.{into} is connected twice")
                connections[f"{end}.{into}"] = f"{start}.{out}"
            elif end is not None and out in given:
                starts[end].setdefault(into, given[out])
        return connections

    def _parameters(self, element: Any) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for binding in _children_of(next(iter(_children(element, "ParameterBindings")), ()), "ParameterBinding"):
            prefix = binding.get("prefix", "")
            if binding.get("source") is not None:
                found = self._set(self._parsed(self._file(binding.get("source"), "parameters")))
            else:
                inline = [s for v in _children(binding, "ParameterValues") for s in _children(v, "ParameterSet")]
                found = {name: value for one in inline for name, value in self._set(one).items()}
            mapping = self._mapping(binding)
            for name, value in found.items():
                values[mapping.get(prefix + name, prefix + name)] = value
        return values

    def _set(self, root: Any) -> dict[str, str]:
        values = {}
        for parameter in _children_of(next(iter(_children(root, "Parameters")), ()), "Parameter"):
            typed = next((child for child in parameter if child.get("value") is not None), None)
            if typed is not None:
                values[parameter.get("name")] = typed.get("value")
        return values

    def _mapping(self, binding: Any) -> dict[str, str]:
        found: dict[str, str] = {}
        for element in _children(binding, "ParameterMapping"):
            source = element.get("source")
            inner = _children(element, "ParameterMapping") or [element]
            for root in [self._parsed(self._file(source, "a mapping"))] if source is not None else inner:
                for entry in _children(root, "MappingEntry"):
                    if len(entry):
                        raise self._misfit(f"the mapping of {entry.get('source')} is transformed: not supported")
                    found[entry.get("source")] = entry.get("target")
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

    def _misfit(self, why: str) -> MisfitError:
        return MisfitError(f"{self._told} cannot be run: {why}.")


def _local(element: Any) -> str:
    return str(element.tag).rpartition("}")[2] if isinstance(element.tag, str) else ""


def _children(element: Any, name: str) -> list[Any]:
    return _children_of(element, name)


def _children_of(elements: Any, name: str) -> list[Any]:
    return [element for element in elements if _local(element) == name]


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)

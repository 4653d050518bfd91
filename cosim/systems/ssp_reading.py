"""Systems in SSP files, versions 1.0 and 2.0: components that are FMUs, in systems and systems in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from cosim.errors import MisfitError
from cosim.measure import Measure
from cosim.sources import Linear, Source
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
from cosim.systems.ssp_elements import SspFile, children, is_suppressed, local, within
from cosim.systems.ssp_parameters import Given, parameters_of
from cosim.systems.ssp_units import REAL, Node, SspUnits, Unit, Wire, told
from fmu.archives.checks import LIMITS
from fmu.archives.reading import Archive, ArchiveError
from fmu.importer.temporary_folders import temporary_folder

DESCRIPTION = "SystemStructure.ssd"
VERSIONS = ("1.0", "2.0")
_FMU_TYPES = (None, "application/x-fmu-sharedlibrary")
_SSD_TYPE, _SSP_TYPE = "application/x-ssp-definition", "application/x-ssp-package"
_IMPLEMENTATIONS = {None: None, "any": None, "CoSimulation": "cs", "ModelExchange": "me"}
_TAKES, _GIVES = ("input", "parameter", "structuralParameter"), ("output", "calculatedParameter", "constant", "local")
"""Kinds of connectors of a component; seen from inside a system, its own are the other way round."""
_DEEPEST = 32
"""Most systems in systems, each of a file of its own."""
LIMITS_OF_SSP = replace(LIMITS, description=DESCRIPTION, kind="SSP", standard="SSP")


def read_ssp(path: str | Path) -> SystemDefinition:
    """Read a system; its FMUs are unpacked to a temporary folder.

    Parameters of components and of the system, inline or in files, become start values.

    Raises
    ------
    MisfitError
        If the archive or its XML must not be read, a component is missing, or the system needs what is not supported:
        components that are no FMUs and no systems, signal dictionaries, transformations that are not linear.
    """
    return read_ssd(_unpacked(path, str(path)) / DESCRIPTION, str(path))


def read_ssd(path: Path, told: str | None = None) -> SystemDefinition:
    """Read the description of a system whose parts lie beside it; `told` is what messages call it."""
    told = told or str(path)
    return _Reading(told).definition(path)


def _unpacked(path: str | Path, told: str) -> Path:
    folder = temporary_folder()
    try:
        with Archive(path, LIMITS_OF_SSP) as archive:
            archive.extract(folder)
    except (ArchiveError, OSError) as error:
        raise MisfitError(f"{told} cannot be read as an SSP: {error}") from error
    return folder


class _Reading:
    """Reads one system."""

    def __init__(self, told: str) -> None:
        self._told = told
        self._elements: dict[str, tuple[Any, SspFile]] = {}
        self._starts: dict[str, dict[str, Given]] = {}
        self._given: dict[Node, Given] = {}
        self._kinds: dict[Node, str] = {}
        self._into: dict[Node, tuple[Node, Wire]] = {}
        self._arrived: dict[Node, Any] = {}
        self._left_out: list[str] = []
        self._units = SspUnits(self._fmu, lambda why: SspFile(Path(), told).misfit(why))

    def definition(self, path: Path) -> SystemDefinition:
        file = SspFile(path.parent, self._told)
        root, system = self._system(path, file)
        self._read_system(system, "", file, file.units(root))
        connections = self._connections()
        components = [self._component(name) for name in self._elements]
        if not components:
            raise file.misfit("it has no components")
        return SystemDefinition(
            system.get("name", path.stem), components, connections, None, _experiment(root, file), self._left_out
        )

    def _system(self, path: Path, file: SspFile) -> tuple[Any, Any]:
        """Return the root of a file, and its system."""
        root = file.parsed(path)
        version = root.get("version", "1.0")
        if version not in VERSIONS:
            raise file.misfit(f"it is of version {version}, and {' and '.join(VERSIONS)} are read")
        system = next(iter(children(root, "System")), None)
        if system is None:
            raise file.misfit(f"{path.name} has no System")
        return root, system

    def _read_system(self, system: Any, path: str, file: SspFile, units: Mapping[str, Measure]) -> None:
        """Note the components, wires and parameters of a system and of those in it; `path` is its name with a point."""
        self._read_connectors(system, path, units)
        paths: dict[str | None, str] = {None: path}
        for element in next(iter(children(system, "Elements")), ()):
            name, kind = f"{path}{element.get('name')}", local(element)
            if kind in ("System", "Component") and not element.get("name"):
                raise file.misfit(f"it has a {kind} without a name")
            if kind in ("System", "Component") and element.get("name") in paths:
                raise file.misfit(f"two of its components are called {name}")
            is_system = kind == "System" or element.get("type") in (_SSD_TYPE, _SSP_TYPE)
            paths[element.get("name")] = f"{name}." if is_system else name
            if kind == "System":
                self._read_system(element, f"{name}.", file, units)
            elif kind == "Component" and is_system:
                self._read_referenced(element, name, file, units)
            elif kind == "Component":
                self._read_connectors(element, name, units)
                self._elements[name], self._starts[name] = (element, file), {}
                own = parameters_of(element, file, units)
                self._left_out += [f"{name}.{v}" for v, value in own.items() if not self._start(name, v, value)]
            elif kind not in ("Annotations", ""):
                raise file.misfit(f"it has a {kind} {name!r}, and components and systems alone are supported")
        self._read_wires(system, paths, file)
        # Behind those of what is inside, for what is further up counts (SSP 2.0, section 5.2.3).
        self._apply(parameters_of(system, file, units), path)

    def _read_referenced(self, element: Any, name: str, file: SspFile, units: Mapping[str, Measure]) -> None:
        """Read a component that is a system in a file of its own, as if it were there in its place (section 5.2.3)."""
        if name.count(".") >= _DEEPEST:
            raise file.misfit(f"its component {name} lies {_DEEPEST} systems deep: does one contain itself?")
        path = file.file(element.get("source"), f"component {name}")
        if element.get("type") == _SSP_TYPE:
            path = _unpacked(path, f"{self._told}, component {name},") / DESCRIPTION
        inner = SspFile(path.parent, f"{self._told}, component {name},")
        root, system = self._system(path, inner)
        self._read_system(system, f"{name}.", inner, inner.units(root))
        self._read_connectors(element, f"{name}.", units)
        self._apply(parameters_of(element, file, units), f"{name}.")

    def _apply(self, given: Mapping[str, Given], path: str) -> None:
        """Give values to what has their names below a system, with points; others are left out."""
        borders = {node for node in (*self._kinds, *(source for source, _ in self._into.values())) if _is_border(node)}
        for name, value in given.items():
            places = [place for place in self._starts if place.startswith(path)]
            found = [self._start(place, f"{path}{name}".removeprefix(f"{place}."), value) for place in places]
            for place, connector in borders:
                if place.startswith(path) and f"{path}{name}" == place + connector:
                    # It arrives where wires from the connector end.
                    self._given[place, connector] = value
                    found.append(True)
            if not any(found):
                self._left_out.append(f"{path}{name}")

    def _start(self, place: str, variable: str, value: Given) -> bool:
        """Give a value to a variable of a component, if it has it."""
        if not self._units.has(place, variable):
            return False
        self._starts[place][variable] = value
        return True

    def _read_connectors(self, element: Any, place: str, units: Mapping[str, Measure]) -> None:
        for connector in within(element, "Connectors", "Connector"):
            node = place, connector.get("name", "")
            self._kinds[node] = connector.get("kind", "")
            for typed in connector:
                if local(typed) in REAL and typed.get("unit"):
                    unit = Unit(typed.get("unit"), units.get(typed.get("unit")))
                    if (said := self._units.say(node, unit)) != unit:
                        raise SspFile(Path(), self._told).misfit(
                            f"{told(node)} is in {said.name!r} in the file of its system, and in {unit.name!r} where "
                            "that is used: give it one unit"
                        )

    def _read_wires(self, system: Any, paths: Mapping[str | None, str], file: SspFile) -> None:
        for wire in within(system, "Connections", "Connection"):
            ends = []
            for end in ("start", "end"):
                name, indices = wire.get(f"{end}Element"), (wire.get(f"{end}Indices") or "").split()
                if name not in paths:
                    raise file.misfit(f"a connection names {name!r}, which is no component")
                if not wire.get(f"{end}Connector"):
                    raise file.misfit(f"a connection of {name or 'the system'} has no {end}Connector")
                element = f"[{','.join(indices)}]" if indices else ""
                node: Node = paths[name], f"{wire.get(f'{end}Connector')}{element}"
                if indices and _is_border(node):
                    raise file.misfit(
                        f"a connection takes {told(node)} at the border of a system apart: name all of it"
                    )
                ends.append((node, name is None))
            source, target = self._directed(ends, file)
            between = f"its connection {told(source)} -> {told(target)}"
            if target in self._into:
                raise file.misfit(f"{told(target)} is connected twice")
            made = Wire(
                target,
                *file.scale(wire, between),
                converted=not is_suppressed(wire),
                leaves=(target, True) in ends,
            )
            self._into[target] = source, made

    def _directed(self, ends: list[tuple[Node, bool]], file: SspFile) -> tuple[Node, Node]:
        """Return where a signal comes from and where it goes, which kinds of connectors say, and not start and end."""
        (start, _), (end, _) = ends
        takes = [self._takes(*one) for one in ends]
        if takes[0] is takes[1] is not None:
            both = "take a value" if takes[0] else "give one"
            raise file.misfit(f"a connection joins {told(start)} and {told(end)}, which both {both}")
        return (end, start) if takes[0] or takes[1] is False else (start, end)

    def _takes(self, node: Node, is_own: bool) -> bool | None:
        """Return whether a connector takes a value; None if it does not say. A system's own is seen from inside."""
        kind = self._kinds.get(node) or self._kinds.get((node[0], node[1].partition("[")[0]))
        if kind not in (*_TAKES, *_GIVES):
            return None
        return (kind in _TAKES) != is_own

    def _connections(self) -> dict[str, Source]:
        """Follow the wires from each input through the borders of systems to an output, or to a parameter."""
        connections: dict[str, Source] = {}
        for target in self._into:
            if _is_border(target):
                continue
            at, wires = target, list[Wire]()
            for _ in self._into:
                if at not in self._into:
                    break
                at, wire = self._into[at]
                wires.insert(0, wire)
            if not _is_border(at):
                connections[told(target)] = self._wired(at, wires)
            elif at in self._given:
                self._arrived[target] = self._arriving(self._given[at], at, wires)
        return connections

    def _wired(self, start: Node, wires: list[Wire]) -> Source:
        """Return what drives an input: units are the matter of the slaves where no connector has one of its own."""
        line = 1.0, 0.0
        for wire in wires:
            line = wire.factor * line[0], wire.factor * line[1] + wire.offset
        converted = all(wire.converted for wire in wires)
        # On the way out of systems a signal keeps its unit, so there it is converted behind transformations.
        plain = converted and all((w.factor, w.offset) == (1.0, 0.0) for w in takewhile(lambda w: w.leaves, wires))
        as_it_is = not any(wire.converted for wire in wires)
        if self._units.are_said([start, *(wire.target for wire in wires)]) or not (plain or as_it_is):
            converted, line = False, self._units.along(start, wires)
        return told(start) if converted and line == (1.0, 0.0) else Linear(told(start), *line, converted)

    def _component(self, name: str) -> Component:
        element, file = self._elements[name]
        kind = element.get("type")
        if kind not in _FMU_TYPES:
            raise file.misfit(f"its component {name} is of type {kind!r}, and FMUs and systems alone are supported")
        implementation = element.get("implementation")
        if implementation not in _IMPLEMENTATIONS:
            raise file.misfit(f"its component {name} is for {implementation}, which no master runs")
        start = {v: self._arriving(given, (name, v), []) for v, given in self._starts[name].items()}
        start |= {variable: value for (place, variable), value in self._arrived.items() if place == name}
        return Component(name, FMU, str(self._fmu(name)), start, {}, _IMPLEMENTATIONS[implementation])

    def _fmu(self, name: str) -> Path:
        element, file = self._elements[name]
        return file.file(element.get("source"), f"component {name}")

    def _arriving(self, given: Given, at: Node, wires: list[Wire]) -> Any:
        """Return a start value that is given to a connector, in the unit of the FMU where it arrives."""
        wires = [Wire(at, given.factor, given.offset, given.converted), *wires]
        line = self._units.along(("", ""), wires, given.unit)
        return self._scaled(given.value, *line, at)

    def _scaled(self, value: Any, factor: float, offset: float, node: Node) -> Any:
        if (factor, offset) == (1.0, 0.0):
            return value
        if isinstance(value, list):
            return [self._scaled(one, factor, offset, node) for one in value]
        return factor * SspFile(Path(), self._told).number(value, told(node)) + offset


def _experiment(root: Any, file: SspFile) -> Experiment:
    told = next(iter(children(root, "DefaultExperiment")), None)
    if told is None:
        return Experiment()
    start, stop = (
        None if told.get(name) is None else file.number(told.get(name), name) for name in ("startTime", "stopTime")
    )
    if stop is not None and not stop > (start or 0.0):
        raise file.misfit(
            f"the stopTime of its DefaultExperiment is {stop:g}, and the run starts at {start or 0.0:g} s: give a stop "
            "after the start"
        )
    return Experiment(start_time=start, stop_time=stop)


def _is_border(node: Node) -> bool:
    """Return whether a connector is that of a system."""
    return not node[0] or node[0].endswith(".")

"""Units in an SSP file: those of connectors and of values, beside those that FMUs say of their variables.

A connector's unit is that of the signal there (SSP 2.0, sections 4.4.3.1 and 5.3): where the FMU has its variable in
another one, the signal is converted at the border of the component, whatever its connection suppresses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.errors import MisfitError
from cosim.measure import Measure
from fmu.standard.units import BASE_UNITS

if TYPE_CHECKING:
    from cosim.instances.variables import FmuVariables

Node = tuple[str, str]
"""A connector: of a component, by its path, or of a system, by its path with a point behind."""
REAL = ("Real", "Float64", "Float32")
"""Types that have units."""


@dataclass(frozen=True)
class Unit:
    """A unit by its name, with what it is in SI units where the file or the FMU says it."""

    name: str
    measure: Measure | None = None


@dataclass(frozen=True)
class Wire:
    """A connection on the way of a signal.

    Attributes
    ----------
    target : tuple of str
        Where it ends.
    factor, offset : float
        Of the transformation on it.
    converted : bool
        Whether units are converted.
    leaves : bool
        Whether it ends at the border of the system that it is in, and so leads out of it.
    """

    target: Node
    factor: float = 1.0
    offset: float = 0.0
    converted: bool = True
    leaves: bool = False


class SspUnits:
    """The units of one system.

    Parameters
    ----------
    file_of : callable
        Gives the FMU of a component by its path.
    misfit : callable
        Makes an error of what is wrong.
    """

    def __init__(self, file_of: Callable[[str], Path], misfit: Callable[[str], MisfitError]) -> None:
        self._file_of, self._misfit = file_of, misfit
        self._said: dict[Node, Unit] = {}
        self._known: dict[str, FmuVariables | None] = {}
        self._variables: dict[str, dict[str, tuple[Unit, bool]]] = {}

    def say(self, node: Node, unit: Unit) -> Unit:
        """Note the unit of a connector, if there is none yet; return the one that it has."""
        return self._said.setdefault(node, unit)

    def are_said(self, nodes: Iterable[Node]) -> bool:
        """Return whether one of these connectors has a unit."""
        return any(self._said_of(node) is not None for node in nodes)

    def along(self, start: Node, wires: Sequence[Wire], given: Unit | None = None) -> tuple[float, float]:
        """Return factor and offset from a variable of an FMU, or a value of the unit `given`, along wires to another.

        Units are converted before the transformation of a wire, which works in the unit of its end (SSP 1.0 and 2.0,
        section 4.5.2.1 of LinearTransformation, and 7.1.1 of entries of mappings).

        Raises
        ------
        MisfitError
            If there is no conversion.
        """
        own, said = self._own(start) or given, self._said_of(start)
        line = self._converted(start, own, said, (1.0, 0.0))
        at, unit = start, said or own
        for k, wire in enumerate(wires):
            at, wanted = wire.target, self._unit_behind(wires[k:])
            if wire.converted:
                line = self._converted(at, unit, wanted, line)
            line = _then(line, (wire.factor, wire.offset))
            unit = wanted or unit
        return self._converted(at, unit, self._own(at), line)

    def _unit_behind(self, wires: Sequence[Wire]) -> Unit | None:
        """Return the unit where the first of some wires ends.

        A connector of a system that says none has that of what it is connected to inside (SSP 2.0, section 4.5.1.1).
        """
        for k, wire in enumerate(wires):
            if k and not wire.converted:
                return None
            unit = self._said_of(wire.target) or self._own(wire.target)
            if unit is not None or wire.leaves:
                return unit
        return None

    def has(self, place: str, name: str) -> bool:
        """Return whether a component has a variable, an array or an element of that name, as far as is known."""
        variables = self._described(place)
        if variables is None:
            return True
        array = name.partition("[")[0]
        # Arrays may have other sizes when a structural parameter is set.
        return any(own in (name, array) or own.startswith((f"{name}[", f"{array}[")) for own in variables.places)

    def _described(self, place: str) -> FmuVariables | None:
        """Return what the FMU of a component says of its variables; None if it cannot be read: the slave says so."""
        # fmpy is imported by whoever reads a system, not by whoever asks for the versions there are.
        from cosim.instances.variables import FmuVariables
        from fmu.importer.loading import UNREADABLE, read_description

        if place not in self._known:
            try:
                description = read_description(str(self._file_of(place)), validate=False)
            except UNREADABLE:
                description = None
            self._known[place] = None if description is None else FmuVariables(description)
        return self._known[place]

    def _converted(
        self, node: Node, given: Unit | None, wanted: Unit | None, line: tuple[float, float]
    ) -> tuple[float, float]:
        """Return how a number arrives that is converted at a connector, after how it has come there."""
        if given is None or wanted is None or given == wanted:
            return line
        if given.measure is None or wanted.measure is None:
            if given.name == wanted.name:
                return line
            why = "both are not declared in SI base units"
        else:
            conversion = given.measure.converted_to(wanted.measure)
            if conversion is not None:
                return _then(line, conversion)
            why = "they measure differently"
        who = "the FMU has it" if wanted == self._own(node) else "its connector is"
        raise self._misfit(f"{told(node)} is given in {given.name!r}, but {who} in {wanted.name!r}, and {why}")

    def _said_of(self, node: Node) -> Unit | None:
        """Return the unit of a connector; of a difference it is one without offset."""
        place, name = node
        said = self._said.get(node) or self._said.get((place, name.partition("[")[0]))
        if said is None or said.measure is None or not self._variable(node)[1]:
            return said
        return replace(said, measure=replace(said.measure, offset=0.0))

    def _own(self, node: Node) -> Unit | None:
        return self._variable(node)[0]

    def _variable(self, node: Node) -> tuple[Unit | None, bool]:
        """Return the unit that an FMU has a variable in, and whether that is a difference."""
        place, name = node
        if not place or place.endswith("."):
            return None, False
        if place not in self._variables:
            described = self._described(place)
            self._variables[place] = {} if described is None else _units(described)
        known = self._variables[place]
        return known.get(name) or known.get(name.partition("[")[0]) or _of_elements(known, name) or (None, False)


def told(node: Node) -> str:
    """Return what messages call a connector."""
    return f"{node[0]}.{node[1]}" if node[0] and not node[0].endswith(".") else f"{node[0]}{node[1]}"


def measure_of(base: Mapping[str, Any]) -> Measure:
    """Return what the attributes of a BaseUnit say.

    Raises
    ------
    ValueError
        If one is no number.
    """
    exponents = tuple(int(base.get(name) or 0) for name in BASE_UNITS)
    return Measure(exponents, float(base.get("factor") or 1.0), float(base.get("offset") or 0.0))


def _of_elements(known: Mapping[str, tuple[Unit, bool]], array: str) -> tuple[Unit, bool] | None:
    """Return the unit of an array that an FMU has as scalars, which FMI 2.0 asks for."""
    return next((unit for name, unit in known.items() if name.startswith(f"{array}[")), None)


def _then(line: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return other[0] * line[0], other[0] * line[1] + other[1]


def _units(variables: FmuVariables) -> dict[str, tuple[Unit, bool]]:
    return {name: (Unit(unit, measure), relative) for name, (unit, measure, relative) in variables.units().items()}

"""A model description of FMI 2.0 or 3.0 as one set of objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fmu.standard.capabilities import Capability


@dataclass(frozen=True)
class Variable:
    """One variable.

    Attributes
    ----------
    name : str
    reference : int
        Value reference.
    type : str
        Name of the element: ``Real`` ... in FMI 2, ``Float64`` ... in FMI 3.
    causality, variability : str
        With the standard's defaults put in.
    initial : str or None
        With the default put in; None where the standard has none.
    attributes : mapping of str to str
        As given; for FMI 2 those of the type's element as well.
    start : tuple of str or None
    dimensions : tuple of tuple
        ``("start", size)`` or ``("reference", value reference)``.
    aliases : tuple of str
    line : int
    """

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    attributes: Mapping[str, str]
    start: tuple[str, ...] | None
    dimensions: tuple[tuple[str, int], ...] = ()
    aliases: tuple[str, ...] = ()
    line: int = 0

    @property
    def clocks(self) -> tuple[int, ...]:
        """Value references of the clocks of a clocked variable."""
        return tuple(int(item) for item in self.attributes.get("clocks", "").split())

    @property
    def derivative(self) -> int | None:
        """What the attribute ``derivative`` refers to."""
        return int(self.attributes["derivative"]) if "derivative" in self.attributes else None

    @property
    def previous(self) -> int | None:
        """What the attribute ``previous`` refers to."""
        return int(self.attributes["previous"]) if "previous" in self.attributes else None


@dataclass(frozen=True)
class Unknown:
    """One entry of the model structure; it refers by indices in FMI 2, by value references in FMI 3."""

    reference: int
    dependencies: tuple[int, ...] | None
    kinds: tuple[str, ...] | None
    line: int


@dataclass(frozen=True)
class Unit:
    """One unit; `base` and `displays` are the attributes of its BaseUnit (none, if there is none) and DisplayUnits."""

    name: str
    base: Mapping[str, str]
    displays: tuple[Mapping[str, str], ...]
    line: int


@dataclass(frozen=True)
class Description:
    """A model description.

    Attributes
    ----------
    version : str
        ``fmiVersion``.
    major : int
    token : str
    naming : str
        ``flat`` or ``structured``.
    interfaces : mapping of str to (mapping of str to str)
        Attributes of each interface type.
    experiment : mapping of str to str
        Attributes of DefaultExperiment.
    variables : tuple of Variable
    structure : mapping of str to (tuple of Unknown)
        By ``outputs``, ``derivatives``, ``initial``, ``clocked``, ``indicators``.
    types : mapping of str to (str, mapping)
        Kind and attributes of each type definition.
    items : mapping of str to (tuple of int)
        Values of each enumeration type.
    source_files : mapping of str to (tuple of str)
        FMI 2: by interface type.
    number_of_indicators : int
        FMI 2: as declared; FMI 3: entries.
    units : tuple of Unit
    """

    version: str
    major: int
    token: str
    naming: str
    interfaces: Mapping[str, Mapping[str, str]]
    experiment: Mapping[str, str]
    variables: tuple[Variable, ...]
    structure: Mapping[str, tuple[Unknown, ...]]
    types: Mapping[str, tuple[str, Mapping[str, str]]]
    items: Mapping[str, tuple[int, ...]]
    source_files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    number_of_indicators: int = 0
    units: tuple[Unit, ...] = ()

    def referred(self, reference: int) -> Variable | None:
        """Return the variable that the structure or an attribute ``derivative`` refers to."""
        if self.major == 2:
            return self.variables[reference - 1] if 1 <= reference <= len(self.variables) else None
        return self.by_reference.get(reference)

    @property
    def by_reference(self) -> dict[int, Variable]:
        """First variable of each value reference."""
        if "_by_reference" not in self.__dict__:
            table: dict[int, Variable] = {}
            for variable in self.variables:
                table.setdefault(variable.reference, variable)
            object.__setattr__(self, "_by_reference", table)
        found: dict[int, Variable] = self.__dict__["_by_reference"]
        return found

    def size(self, variable: Variable) -> int | None:
        """Return the number of elements at the start, or None if a dimension refers to nothing."""
        size = 1
        for kind, number in variable.dimensions:
            if kind == "start":
                size *= number
                continue
            length = self.by_reference.get(number)
            if length is None or length.start is None or not length.start or not length.start[0].isdigit():
                return None
            size *= int(length.start[0])
        return size

    def can(self, kind: str, capability: Capability) -> bool:
        """Return whether an interface type claims a capability."""
        return capability.claimed(self.interfaces[kind], self.major)

    def attribute(self, variable: Variable, name: str) -> str | None:
        """Return an attribute of a variable, or else of its declared type."""
        if name in variable.attributes:
            return variable.attributes[name]
        declared = self.types.get(variable.attributes.get("declaredType", ""))
        return declared[1].get(name) if declared else None

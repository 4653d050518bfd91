"""A model description of FMI 2.0 or 3.0 as one set of objects; read from a tree that fits the schema."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lxml import etree

from fmu.standard.capabilities import Capability
from fmu.standard.value_types import FLOATS

KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")


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


def read_description(root: etree._Element) -> Description:
    """Read a model description.

    Parameters
    ----------
    root : lxml element
        The root of a description that fits the schema of FMI 2.0 or 3.0.

    Returns
    -------
    Description
    """
    version = str(root.get("fmiVersion"))
    major = int(version.partition(".")[0])
    interfaces = {kind: dict(element.attrib) for kind in KINDS if (element := root.find(kind)) is not None}
    sources = {
        kind: tuple(str(file.get("name")) for file in element.iterfind("SourceFiles/File"))
        for kind in KINDS
        if (element := root.find(kind)) is not None
    }
    experiment = root.find("DefaultExperiment")
    types, items = _types(root, major)
    structure = _structure(root, major)
    listed = root.find("ModelVariables")
    read = _variable2 if major == 2 else _variable3
    variables = () if listed is None else tuple(read(element) for element in listed.iterchildren())
    return Description(
        version=version,
        major=major,
        token=str(root.get("guid" if major == 2 else "instantiationToken", "")),
        naming=root.get("variableNamingConvention", "flat"),
        interfaces=interfaces,
        experiment={} if experiment is None else dict(experiment.attrib),
        variables=variables,
        structure=structure,
        types=types,
        items=items,
        source_files=sources,
        number_of_indicators=int(root.get("numberOfEventIndicators", 0))
        if major == 2
        else len(structure["indicators"]),
        units=tuple(_unit(element) for element in root.iterfind("UnitDefinitions/Unit")),
    )


def _unit(element: etree._Element) -> Unit:
    base = element.find("BaseUnit")
    return Unit(
        name=str(element.get("name")),
        base={} if base is None else dict(base.attrib),
        displays=tuple(dict(display.attrib) for display in element.iterfind("DisplayUnit")),
        line=element.sourceline or 0,
    )


def _variable2(element: etree._Element) -> Variable:
    typed = next(child for child in element.iterchildren() if child.tag != "Annotations")
    attributes = {**dict(typed.attrib), **dict(element.attrib)}
    causality = attributes.get("causality", "local")
    variability = attributes.get("variability", "continuous")
    return Variable(
        name=attributes["name"],
        reference=int(attributes["valueReference"]),
        type=str(typed.tag),
        causality=causality,
        variability=variability,
        initial=attributes.get("initial") or _default_initial(causality, variability),
        attributes=attributes,
        start=(attributes["start"],) if "start" in attributes else None,
        line=element.sourceline or 0,
    )


def _variable3(element: etree._Element) -> Variable:
    attributes = dict(element.attrib)
    kind = str(element.tag)
    causality = attributes.get("causality", "local")
    parameter = causality in ("parameter", "calculatedParameter", "structuralParameter")
    usual = "fixed" if parameter else "continuous" if kind in FLOATS else "discrete"
    variability = attributes.get("variability", usual)
    start: tuple[str, ...] | None = None
    if kind in ("String", "Binary"):
        given = [str(child.get("value", "")) for child in element.iterfind("Start")]
        start = tuple(given) if given else None
    elif "start" in attributes:
        start = tuple(attributes["start"].split())
    dimensions = [
        ("start", int(child.get("start")))
        if child.get("start") is not None
        else ("reference", int(child.get("valueReference", -1)))
        for child in element.iterfind("Dimension")
    ]
    return Variable(
        name=attributes["name"],
        reference=int(attributes["valueReference"]),
        type=kind,
        causality=causality,
        variability=variability,
        initial=None if kind == "Clock" else attributes.get("initial") or _default_initial(causality, variability),
        attributes=attributes,
        start=start,
        dimensions=tuple(dimensions),
        aliases=tuple(str(alias.get("name")) for alias in element.iterfind("Alias")),
        line=element.sourceline or 0,
    )


def _default_initial(causality: str, variability: str) -> str | None:
    if causality == "independent":
        return None
    if variability == "constant" or causality in ("parameter", "structuralParameter", "input"):
        return "exact"
    return "calculated"


def _types(
    root: etree._Element, major: int
) -> tuple[dict[str, tuple[str, Mapping[str, str]]], dict[str, tuple[int, ...]]]:
    types: dict[str, tuple[str, Mapping[str, str]]] = {}
    items: dict[str, tuple[int, ...]] = {}
    definitions = root.find("TypeDefinitions")
    for element in () if definitions is None else definitions.iterchildren():
        typed = next(element.iterchildren()) if major == 2 else element
        name = str(element.get("name"))
        kind = str(typed.tag).removesuffix("Type")
        types[name] = kind, dict(typed.attrib)
        if kind == "Enumeration":
            items[name] = tuple(int(item.get("value", 0)) for item in typed.iterfind("Item"))
    return types, items


_PATHS2 = {
    "outputs": "ModelStructure/Outputs/Unknown",
    "derivatives": "ModelStructure/Derivatives/Unknown",
    "initial": "ModelStructure/InitialUnknowns/Unknown",
}
_PATHS3 = {
    "outputs": "ModelStructure/Output",
    "derivatives": "ModelStructure/ContinuousStateDerivative",
    "initial": "ModelStructure/InitialUnknown",
    "clocked": "ModelStructure/ClockedState",
    "indicators": "ModelStructure/EventIndicator",
}


def _structure(root: etree._Element, major: int) -> dict[str, tuple[Unknown, ...]]:
    names = ("outputs", "derivatives", "initial", "clocked", "indicators")
    paths = _PATHS2 if major == 2 else _PATHS3
    identity = "index" if major == 2 else "valueReference"
    lists = {}
    for name in names:
        found = root.iterfind(paths[name]) if name in paths else ()
        lists[name] = tuple(_unknown(element, identity) for element in found)
    return lists


def _unknown(element: etree._Element, identity: str) -> Unknown:
    dependencies, kinds = element.get("dependencies"), element.get("dependenciesKind")
    return Unknown(
        reference=int(element.get(identity, -1)),
        dependencies=None if dependencies is None else tuple(int(item) for item in dependencies.split()),
        kinds=None if kinds is None else tuple(kinds.split()),
        line=element.sourceline or 0,
    )

"""Reads a model description of FMI 2.0 or 3.0 into one set of objects.

Nothing of it comes from the exporter's table of differences: one wrong word there would be wrong in both.
"""

from __future__ import annotations

from collections.abc import Mapping

from lxml import etree

from fmu.standard.value_types import FLOATS
from fmu.validate.reading.description import Description, Unit, Unknown, Variable

KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")


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

"""modelDescription.xml, after the FMI standard 3.0.2, section 2.4, and 2.0.5, section 2.2: one writer for both."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

from fmu.describe.description import TOLERANCE, Description, start_text, summary
from fmu.describe.dialects import DIALECTS, Dialect
from fmu.describe.model_structure import Unknown
from fmu.describe.quantities import display_attributes, quantity
from fmu.describe.variables import Bank, Fmi, FmiType, FmuVariable
from fmu.describe.xml_text import number, to_bytes, xml_text
from fmu.standard.capabilities import declared
from fmu.standard.units import base_unit
from hybrid_model import __version__

LOG_CATEGORIES = {
    "logStatusError": "refused calls, and why a run ended",
    "logEvents": "events: their time and the jumps taken",
}
_ELEMENTS = {"me": "ModelExchange", "cs": "CoSimulation"}
"""Of each kind of FMU, in the order of the schemas."""


def model_description(description: Description) -> bytes:
    """Return the model description of an FMU.

    Parameters
    ----------
    description : Description
        What is described, with the version of the standard.

    Returns
    -------
    bytes
        XML in UTF-8, valid by the version's schema.

    Raises
    ------
    ExportError
        If a variable's name cannot be written, or comes twice.
    """
    fmi, dialect = description.fmi, DIALECTS[description.fmi]
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": fmi.value,
            "modelName": xml_text(description.automaton.name),
            dialect.token: description.token,
            "description": xml_text(summary(description.automaton)),
            "generationTool": f"hybrid-fmu {__version__}",
            "variableNamingConvention": description.convention,
        },
    )
    if fmi is Fmi.V2_0 and "me" in description.kinds:
        root.set("numberOfEventIndicators", str(description.n_indicators))
    for kind, tag in _ELEMENTS.items():
        if kind in description.kinds:
            element = ET.SubElement(root, tag, {"modelIdentifier": description.identifier, **declared(fmi.major, kind)})
            if fmi is Fmi.V2_0:  # FMI 3.0 lists them in its build description
                _source_files(element, description.sources)
    _units(root, description)
    _types(root, description, dialect)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    _default_experiment(root, description)
    listed = ET.SubElement(root, "ModelVariables")
    for reference in range(len(description.variables)):
        _variable(listed, description, dialect, reference)
    _structure(ET.SubElement(root, "ModelStructure"), description, dialect)
    return to_bytes(root)


def _nested(parent: ET.Element, tags: Sequence[str]) -> ET.Element:
    """Add elements, one within the other, and return the inmost."""
    for tag in tags:
        parent = ET.SubElement(parent, tag)
    return parent


def _source_files(element: ET.Element, sources: Sequence[str]) -> None:
    if sources:
        files = ET.SubElement(element, "SourceFiles")
        for name in sources:
            ET.SubElement(files, "File", name=name)


def _units(root: ET.Element, description: Description) -> None:
    """Add the units in use, with base units where they are known."""
    if not description.units:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in description.units:
        element = ET.SubElement(definitions, "Unit", name=unit)
        known = base_unit(unit)
        if known is not None:
            ET.SubElement(element, "BaseUnit", known.attributes())
        measured = quantity(unit)
        for display in measured.displays if measured is not None else ():
            ET.SubElement(element, "DisplayUnit", display_attributes(unit, display))


def _types(root: ET.Element, description: Description, dialect: Dialect) -> None:
    if description.types:
        definitions = ET.SubElement(root, "TypeDefinitions")
        for unit, name in description.types.items():
            measured = quantity(unit)
            assert measured is not None
            outer, *inner = dialect.type_definition
            element = ET.SubElement(definitions, outer, name=name)
            _nested(element, inner).attrib.update(quantity=measured.name, unit=unit)


def _default_experiment(root: ET.Element, description: Description) -> None:
    """Add the experiment: start at zero, and what has been given."""
    experiment = {"startTime": "0"}
    if description.stop_time is not None:
        experiment["stopTime"] = number(description.stop_time)
    experiment["tolerance"] = number(TOLERANCE)
    if description.proposed_step is not None:
        experiment["stepSize"] = number(description.proposed_step)
    ET.SubElement(root, "DefaultExperiment", experiment)


def _variable(listed: ET.Element, description: Description, dialect: Dialect, reference: int) -> None:
    variable = description.variables[reference]
    general = {"name": description.names[reference], "valueReference": str(reference)}
    if variable.description:
        general["description"] = xml_text(variable.description)
    general |= {"causality": variable.causality, "variability": variable.variability}
    if variable.initial is not None:
        general["initial"] = variable.initial
    if dialect.scalar:
        listed, typed = ET.SubElement(listed, dialect.scalar, general), {}
    else:
        typed = general | _of_fmi3(description, variable)
    typed |= _measure(description, variable)
    if variable.start is not None:
        typed["start"] = start_text(variable)
    typed |= _range(variable)
    if variable.derivative_of is not None:
        typed["derivative"] = str(description.position[variable.derivative_of] + dialect.first)
    # FMI 2.0 has the attribute for Model Exchange alone.
    if description.is_reset(variable) and (description.fmi is Fmi.V3_0 or "me" in description.kinds):
        typed["reinit"] = "true"
    element = ET.SubElement(listed, dialect.tags[variable.type], typed)
    for axis, length in enumerate(variable.shape):
        named = variable.dimensions[axis : axis + 1]
        at = description.position.get(named[0]) if named else None
        ET.SubElement(element, "Dimension", {"start": str(length)} if at is None else {"valueReference": str(at)})


def _of_fmi3(description: Description, variable: FmuVariable) -> dict[str, str]:
    """Return the attributes of a variable that FMI 2.0 does not have."""
    if variable.type is FmiType.CLOCK:
        return {"intervalVariability": "countdown" if variable.bank is Bank.COUNTDOWN else "triggered"}
    # What evolves within a step is shown there, and continuous inputs are taken.
    shown = variable.variability == "continuous" and "cs" in description.kinds
    return {"intermediateUpdate": "true"} if shown else {}


def _measure(description: Description, variable: FmuVariable) -> dict[str, str]:
    """Return the attributes that say what a variable measures: its type or quantity, and its unit."""
    if variable.type is not FmiType.FLOAT64 or not variable.unit:
        return {}
    unit = xml_text(variable.unit)
    measured = quantity(unit)
    if unit in description.types:
        return {"declaredType": description.types[unit], "unit": unit}
    return ({"quantity": measured.name} if measured is not None else {}) | {"unit": unit}


def _range(variable: FmuVariable) -> dict[str, str]:
    """Return the attributes of a variable's range and size, in the order of the schemas."""
    found = {"min": variable.minimum, "max": variable.maximum}
    if variable.type is FmiType.FLOAT64:
        found["nominal"] = variable.nominal
    return {key: number(value) for key, value in found.items() if value is not None}


def _structure(structure: ET.Element, description: Description, dialect: Dialect) -> None:
    for name, tags in dialect.unknowns.items():
        unknowns: tuple[Unknown, ...] = getattr(description.structure, name)
        if name != "initial" and not dialect.tunable_knowns:
            unknowns = tuple(_without_tunable(description, unknown) for unknown in unknowns)
        parent = _nested(structure, tags[:-1]) if unknowns else structure
        for unknown in unknowns:
            attributes = {
                dialect.index: str(unknown.variable + dialect.first),
                "dependencies": " ".join(str(position + dialect.first) for position in unknown.dependencies),
            }
            if unknown.kinds:
                attributes["dependenciesKind"] = " ".join(unknown.kinds)
            ET.SubElement(parent, tags[-1], attributes)


def _without_tunable(description: Description, unknown: Unknown) -> Unknown:
    kept = [k for k, at in enumerate(unknown.dependencies) if not description.variables[at].tunable]
    kinds = unknown.kinds and tuple(unknown.kinds[k] for k in kept)
    return replace(unknown, dependencies=tuple(unknown.dependencies[k] for k in kept), kinds=kinds)

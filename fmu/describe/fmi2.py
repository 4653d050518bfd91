"""modelDescription.xml after the FMI standard 2.0.5, section 2.2 (and 3.3 and 4.3 for the capability flags)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

from fmu.describe.names import xml_text
from fmu.describe.parts import (
    Description,
    add_default_experiment,
    add_log_categories,
    add_units,
    generation_tool,
    listing,
    range_attributes,
    start_text,
    summary,
    to_bytes,
    unit_attributes,
)
from fmu.describe.quantities import quantity
from fmu.describe.structure import Unknown
from fmu.describe.variables import FmiType

TAGS = {FmiType.FLOAT64: "Real", FmiType.INT32: "Integer", FmiType.BOOLEAN: "Boolean"}
_COMMON_FLAGS = {
    # Instances are made by the C library's calloc: the importer's functions for memory are not called.
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "true",
}
FLAGS = {
    "me": ("ModelExchange", {"completedIntegratorStepNotNeeded": "false", **_COMMON_FLAGS}),
    "cs": (
        "CoSimulation",
        {"canHandleVariableCommunicationStepSize": "true", "maxOutputDerivativeOrder": "1", **_COMMON_FLAGS},
    ),
}
"""Element and capabilities of each kind of FMU, in the order of the schema."""


def fmi2_description(description: Description) -> bytes:
    """Return modelDescription.xml for FMI 2.0.

    Parameters
    ----------
    description : Description
        What is described.

    Returns
    -------
    bytes
        XML in UTF-8, valid by fmi2ModelDescription.xsd.

    Raises
    ------
    ExportError
        If a variable's name cannot be written, or comes twice.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=xml_text(description.automaton.name),
        guid=description.token,
        description=xml_text(summary(description.automaton)),
        generationTool=generation_tool(),
        variableNamingConvention=description.convention,
    )
    if "me" in description.kinds:
        root.set("numberOfEventIndicators", str(description.n_indicators))
    for kind, (tag, flags) in FLAGS.items():
        if kind in description.kinds:
            element = ET.SubElement(root, tag, {"modelIdentifier": description.identifier, **flags})
            _source_files(element, description.sources)
    add_units(root, description)
    _types(root, description)
    add_log_categories(root)
    add_default_experiment(root, description)
    listed = ET.SubElement(root, "ModelVariables")
    for reference in range(len(description.variables)):
        _variable(listed, description, reference)
    _structure(ET.SubElement(root, "ModelStructure"), description)
    return to_bytes(root)


def _source_files(element: ET.Element, sources: Sequence[str]) -> None:
    if sources:
        files = ET.SubElement(element, "SourceFiles")
        for name in sources:
            ET.SubElement(files, "File", name=name)


def _types(root: ET.Element, description: Description) -> None:
    if description.types:
        definitions = ET.SubElement(root, "TypeDefinitions")
        for unit, name in description.types.items():
            measured = quantity(unit)
            assert measured is not None
            simple = ET.SubElement(definitions, "SimpleType", name=name)
            ET.SubElement(simple, "Real", quantity=measured.name, unit=unit)


def _variable(listed: ET.Element, description: Description, reference: int) -> None:
    variable = description.variables[reference]
    attributes = {"name": description.names[reference], "valueReference": str(reference)}
    if variable.description:
        attributes["description"] = xml_text(variable.description)
    attributes |= {"causality": variable.causality, "variability": variable.variability}
    if variable.initial is not None:
        attributes["initial"] = variable.initial
    element = ET.SubElement(listed, "ScalarVariable", attributes)
    typed = unit_attributes(description, variable)
    if variable.start is not None:
        typed["start"] = start_text(variable)
    typed |= range_attributes(variable)
    if variable.derivative_of is not None:
        # Variables are counted from 1 here.
        typed["derivative"] = str(description.position[variable.derivative_of] + 1)
    if description.is_reset(variable) and "me" in description.kinds:
        typed["reinit"] = "true"
    ET.SubElement(element, TAGS[variable.type], typed)


def _structure(structure: ET.Element, description: Description) -> None:
    found = description.structure
    outputs, derivatives = (_running(description, unknowns) for unknowns in (found.outputs, found.derivatives))
    lists = {"Outputs": outputs, "Derivatives": derivatives, "InitialUnknowns": found.initial}
    for tag, unknowns in lists.items():
        if unknowns:
            element = ET.SubElement(structure, tag)
            for unknown in unknowns:
                _unknown(element, unknown)


def _running(description: Description, unknowns: Sequence[Unknown]) -> list[Unknown]:
    """Leave out the tunable parameters, which FMI 2.0 does not count among the knowns of a running FMU."""
    shown = []
    for unknown in unknowns:
        kept = [k for k, at in enumerate(unknown.dependencies) if not description.variables[at].tunable]
        kinds = unknown.kinds and tuple(unknown.kinds[k] for k in kept)
        shown.append(replace(unknown, dependencies=tuple(unknown.dependencies[k] for k in kept), kinds=kinds))
    return shown


def _unknown(element: ET.Element, unknown: Unknown) -> None:
    dependencies = listing(position + 1 for position in unknown.dependencies)
    attributes = {"index": str(unknown.variable + 1), "dependencies": dependencies}
    if unknown.kinds:
        attributes["dependenciesKind"] = " ".join(unknown.kinds)
    ET.SubElement(element, "Unknown", attributes)

"""modelDescription.xml after the FMI standard 3.0.2, section 2.4 (and 3.4 and 4.4 for the capability flags)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

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
from fmu.describe.variables import Bank, FmiType

TAGS = {
    FmiType.FLOAT64: "Float64",
    FmiType.INT32: "Int32",
    FmiType.UINT64: "UInt64",
    FmiType.BOOLEAN: "Boolean",
    FmiType.CLOCK: "Clock",
}
_COMMON_FLAGS = ("canGetAndSetFMUState", "canSerializeFMUState")
_DERIVATIVES = ("providesDirectionalDerivatives", "providesAdjointDerivatives")
FLAGS = {
    "me": ("ModelExchange", ("needsCompletedIntegratorStep", *_COMMON_FLAGS, *_DERIVATIVES)),
    "cs": (
        "CoSimulation",
        (
            *_COMMON_FLAGS,
            *_DERIVATIVES,
            "canHandleVariableCommunicationStepSize",
            "providesIntermediateUpdate",
            "mightReturnEarlyFromDoStep",
            "canReturnEarlyAfterIntermediateUpdate",
            "hasEventMode",
        ),
    ),
}
"""Element and capabilities of each kind of FMU, in the order of the schema."""


def fmi3_description(description: Description) -> bytes:
    """Return modelDescription.xml for FMI 3.0.

    Parameters
    ----------
    description : Description
        What is described.

    Returns
    -------
    bytes
        XML in UTF-8, valid by fmi3ModelDescription.xsd.

    Raises
    ------
    ExportError
        If a variable's name cannot be written, or comes twice.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=xml_text(description.automaton.name),
        instantiationToken=description.token,
        description=xml_text(summary(description.automaton)),
        generationTool=generation_tool(),
        variableNamingConvention=description.convention,
    )
    for kind, (tag, flags) in FLAGS.items():
        if kind in description.kinds:
            attributes = {"modelIdentifier": description.identifier} | dict.fromkeys(flags, "true")
            if kind == "cs":
                attributes["maxOutputDerivativeOrder"] = "1"
            ET.SubElement(root, tag, attributes)
    add_units(root, description)
    _types(root, description)
    add_log_categories(root)
    add_default_experiment(root, description)
    listed = ET.SubElement(root, "ModelVariables")
    for reference in range(len(description.variables)):
        _variable(listed, description, reference)
    _structure(ET.SubElement(root, "ModelStructure"), description)
    return to_bytes(root)


def _types(root: ET.Element, description: Description) -> None:
    if description.types:
        definitions = ET.SubElement(root, "TypeDefinitions")
        for unit, name in description.types.items():
            measured = quantity(unit)
            assert measured is not None
            ET.SubElement(definitions, "Float64Type", name=name, quantity=measured.name, unit=unit)


def _variable(listed: ET.Element, description: Description, reference: int) -> None:
    variable = description.variables[reference]
    attributes = {"name": description.names[reference], "valueReference": str(reference)}
    if variable.description:
        attributes["description"] = xml_text(variable.description)
    attributes |= {"causality": variable.causality, "variability": variable.variability}
    if variable.type is FmiType.CLOCK:
        attributes["intervalVariability"] = "countdown" if variable.bank is Bank.COUNTDOWN else "triggered"
    elif variable.variability == "continuous" and "cs" in description.kinds:
        # What evolves within a step is shown there, and continuous inputs are taken.
        attributes["intermediateUpdate"] = "true"
    if variable.initial is not None:
        attributes["initial"] = variable.initial
    attributes |= unit_attributes(description, variable)
    if variable.start is not None:
        attributes["start"] = start_text(variable)
    attributes |= range_attributes(variable)
    if variable.derivative_of is not None:
        attributes["derivative"] = str(description.position[variable.derivative_of])
    if description.is_reset(variable):
        attributes["reinit"] = "true"
    element = ET.SubElement(listed, TAGS[variable.type], attributes)
    for axis, length in enumerate(variable.shape):
        named = variable.dimensions[axis : axis + 1]
        at = description.position.get(named[0]) if named else None
        ET.SubElement(element, "Dimension", {"start": str(length)} if at is None else {"valueReference": str(at)})


def _structure(structure: ET.Element, description: Description) -> None:
    found = description.structure
    _unknowns(structure, "Output", found.outputs)
    _unknowns(structure, "ContinuousStateDerivative", found.derivatives)
    _unknowns(structure, "InitialUnknown", found.initial)
    _unknowns(structure, "EventIndicator", found.indicators)


def _unknowns(structure: ET.Element, tag: str, unknowns: Sequence[Unknown]) -> None:
    for unknown in unknowns:
        attributes = {"valueReference": str(unknown.variable), "dependencies": listing(unknown.dependencies)}
        if unknown.kinds:
            attributes["dependenciesKind"] = " ".join(unknown.kinds)
        ET.SubElement(structure, tag, attributes)

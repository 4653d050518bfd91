"""modelDescription.xml of an FMU, after the FMI standard 3.0, section 2.4."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from fmu.trace import Trace, depends_on
from fmu.variables import Bank, FmiType, FmuVariable
from hybrid_model import Automaton, Composition

_TAGS = {FmiType.FLOAT64: "Float64", FmiType.INT32: "Int32", FmiType.CLOCK: "Clock"}
_ARGUMENTS = {Bank.TIME: 0, Bank.STATE: 1, Bank.DISCRETE: 2, Bank.INPUT: 3, Bank.PARAMETER: 4}
"""Number of each bank among the arguments of the traced functions."""


def model_identifier(name: str) -> str:
    """Return `name` as a C identifier: what the FMU's binary is called."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name)
    return plain if plain and not plain[0].isdigit() else f"_{plain}"


def model_description(
    traced: Trace, variables: Sequence[FmuVariable], token: str, stop_time: float | None = None
) -> bytes:
    """Return the model description of an FMI 3.0 Co-Simulation FMU.

    Parameters
    ----------
    traced : Trace
        The automaton.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    stop_time : float, optional
        Default stop time in s.

    Returns
    -------
    bytes
        XML in UTF-8.
    """
    automaton = traced.automaton
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=automaton.name,
        instantiationToken=token,
        description=_first_line(automaton),
        generationTool=f"hybrid-fmu {version('hybrid-fmu')}",
        variableNamingConvention="structured",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model_identifier(automaton.name),
        canGetAndSetFMUState="true",
        canHandleVariableCommunicationStepSize="true",
        hasEventMode="true",
    )
    _units(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="logStatusError", description="refused calls, and why a run ended")
    if stop_time is not None:
        ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime=repr(float(stop_time)))
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _variable(listed, reference, variable)
    _structure(root, traced, variables)
    ET.indent(root)
    xml: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"


def _first_line(automaton: Automaton) -> str:
    if isinstance(automaton, Composition):
        return f"composed of {', '.join(automaton.parts)}"
    return (type(automaton).__doc__ or "").strip().partition("\n")[0]


def _units(root: ET.Element, variables: Sequence[FmuVariable]) -> None:
    units = sorted({variable.unit for variable in variables if variable.unit})
    if units:
        definitions = ET.SubElement(root, "UnitDefinitions")
        for unit in units:
            ET.SubElement(definitions, "Unit", name=unit)


def _variable(listed: ET.Element, reference: int, variable: FmuVariable) -> None:
    attributes = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
    attributes["variability"] = variable.variability
    if variable.type is FmiType.CLOCK:
        attributes["intervalVariability"] = "triggered"
    if variable.description:
        attributes["description"] = variable.description
    if variable.initial is not None:
        attributes["initial"] = variable.initial
    if variable.start is not None:
        attributes["start"] = _start(variable)
    if variable.unit and variable.type is FmiType.FLOAT64:
        attributes["unit"] = variable.unit
    ET.SubElement(listed, _TAGS[variable.type], attributes)


def _start(variable: FmuVariable) -> str:
    assert variable.start is not None
    return str(int(variable.start)) if variable.type is FmiType.INT32 else repr(float(variable.start))


def _structure(root: ET.Element, traced: Trace, variables: Sequence[FmuVariable]) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    for reference, variable in enumerate(variables):
        if variable.causality == "output":
            found = _output_dependencies(traced, variables, variable)
            _unknown(structure, "Output", reference, found)
    for reference, variable in enumerate(variables):
        if variable.calculated and variable.causality == "output":
            _unknown(structure, "InitialUnknown", reference, _initial_dependencies(traced, variables, variable))


def _unknown(structure: ET.Element, tag: str, reference: int, dependencies: Sequence[int]) -> None:
    references = " ".join(map(str, dependencies))
    ET.SubElement(structure, tag, valueReference=str(reference), dependencies=references)


def _output_dependencies(traced: Trace, variables: Sequence[FmuVariable], variable: FmuVariable) -> list[int]:
    """Inputs that an output depends on at an instant; the states are the FMU's own and no known variables."""
    if variable.bank is not Bank.OUTPUT:
        return []
    return [
        reference
        for reference, known in enumerate(variables)
        if known.bank is Bank.INPUT
        and depends_on(traced.outputs, 0, _ARGUMENTS[Bank.INPUT])[variable.index, known.index]
    ]


def _initial_dependencies(traced: Trace, variables: Sequence[FmuVariable], variable: FmuVariable) -> list[int]:
    """Variables with known start values that a computed start value depends on.

    A dependency through another computed state counts: outputs see the states after the start map.
    """
    chain = _initial_pattern(traced, variable)
    return [
        reference
        for reference, known in enumerate(variables)
        if known.bank in _ARGUMENTS and not known.calculated and chain[_ARGUMENTS[known.bank]][known.index]
    ]


def _initial_pattern(traced: Trace, variable: FmuVariable) -> list[np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    starts = {Bank.STATE: 0, Bank.DISCRETE: 1}
    if variable.bank in starts:
        result = starts[variable.bank]
        return [depends_on(traced.start, result, argument)[variable.index] for argument in range(5)]
    direct = [depends_on(traced.outputs, 0, argument)[variable.index] for argument in range(5)]
    total = [direct[0], direct[1] & False, direct[2] & False, direct[3], direct[4]]
    for bank, result in starts.items():
        for state in np.flatnonzero(direct[_ARGUMENTS[bank]]):
            for argument in range(5):
                total[argument] = total[argument] | depends_on(traced.start, result, argument)[state]
    return total

"""What the descriptions of FMI 2.0 and FMI 3.0 share: names, units, types, the experiment, and numbers as text."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

from fmu.archives.device_names import no_device
from fmu.describe.experiment import proposed_step
from fmu.describe.jumps import states_reset
from fmu.describe.names import variable_names, xml_text
from fmu.describe.quantities import display_attributes, quantity
from fmu.describe.structure import Structure, model_structure
from fmu.describe.units import base_unit
from fmu.describe.variables import Bank, FmiType, FmuVariable
from hybrid_model import Automaton, Composition
from hybrid_model.declare.transitions import Trigger

LOG_CATEGORIES = {
    "logStatusError": "refused calls, and why a run ended",
    "logEvents": "events: their time and the jumps taken",
}
TOLERANCE = 1e-10
"""Relative tolerance that the description proposes; what importers hand on to the FMU, or to their own solver."""


@dataclass(frozen=True)
class Description:
    """What both versions are written from.

    Attributes
    ----------
    traced : Trace
        The automaton and the patterns of its maps.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    kinds : collection of {"cs", "me"}
        Co-Simulation, Model Exchange.
    stop_time, step_size : float or None
        Of the default experiment, in s, where the author gives them.
    sources : sequence of str
        C files to compile, relative to ``sources/``; FMI 2.0 lists them in the description.
    """

    traced: Any
    variables: Sequence[FmuVariable]
    token: str
    kinds: Collection[str] = ("cs", "me")
    stop_time: float | None = None
    step_size: float | None = None
    sources: Sequence[str] = ()

    @property
    def automaton(self) -> Automaton:
        """The automaton described."""
        found: Automaton = self.traced.automaton
        return found

    @property
    def proposed_step(self) -> float | None:
        """Communication step in s that the default experiment proposes."""
        return self.step_size or proposed_step(self.automaton, self.stop_time)

    @property
    def identifier(self) -> str:
        """Name of the binary."""
        return model_identifier(self.automaton.name)

    @cached_property
    def names(self) -> list[str]:
        """Names of the variables as they stand in the description."""
        return self._naming[0]

    @property
    def convention(self) -> str:
        """Naming convention: structured or flat."""
        return self._naming[1]

    @cached_property
    def _naming(self) -> tuple[list[str], str]:
        return variable_names(self.automaton.name, [variable.name for variable in self.variables])

    @cached_property
    def structure(self) -> Structure:
        """The unknowns and their dependencies."""
        return model_structure(self.traced, self.variables)

    @cached_property
    def states_reset(self) -> frozenset[int]:
        """Elements of the state vector that a jump may change."""
        return states_reset(self.traced)

    @cached_property
    def position(self) -> dict[str, int]:
        """Positions of the variables by their names in the automaton."""
        return {variable.name: k for k, variable in enumerate(self.variables)}

    @cached_property
    def types(self) -> dict[str, str]:
        """Names of the type definitions by unit; none is the name of a variable.

        None where a unit for display has an offset: fmpy takes a value in that unit for a difference if the variable
        has a declared type, so 25 degC would become 25 K. The quantity stands at the variable there.
        """
        taken = set(self.names)
        found = {}
        for unit in self.units:
            known = quantity(unit)
            if known is not None and not any("offset" in display_attributes(unit, shown) for shown in known.displays):
                name = known.name
                while name in taken:
                    name += "Type"
                found[unit] = name
        return found

    @cached_property
    def units(self) -> list[str]:
        """Units in use, sorted."""
        return sorted({xml_text(v.unit) for v in self.variables if v.unit and v.type is FmiType.FLOAT64})

    @property
    def n_indicators(self) -> int:
        """Number of event indicators: a margin a jump on state, and that of the flow set."""
        margins = sum(info.trigger is Trigger.STATE for info in self.automaton.jumps)
        return margins + int(self.automaton.has_flow_set)

    def is_reset(self, variable: FmuVariable) -> bool:
        """Whether a jump may change a continuous state."""
        elements = range(variable.index, variable.index + variable.size)
        return variable.bank is Bank.STATE and any(element in self.states_reset for element in elements)


def model_identifier(name: str) -> str:
    """Return `name` as a C identifier: what the FMU's binary is called."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name)
    # Names of files end at 255 characters.
    return no_device(plain if plain and not plain[0].isdigit() else f"_{plain}")[:200]


def generation_tool() -> str:
    """Return what the attribute generationTool says."""
    return f"hybrid-fmu {version('hybrid-fmu')}"


def summary(automaton: Automaton) -> str:
    """Return the first paragraph of an automaton's docstring on one line; of a composition, what it is made of."""
    if isinstance(automaton, Composition) and type(automaton) is Composition:
        return f"composed of {', '.join(automaton.parts)}"
    return " ".join((type(automaton).__doc__ or "").strip().split("\n\n")[0].split())


def number(value: float) -> str:
    """Return a double as XML Schema writes it, without loss."""
    if math.isfinite(value):
        whole = abs(value) < 1e15 and value == int(value)
        return f"{value:.0f}" if whole else repr(float(value))
    return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"


def unit_attributes(description: Description, variable: FmuVariable) -> dict[str, str]:
    """Return the attributes that say what a variable measures: its type or quantity, and its unit."""
    if variable.type is not FmiType.FLOAT64 or not variable.unit:
        return {}
    unit = xml_text(variable.unit)
    measured = quantity(unit)
    if unit in description.types:
        return {"declaredType": description.types[unit], "unit": unit}
    return ({"quantity": measured.name} if measured is not None else {}) | {"unit": unit}


def start_text(variable: FmuVariable) -> str:
    """Return the start values of a variable that has some."""
    assert variable.start is not None
    if variable.type is FmiType.BOOLEAN:
        return " ".join("true" if value else "false" for value in variable.start)
    return " ".join(number(value) for value in variable.start)


def range_attributes(variable: FmuVariable) -> dict[str, str]:
    """Return the attributes of a variable's range and size, in the order of the schemas."""
    found = {"min": variable.minimum, "max": variable.maximum}
    if variable.type is FmiType.FLOAT64:
        found["nominal"] = variable.nominal
    return {key: number(value) for key, value in found.items() if value is not None}


def listing(numbers: Iterable[int]) -> str:
    """Return numbers joined by spaces."""
    return " ".join(map(str, numbers))


def add_units(root: ET.Element, description: Description) -> None:
    """Add UnitDefinitions: the units in use, with base units where they are known."""
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


def add_log_categories(root: ET.Element) -> None:
    """Add LogCategories."""
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)


def add_default_experiment(root: ET.Element, description: Description) -> None:
    """Add DefaultExperiment: start at zero, and what has been given."""
    experiment = {"startTime": "0"}
    if description.stop_time is not None:
        experiment["stopTime"] = number(description.stop_time)
    experiment["tolerance"] = number(TOLERANCE)
    if description.proposed_step is not None:
        experiment["stepSize"] = number(description.proposed_step)
    ET.SubElement(root, "DefaultExperiment", experiment)


def to_bytes(root: ET.Element) -> bytes:
    """Return an XML document in UTF-8, indented."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    # The declaration with double quotes, as every example of the standard has it.
    return (
        document.replace(b"<?xml version='1.0' encoding='utf-8'?>", b'<?xml version="1.0" encoding="UTF-8"?>') + b"\n"
    )

"""What is told of an FMU, in either version of the standard: its names, units, types, structure and experiment."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fmu.archives.checks import no_device
from fmu.describe.changed_by_jumps import states_reset
from fmu.describe.experiment import proposed_step
from fmu.describe.model_structure import Structure, model_structure
from fmu.describe.names import variable_names
from fmu.describe.quantities import display_attributes, quantity
from fmu.describe.variables import Bank, Fmi, FmiType, FmuVariable
from fmu.describe.xml_text import number, xml_text
from hybrid_model import Automaton, Composition
from hybrid_model.declare.transitions import Trigger

TOLERANCE = 1e-10
"""Relative tolerance that the description proposes; what importers hand on to the FMU, or to their own solver."""


@dataclass(frozen=True)
class Description:
    """What an FMU's files tell of it.

    Attributes
    ----------
    traced : Trace or NetworkTrace
        The automaton and the patterns of its maps.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    fmi : Fmi
        Version of the standard.
    kinds : collection of {"cs", "me"}
        Co-Simulation, Model Exchange.
    stop_time, step_size : float or None
        Of the default experiment, in s, where the author gives them.
    sources : sequence of str
        C files to compile, relative to ``sources/``; none if the archive has no sources.
    """

    traced: Any
    variables: Sequence[FmuVariable]
    token: str
    fmi: Fmi = Fmi.V3_0
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


def summary(automaton: Automaton) -> str:
    """Return the first paragraph of an automaton's docstring on one line; of a composition, what it is made of."""
    if isinstance(automaton, Composition) and type(automaton) is Composition:
        return f"composed of {', '.join(automaton.parts)}"
    return " ".join((type(automaton).__doc__ or "").strip().split("\n\n")[0].split())


def start_text(variable: FmuVariable) -> str:
    """Return the start values of a variable that has some."""
    assert variable.start is not None
    if variable.type is FmiType.BOOLEAN:
        return " ".join("true" if value else "false" for value in variable.start)
    return " ".join(number(value) for value in variable.start)

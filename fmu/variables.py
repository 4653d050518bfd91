"""The variables of an FMU: one scalar each, with the place in the engine's vectors that it shows."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fmu.errors import ExportError
from fmu.trace import Trace
from hybrid_model.layout import Place
from hybrid_model.variables import Kind, element_names


class Bank(enum.Enum):
    """The engine's vectors; the value is the name in fmu/runtime/model.h."""

    TIME = "BANK_TIME"
    STATE = "BANK_STATE"
    DISCRETE = "BANK_DISCRETE"
    INPUT = "BANK_INPUT"
    PARAMETER = "BANK_PARAMETER"
    OUTPUT = "BANK_OUTPUT"
    CLOCK = "BANK_CLOCK"


class FmiType(enum.Enum):
    """Types of variables; the value is the name in fmu/runtime/model.h."""

    FLOAT64 = "TYPE_FLOAT64"
    INT32 = "TYPE_INT32"
    CLOCK = "TYPE_CLOCK"


@dataclass(frozen=True)
class FmuVariable:
    """A scalar variable of an FMU; its value reference is its place in the table.

    Attributes
    ----------
    name, unit, description : str
        As declared; elements of arrays are counted from 1, ``w[2]``.
    type : FmiType
        Float64, Int32 or Clock.
    bank, index : Bank, int
        Vector of the engine and place in it.
    causality, variability, initial : str
        As in the FMI standard, section 2.4.7.
    start : float or None
        Start value, where one can be set.
    """

    name: str
    type: FmiType
    bank: Bank
    index: int
    causality: str
    variability: str
    initial: str | None
    start: float | None
    unit: str = ""
    description: str = ""

    @property
    def discrete(self) -> bool:
        """Whether it changes only at events."""
        return self.variability == "discrete"

    @property
    def calculated(self) -> bool:
        """Whether its start value is computed and cannot be set."""
        return self.initial == "calculated"


_BANKS = {
    Kind.STATE: Bank.STATE,
    Kind.DISCRETE: Bank.DISCRETE,
    Kind.INPUT: Bank.INPUT,
    Kind.PARAMETER: Bank.PARAMETER,
    Kind.OUTPUT: Bank.OUTPUT,
}


def fmu_variables(traced: Trace) -> tuple[FmuVariable, ...]:
    """List the variables of an FMU: time, parameters, inputs, outputs, states, clocks.

    Parameters
    ----------
    traced : Trace
        The automaton; its discrete states declared internal are not listed.

    Returns
    -------
    tuple of FmuVariable
        In the order of the value references, from 0.

    Raises
    ------
    ExportError
        If a name is taken twice.
    """
    table = [FmuVariable("time", FmiType.FLOAT64, Bank.TIME, 0, "independent", "continuous", None, None, "s", "time")]
    for kind in (Kind.PARAMETER, Kind.INPUT, Kind.OUTPUT, Kind.STATE, Kind.DISCRETE):
        for place in traced.layout.places[kind]:
            if not place.variable.internal:
                table += _elements(kind, place)
    for index, clock in enumerate(traced.automaton.clocks):
        table.append(
            FmuVariable(
                clock.name, FmiType.CLOCK, Bank.CLOCK, index, "output", "discrete", None, None, "", clock.description
            )
        )
    names = [variable.name for variable in table]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise ExportError(f"{traced.automaton.name} has two variables called {double!r} (time is one): rename one.")
    return tuple(table)


def _elements(kind: Kind, place: Place) -> list[FmuVariable]:
    variable = place.variable
    causality, variability, initial = _attributes(kind, place)
    starts = variable.start.ravel()
    return [
        FmuVariable(
            name,
            FmiType.INT32 if variable.integer else FmiType.FLOAT64,
            _BANKS[kind],
            place.at.start + k,
            causality,
            variability,
            initial,
            None if initial == "calculated" else float(starts[k]),
            variable.unit,
            variable.description,
        )
        for k, name in enumerate(element_names(variable))
    ]


def _attributes(kind: Kind, place: Place) -> tuple[str, str, str | None]:
    variable = place.variable
    if kind is Kind.PARAMETER:
        return "parameter", "fixed", "exact"
    if kind is Kind.INPUT:
        return "input", "discrete" if variable.discrete else "continuous", None
    if kind is Kind.OUTPUT:
        return "output", "discrete" if variable.discrete else "continuous", "calculated"
    causality = "output" if variable.output else "local"
    return (
        causality,
        "discrete" if kind is Kind.DISCRETE else "continuous",
        "calculated" if variable.computed else "exact",
    )

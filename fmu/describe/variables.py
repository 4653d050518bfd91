"""A variable of an FMU, with the place in the engine's vectors that it shows."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Fmi(enum.Enum):
    """Versions of the standard that FMUs are exported for."""

    V2_0 = "2.0"
    V3_0 = "3.0"

    @property
    def major(self) -> int:
        """First part of the version."""
        return int(self.value[0])


class Bank(enum.Enum):
    """What a variable shows; the value is the name in fmu/interface/description.h."""

    TIME = "BANK_TIME"
    STATE = "BANK_STATE"
    DISCRETE = "BANK_DISCRETE"
    INPUT = "BANK_INPUT"
    PARAMETER = "BANK_PARAMETER"
    OUTPUT = "BANK_OUTPUT"
    CLOCK = "BANK_CLOCK"
    DERIVATIVE = "BANK_DERIVATIVE"
    INDICATOR = "BANK_INDICATOR"
    SIZE = "BANK_SIZE"
    COUNTDOWN = "BANK_COUNTDOWN"
    OPTION = "BANK_OPTION"


class FmiType(enum.Enum):
    """Types of variables; the value is the name in fmu/interface/description.h."""

    FLOAT64 = "TYPE_FLOAT64"
    INT32 = "TYPE_INT32"
    UINT64 = "TYPE_UINT64"
    BOOLEAN = "TYPE_BOOLEAN"
    CLOCK = "TYPE_CLOCK"


STOP_AT_EVENTS = "stop_at_events"
"""Name of the FMI 2.0 parameter that makes fmi2DoStep end at an event with fmi2Discard."""


NEXT_EVENT = "next_event"
"""Name of the countdown clock that tells when the next event comes."""


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU; its value reference is its place in the table.

    Attributes
    ----------
    name, unit, description : str
        As declared; elements that are variables of their own are counted from 1, ``w[2]``.
    type : FmiType
        Type in the FMU.
    bank, index : Bank, int
        Vector of the engine and place of the first element in it; of a clock the jump that it ticks with.
    causality, variability, initial : str
        As in the FMI standard 3.0, section 2.4.7.
    start : tuple of float or None
        Start values of the elements, where one can be set.
    shape : tuple of int
        ``()`` for a scalar.
    dimensions : tuple of str
        Names of the structural parameters that give the shape, where there are any.
    derivative_of : str or None
        The state whose time derivative this is.
    minimum, maximum, nominal : float or None
        As declared.
    """

    name: str
    type: FmiType
    bank: Bank
    index: int
    causality: str
    variability: str
    initial: str | None = None
    start: tuple[float, ...] | None = None
    unit: str = ""
    description: str = ""
    shape: tuple[int, ...] = ()
    dimensions: tuple[str, ...] = ()
    derivative_of: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None

    @property
    def size(self) -> int:
        """Number of elements."""
        size = 1
        for length in self.shape:
            size *= length
        return size

    @property
    def discrete(self) -> bool:
        """Whether it changes only at events."""
        return self.variability == "discrete"

    @property
    def tunable(self) -> bool:
        """Whether it is a parameter that may be set between events."""
        return self.variability == "tunable"

    @property
    def calculated(self) -> bool:
        """Whether its start value is computed and cannot be set."""
        return self.initial == "calculated"

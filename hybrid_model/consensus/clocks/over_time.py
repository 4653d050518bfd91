"""What is given as a function of time: its period, domain, breakpoints; and checks of its numbers."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

__all__ = ["ALWAYS", "OverTime", "require", "require_phase"]

ALWAYS = (-math.inf, math.inf)
"""The domain of what is defined at all times."""


class OverTime(ABC):
    """What weights and switching have in common."""

    @property
    @abstractmethod
    def period(self) -> float | None:
        """A period [s]; 0.0 if nothing ever changes, None if there is none."""

    @property
    def domain(self) -> tuple[float, float]:
        """First and last time [s] that it is given for; outside its first or last value stays."""
        return ALWAYS

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which it may jump or have a kink."""
        return np.empty(0)

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """How often it changes up to the time `end` [s], each with the key of a scenario file that is to blame."""
        yield from ()


def require(name: str, value: float, is_valid: bool, rule: str) -> None:
    """Check a number; ValueError with its name, value and rule if it is not finite or not valid."""
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}; it must be a finite number.")
    if not is_valid:
        raise ValueError(f"{name} is {value}; it {rule}.")


def require_phase(phase: float) -> None:
    """Check a phase [rad]: with a very large one nothing is left of the time in ``rate*t - phase``."""
    require("phase", phase, abs(phase) <= 1e6, "must lie between -1e6 and 1e6")

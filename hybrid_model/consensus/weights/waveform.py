"""What every weight of an edge offers, whatever its shape: the interface that integrals, bounds and exact flows use."""

import math
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.carriers import Carrier

__all__ = ["ALWAYS", "Waveform", "require", "require_phase"]

ALWAYS = (-math.inf, math.inf)
"""The domain of a weight that is defined at all times."""


@runtime_checkable
class Waveform(Protocol):
    """A weight ``w(t) = amplitude(t)*carrier(t) >= 0`` whose amplitude is constant between breakpoints.

    On a piece on which all edges share one carrier, the weighted Laplacian is a constant matrix times a scalar, and the
    flow of the consensus dynamics is a matrix exponential of the carrier's integral (audit, section 7).
    """

    @property
    def carrier(self) -> Carrier:
        """The shape between breakpoints."""

    @property
    def period(self) -> float | None:
        """A period [s]; 0.0 for a constant, None if there is none."""

    @property
    def domain(self) -> tuple[float, float]:
        """First and last time [s] that the weight is given for; outside it holds its first or last value."""

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The factor of the carrier at `t` [s], in the shape of `t`."""

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`; at a breakpoint the value that begins there."""

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which the weight may jump or have a kink."""

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s]; the two broadcast against each other."""


def require(name: str, value: float, is_valid: bool, rule: str) -> None:
    """Check a number of a waveform; ValueError with its name, value and rule if it is not finite or not valid."""
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}; it must be a finite number.")
    if not is_valid:
        raise ValueError(f"{name} is {value}; it {rule}.")


def require_phase(phase: float) -> None:
    """Check a phase [rad]: with a very large one nothing is left of the time in ``rate*t - phase``."""
    require("phase", phase, abs(phase) <= 1e6, "must lie between -1e6 and 1e6")

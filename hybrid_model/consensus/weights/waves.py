"""Weights that follow a sine or a square wave, without the paper's combination of both."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.carriers import RippleCarrier, UnitCarrier
from hybrid_model.consensus.weights.gate import Gate
from hybrid_model.consensus.weights.waveform import ALWAYS, require, require_phase

__all__ = ["SineWeight", "SquareWeight"]


@dataclass(frozen=True)
class SineWeight:
    """The weight ``mean*(1 + depth*sin(rate*t - phase))``.

    Parameters
    ----------
    mean : float
        Mean weight, not negative.
    depth : float
        Share of the mean by which the weight swings, 0 to 1; with 1 it touches zero once a period.
    rate : float
        Angular rate [rad/s], positive.
    phase : float
        Phase [rad].

    Raises
    ------
    ValueError
        If a number is outside its range or not finite.
    """

    mean: float
    depth: float
    rate: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        require("mean", self.mean, self.mean >= 0, "must not be negative")
        require("depth", self.depth, 0 <= self.depth <= 1, "must lie between 0 and 1, else the weight is negative")
        require("rate", self.rate, self.rate > 0, "must be positive")
        require_phase(self.phase)

    @property
    def carrier(self) -> RippleCarrier:
        """The shape, of mean 1."""
        return RippleCarrier(self.depth, self.rate, self.phase)

    @property
    def period(self) -> float:
        """``2*pi/rate`` [s]; 0.0 if the weight is constant."""
        return 0.0 if self.mean * self.depth == 0 else 2 * math.pi / self.rate

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The mean, in the shape of `t` [s]."""
        return np.full(np.shape(t), float(self.mean))

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        return self.mean * self.carrier.value(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """None: an empty array."""
        return np.empty(0)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        return self.mean * self.carrier.integral(t0, t1)


@dataclass(frozen=True)
class SquareWeight:
    """A weight that alternates between two levels: `high` while ``square(gate_rate*t - phase, duty_percent)`` is +1.

    Parameters
    ----------
    high, low : float
        The levels, not negative.
    gate_rate : float
        Angular rate [rad/s], positive.
    duty_percent : float
        Share of each period during which the weight is high, 0 to 100 [%].
    phase : float
        Phase [rad].

    Raises
    ------
    ValueError
        If a number is outside its range or not finite.
    """

    high: float
    low: float
    gate_rate: float
    duty_percent: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        require("high", self.high, self.high >= 0, "must not be negative")
        require("low", self.low, self.low >= 0, "must not be negative")
        self.gate.check()

    @cached_property
    def gate(self) -> Gate:
        """When the weight is high."""
        return Gate(self.gate_rate, self.duty_percent, self.phase)

    @property
    def carrier(self) -> UnitCarrier:
        """The carrier 1."""
        return UnitCarrier()

    @property
    def period(self) -> float:
        """``2*pi/gate_rate`` [s]; 0.0 if the weight is constant."""
        is_constant = self.high == self.low or self.duty_percent in (0, 100)
        return 0.0 if is_constant else 2 * math.pi / self.gate_rate

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level at `t` [s], in the shape of `t`."""
        return np.asarray(np.where(self.gate.is_open(t) > 0, self.high, self.low))

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level at `t` [s], in the shape of `t`."""
        return self.amplitude(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Instants strictly between `t0` and `t1` [s], ascending, at which the level changes."""
        return self.gate.breakpoints(t0, t1)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        open_time = self.gate.integral(self.carrier, t0, t1)
        return self.low * self.carrier.integral(t0, t1) + (self.high - self.low) * open_time

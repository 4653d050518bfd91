"""Weights of edges as functions of time: value, breakpoints, exact integral, period.

A weight is a piecewise-constant amplitude times a carrier, ``w(t) = amplitude(t)*carrier(t)``. Edges whose carriers are
equal share one shape; on such a piece the weighted Laplacian is a constant matrix times a scalar, and the flow of the
consensus dynamics is a matrix exponential of a closed-form integral.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.carriers import Carrier, SineCarrier, UnitCarrier, WeightMap, apply_map
from hybrid_model.consensus.weights.clockwork import (
    gate_boundary,
    gate_segment,
    gated_sine,
    half_wave,
    half_wave_boundary,
)
from hybrid_model.consensus.weights.gate import Gate
from hybrid_model.consensus.weights.periods import common_period
from hybrid_model.consensus.weights.waveform import ALWAYS, Waveform, require

__all__ = [
    "Carrier",
    "ConstantWeight",
    "GatedSine",
    "SineCarrier",
    "UnitCarrier",
    "Waveform",
    "WeightMap",
    "apply_map",
    "gate_boundary",
    "gate_segment",
    "gated_sine",
    "half_wave",
    "half_wave_boundary",
]


@dataclass(frozen=True)
class ConstantWeight:
    """A weight that does not change: ``w(t) = level``.

    Parameters
    ----------
    level : float
        The weight, finite and not negative.

    Raises
    ------
    ValueError
        If the level is negative or not finite.
    """

    level: float

    def __post_init__(self) -> None:
        """Check the values."""
        require("the constant weight", self.level, self.level >= 0, "must not be negative")

    @property
    def carrier(self) -> UnitCarrier:
        """The carrier 1."""
        return UnitCarrier()

    @property
    def period(self) -> float:
        """0.0: every number is a period of a constant."""
        return 0.0

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level, in the shape of `t` [s]."""
        return np.full(np.shape(t), float(self.level))

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level, in the shape of `t` [s]."""
        return self.amplitude(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """None: an empty array."""
        return np.empty(0)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """``level*(t1 - t0)``; times in seconds."""
        return self.level * self.carrier.integral(t0, t1)


@dataclass(frozen=True)
class GatedSine:
    """The weight ``w = g**2`` or ``|g|`` of ``g = (square(gate_rate*t - phase, duty_percent) + 1)*sin(sine_rate*t)``.

    Parameters
    ----------
    gate_rate, sine_rate : float
        Angular rates [rad/s], positive.
    duty_percent : float
        Open share of each gate period, 0 to 100 [%].
    phase : float
        Phase of the gate [rad].
    map : WeightMap
        SQUARE (the reading under which the paper's example is persistently exciting) or ABS.

    Raises
    ------
    ValueError
        If a number is outside its range or not finite.

    Notes
    -----
    Source: paper, section 7; audit, section 9 for the choice of the map and for the closed-form integrals.
    """

    gate_rate: float
    sine_rate: float
    duty_percent: float
    phase: float = 0.0
    map: WeightMap = WeightMap.SQUARE

    def __post_init__(self) -> None:
        """Check the values."""
        require("sine_rate", self.sine_rate, self.sine_rate > 0, "must be positive")
        self.gate.check()

    @cached_property
    def gate(self) -> Gate:
        """When the weight is on."""
        return Gate(self.gate_rate, self.duty_percent, self.phase)

    @property
    def carrier(self) -> SineCarrier:
        """The shape of the weight while the gate is open."""
        return SineCarrier(self.sine_rate, self.map)

    @property
    def period(self) -> float | None:
        """A period [s] of the weight, 0.0 if it is zero throughout, None if gate and sine are not commensurable.

        Both maps fold the sine, so the carrier has the period ``pi/sine_rate``.
        """
        if self.duty_percent == 0:
            return 0.0
        carrier_period = math.pi / self.sine_rate
        if self.duty_percent == 100:
            return carrier_period
        return common_period((2 * math.pi / self.gate_rate, carrier_period))

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """1 where the gate is open at `t` [s], else 0."""
        return self.gate.is_open(t)

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        time = np.asarray(t, dtype=float)
        return np.asarray(apply_map(gated_sine(time, self.gate.segment(time), self.sine_rate), self.map))

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which the weight jumps or has a kink.

        These are the gate's boundaries and, for ABS, the zeros of the sine inside open windows.
        """
        times = self.gate.breakpoints(t0, t1)
        if self.map is WeightMap.SQUARE:
            return times
        zeros = half_wave_boundary(
            np.arange(half_wave(t0, self.sine_rate), half_wave(t1, self.sine_rate)), self.sine_rate
        )
        times = np.union1d(times, zeros[self.amplitude(zeros) > 0])
        return times[(times > t0) & (times < t1)]

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        return self.gate.integral(self.carrier, t0, t1)

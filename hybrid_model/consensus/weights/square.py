"""Weights that alternate between two levels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.gate import Gate, GateClock, is_open
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.declare.variables import Value

__all__ = ["SquareWeight", "SquareWeights"]


def _level(segment: Value, high: Value, low: Value) -> Value:
    return (1 - is_open(segment)) * low + is_open(segment) * high


class SquareWeights(GateClock):
    """Weights that alternate between two levels."""

    high = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="weight while the gate is on")
    low = hm.Parameter(0.0, shape="degree", unit="1/s", minimum=0.0, description="weight while the gate is off")

    def amplitude(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """The levels."""
        return _level(pieces["segment"], s.high, s.low)

    def carrier(self, s: hm.Values) -> UnitCarrier:
        """1."""
        return UnitCarrier()


@dataclass(frozen=True)
class SquareWeight(Waveform):
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
    automaton = SquareWeights
    carrier = UnitCarrier()
    numbers: ClassVar[Mapping[str, float | None]] = {
        "high": None,
        "low": 0.0,
        "gate_rate": None,
        "duty_percent": None,
        "phase": 0.0,
    }

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
    def period(self) -> float:
        """``2*pi/gate_rate`` [s]; 0.0 if the weight is constant."""
        is_constant = self.high == self.low or self.duty_percent in (0, 100)
        return 0.0 if is_constant else 2 * math.pi / self.gate_rate

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level at `t` [s], in the shape of `t`."""
        return np.asarray(_level(self.gate.segment(np.asarray(t, dtype=float)), self.high, self.low))

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Instants strictly between `t0` and `t1` [s], ascending, at which the level changes."""
        return self.gate.breakpoints(t0, t1)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        whole = self.carrier.integral(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        return np.asarray(self.low * whole + (self.high - self.low) * self.gate.integral(self.carrier, t0, t1))

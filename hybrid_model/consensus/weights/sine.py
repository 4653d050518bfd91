"""Weights that follow a sine around a mean."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.over_time import require, require_phase
from hybrid_model.consensus.weights.edge_automata import ForeseenWeights
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.declare.variables import Value

__all__ = ["RippleCarrier", "SineWeight", "SineWeights"]


@dataclass(frozen=True)
class RippleCarrier:
    """The shape ``1 + depth*sin(rate*t - phase)`` with a depth from 0 to 1; `rate` in rad/s, `phase` in rad."""

    depth: Value
    rate: Value
    phase: Value

    @property
    def steepness(self) -> Value:
        """``depth*rate``."""
        return self.depth * self.rate

    def value(self, t: Value) -> Value:
        """Value at time `t` [s]."""
        return 1 + self.depth * np.sin(self.rate * t - self.phase)

    def integral(self, t0: Value, t1: Value) -> Value:
        """Integral from `t0` to `t1` [s] in closed form; the difference of cosines is written as a product."""
        middle = self.rate * (t0 + t1) / 2 - self.phase
        wave = 2 / self.rate * np.sin(middle) * np.sin(self.rate * (t1 - t0) / 2)
        return (t1 - t0) + self.depth * wave


class SineWeights(ForeseenWeights):
    """Weights ``mean (1 + depth sin(rate t - phase))``, smooth at all times."""

    mean = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="mean weight")
    depth = hm.Parameter(
        0.5, shape="degree", minimum=0.0, maximum=1.0, description="share of the mean by which the weight swings"
    )
    rate = hm.Parameter(1.0, shape="degree", unit="rad/s", description="rate of the sine")
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the sine")

    def amplitude(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """The mean."""
        return s.mean

    def carrier(self, s: hm.Values) -> RippleCarrier:
        """The sine around 1."""
        return RippleCarrier(s.depth, s.rate, s.phase)


@dataclass(frozen=True)
class SineWeight(Waveform):
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
    automaton = SineWeights
    numbers: ClassVar[Mapping[str, float | None]] = {"mean": None, "depth": None, "rate": None, "phase": 0.0}

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

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The mean, in the shape of `t` [s]."""
        return np.full(np.shape(t), float(self.mean))

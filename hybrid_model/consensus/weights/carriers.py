"""Carriers: the shapes that an edge's weight can have while it is on, with their exact integrals."""

import enum
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.clockwork import Expression, gated_sine, half_wave

__all__ = ["Carrier", "RippleCarrier", "SineCarrier", "UnitCarrier", "WeightMap", "apply_map"]


class Carrier(Protocol):
    """A function of time, at least 0, that is smooth between the breakpoints of its weight.

    Carriers are compared with ``==`` and hashed: edges whose carriers are equal share a shape.
    """

    @property
    def rate(self) -> float:
        """Angular rate [rad/s] of its fastest oscillation between breakpoints; 0.0 if it does not oscillate."""

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """Value at time `t` [s]."""

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s]."""


class WeightMap(enum.Enum):
    """How a signed signal g becomes a weight w >= 0 (audit, section 9: w = g itself is not admissible)."""

    SQUARE = "square"
    ABS = "abs"


def apply_map(g: Expression, weight_map: WeightMap) -> Expression:
    """``g**2`` or ``|g|``; traceable in `g`."""
    if weight_map is WeightMap.SQUARE:
        return g**2
    return np.abs(g)


@dataclass(frozen=True)
class UnitCarrier:
    """The carrier 1 of a weight that is constant on each piece."""

    @property
    def rate(self) -> float:
        """0.0: it does not oscillate."""
        return 0.0

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """1 at every time `t` [s]."""
        return np.ones(np.shape(t))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """``t1 - t0`` [s]."""
        return np.asarray(np.asarray(t1, dtype=float) - np.asarray(t0, dtype=float))


@dataclass(frozen=True)
class SineCarrier:
    """The open-gate shape ``4*sin(rate*t)**2`` or ``2*|sin(rate*t)|``; `rate` in rad/s."""

    rate: float
    map: WeightMap

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """Value at time `t` [s], the gate being open."""
        open_segment = 0
        return np.asarray(apply_map(gated_sine(np.asarray(t, dtype=float), open_segment, self.rate), self.map))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s] in closed form, without cancellation between two large primitives."""
        start, end = np.asarray(t0, dtype=float), np.asarray(t1, dtype=float)
        if self.map is WeightMap.SQUARE:
            wave = np.cos(self.rate * (start + end)) * np.sin(self.rate * (end - start))
            return np.asarray(2 * (end - start) - 2 / self.rate * wave)
        # Each half wave of 2|sin| has the area 4/rate; the cosines are those of the angle within a half wave.
        h0, h1 = half_wave(start, self.rate), half_wave(end, self.rate)
        cosines = np.cos(self.rate * start - np.pi * h0) - np.cos(self.rate * end - np.pi * h1)
        return np.asarray(2 / self.rate * (2 * (h1 - h0) + cosines))


@dataclass(frozen=True)
class RippleCarrier:
    """The shape ``1 + depth*sin(rate*t - phase)`` with a depth from 0 to 1; `rate` in rad/s, `phase` in rad."""

    depth: float
    rate: float
    phase: float

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """Value at time `t` [s]."""
        return np.asarray(1 + self.depth * np.sin(self.rate * np.asarray(t, dtype=float) - self.phase))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s] in closed form; the difference of cosines is written as a product."""
        start, end = np.asarray(t0, dtype=float), np.asarray(t1, dtype=float)
        middle = self.rate * (start + end) / 2 - self.phase
        wave = 2 / self.rate * np.sin(middle) * np.sin(self.rate * (end - start) / 2)
        return np.asarray((end - start) + self.depth * wave)

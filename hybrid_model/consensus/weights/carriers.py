"""Carriers: the shapes that an edge's weight can have while it is on, with their exact integrals."""

from dataclasses import dataclass
from typing import Protocol

from hybrid_model.declare.variables import Value

__all__ = ["Carrier", "UnitCarrier"]


class Carrier(Protocol):
    """A function of time, at least 0, that is smooth between the breakpoints of its weight.

    Its formula is written once, in numpy style: with numbers it serves bounds and integrals, with arrays or symbols,
    one element an edge, the automata of the edges and the forecast of self-triggered agents. Carriers of numbers are
    compared with ``==`` and hashed: edges whose carriers are equal share a shape.
    """

    @property
    def rate(self) -> Value:
        """Angular rate [rad/s] of its fastest oscillation between breakpoints; 0.0 if it does not oscillate."""

    @property
    def steepness(self) -> Value | None:
        """Bound on its slope [1/s] between breakpoints; None if none is known."""

    def value(self, t: Value) -> Value:
        """Value at time `t` [s]."""

    def integral(self, t0: Value, t1: Value) -> Value:
        """Integral from `t0` to `t1` [s]."""


@dataclass(frozen=True)
class UnitCarrier:
    """The carrier 1 of a weight that is constant on each piece."""

    @property
    def rate(self) -> float:
        """0.0: it does not oscillate."""
        return 0.0

    @property
    def steepness(self) -> float:
        """0.0: it does not change."""
        return 0.0

    def value(self, t: Value) -> Value:
        """1 at every time `t` [s]."""
        return 1.0 + 0.0 * t

    def integral(self, t0: Value, t1: Value) -> Value:
        """``t1 - t0`` [s]."""
        return t1 - t0

"""One solver step of a flow, cut at the event that ended it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_model.declare.variables import FloatArray


@dataclass(frozen=True, eq=False)
class FlowPiece:
    """One solver step of a flow, cut at the event that ended it.

    Attributes
    ----------
    t0, t1 : float
        Its ends in s.
    x0, x1 : ndarray
        Continuous states there.
    interpolate : callable
        ``interpolate(t) -> x`` between the ends, shape (states,) or (states, times): the solver's dense output.
    """

    t0: float
    t1: float
    x0: FloatArray
    x1: FloatArray
    interpolate: Callable[[Any], FloatArray]

    def at(self, t: float) -> FloatArray:
        """Return the continuous states at `t` in [t0, t1]."""
        if t <= self.t0:
            return self.x0
        return self.x1 if t >= self.t1 else self.interpolate(t)

    def sample(self, times: FloatArray) -> FloatArray:
        """Return the continuous states at times in [t0, t1], shape (times, states)."""
        states = np.asarray(self.interpolate(times)).T
        states[times <= self.t0] = self.x0
        states[times >= self.t1] = self.x1
        return states


def straight_piece(t0: float, t1: float, x0: FloatArray, x1: FloatArray) -> FlowPiece:
    """Return the piece of a flow that is a straight line from x0 at t0 to x1 at t1."""
    return FlowPiece(t0, t1, x0, x1, _Line(t0, t1, x0, x1))


@dataclass(frozen=True, eq=False)
class _Line:
    """The dense output of a straight piece; a class, since a function made for each piece could not be pickled."""

    t0: float
    t1: float
    x0: FloatArray
    x1: FloatArray

    def __call__(self, t: float | FloatArray) -> FloatArray:
        part = (np.asarray(t) - self.t0) / (self.t1 - self.t0 or 1.0)
        change = self.x1 - self.x0
        return self.x0 + change * part if part.ndim == 0 else self.x0[:, None] + change[:, None] * part

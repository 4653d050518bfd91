"""One solver step of a flow, cut at the event that ended it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import DeclarationError


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


def unseen(pieces: Sequence[FlowPiece]) -> list[FlowPiece]:
    """Return one piece in place of many, of which the ends alone are kept."""
    if not pieces:
        return []
    first, last = pieces[0], pieces[-1]
    return [FlowPiece(first.t0, last.t1, first.x0, last.x1, refuse_inside)]


def refuse_inside(t: float | FloatArray) -> NoReturn:
    """Refuse a state inside a flow of a run that has kept its events only.

    Raises
    ------
    DeclarationError
        Always.
    """
    time = float(np.asarray(t).ravel()[0])
    raise DeclarationError(
        f"the run has kept its events only, and t = {time:.9g} s lies between two of them: run it with "
        'record="all" for the states there.'
    )


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

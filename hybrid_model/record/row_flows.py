"""The flows and jumps of a run as flat arrays, as the engine in C leaves them (hybrid_model/engine/recorder.c).

No object is made for a step or a jump before somebody asks for it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
import numpy.typing as npt
from numpy.polynomial.chebyshev import chebval

from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece, refuse_inside
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.jump_record import JumpRecord

Counts = npt.NDArray[np.int64]

_BEFORE_STATES = 3
"""Numbers in a row before those of the states."""
_NESTED_VECTORS = 8


@dataclass(frozen=True, eq=False)
class Rows:
    """What the engine has recorded of a run.

    Attributes
    ----------
    steps : ndarray, shape (steps, 3 + (1 + vectors) * states)
        The ends t0 and t1 of each step in s, where it was cut, the states there, and the vectors of its interpolation.
    jumps : ndarray, shape (1 + jumps, 3 + 2 * (states + discrete states))
        The number of steps before each jump, its time in s, its index, and the states before and after it. The first
        row is the start.
    states, discrete : int
        Numbers of scalar states.
    names : tuple of str
        Of the automaton's jumps.
    events_only : bool
        Whether the steps stand for whole flows, of which the ends alone are known.
    """

    steps: FloatArray
    jumps: FloatArray
    states: int
    discrete: int
    names: tuple[str, ...]
    events_only: bool = False

    @classmethod
    def of_events(cls, jumps: FloatArray, end: float, x: FloatArray, discrete: int, names: tuple[str, ...]) -> Rows:
        """Return the rows of a run of which the jumps were recorded, and its end: time in s and states."""
        states = len(x)
        starts, ends = jumps[:, 1], np.append(jumps[1:, 1], end)
        reached = np.vstack([jumps[1:, _BEFORE_STATES : _BEFORE_STATES + states], x])
        flown = ends > starts
        unknown = np.full((len(jumps), _NESTED_VECTORS * states), np.nan)
        steps = np.hstack([starts[:, None], ends[:, None], ends[:, None], reached, unknown])[flown]
        counted = jumps.copy()
        counted[:, 0] = np.concatenate([[0], np.cumsum(flown)[:-1]])
        return cls(steps, counted, states, discrete, names, events_only=True)

    @functools.cached_property
    def firsts(self) -> Counts:
        """The number of the first step of each flow, and the number of all steps at the end."""
        return np.append(self.jumps[:, 0], len(self.steps)).astype(np.int64)

    @property
    def starts(self) -> FloatArray:
        """Where each flow starts, in s."""
        return self.jumps[:, 1]

    @functools.cached_property
    def ends(self) -> FloatArray:
        """Where each flow ends, in s."""
        ends = self.starts.copy()
        flown = self.firsts[1:] > self.firsts[:-1]
        ends[flown] = self.steps[self.firsts[1:][flown] - 1, 2]
        return ends

    @property
    def begun(self) -> FloatArray:
        """The states at the start of each flow, shape (flows, states)."""
        first = _BEFORE_STATES + self.states + self.discrete
        return self.jumps[:, first : first + self.states]

    @property
    def held(self) -> FloatArray:
        """The discrete states in each flow, shape (flows, discrete states)."""
        return self.jumps[:, _BEFORE_STATES + 2 * self.states + self.discrete :]

    @property
    def reached(self) -> FloatArray:
        """The states at the end of each step, shape (steps, states)."""
        return self.steps[:, _BEFORE_STATES : _BEFORE_STATES + self.states]

    @property
    def indices(self) -> Counts:
        """Index of each jump."""
        return self.jumps[1:, 2].astype(np.int64)

    def vectors(self, step: int | Counts) -> FloatArray:
        """Return the vectors of the interpolation of a step, shape (vectors, states), or of steps."""
        return self._vectors[step]

    @property
    def _vectors(self) -> FloatArray:
        given = self.steps[:, _BEFORE_STATES + self.states :]
        count = given.shape[-1] // self.states if self.states else _NESTED_VECTORS
        return given.reshape(len(given), count, self.states)

    def at(self, flows: Counts, times: FloatArray, part: slice = slice(None)) -> FloatArray:
        """Return the states, or a part of them, in flows at times in them, shape (times, states)."""
        states = self.begun[:, part][flows]
        inside = times > self.starts[flows]
        if not inside.any():
            return states
        k, t = flows[inside], times[inside]
        # A flow's steps lie in order: count those that end before the time, as far back as the flow goes.
        step = self._steps_at(k, t)
        t0, t1, cut = self.steps[step, :_BEFORE_STATES].T
        if self.events_only and (t < cut).any():
            refuse_inside(t[t < cut])
        found = interpolated(self._vectors[:, :, part][step], ((t - t0) / (t1 - t0))[:, None])
        states[inside] = np.where((t >= cut)[:, None], self.reached[:, part][step], found)
        return states

    def _steps_at(self, flows: Counts, times: FloatArray) -> Counts:
        """Return the first step of each flow that ends at the time or after it, or the flow's last."""
        # Ends do not fall from step to step, also from flow to flow.
        step = np.searchsorted(self.steps[:, 2], times, side="left")
        return np.clip(step, self.firsts[flows], self.firsts[flows + 1] - 1)


def interpolated(vectors: FloatArray, a: FloatArray | float) -> FloatArray:
    """Evaluate interpolations at parts of their steps.

    Parameters
    ----------
    vectors : ndarray, shape (..., k, states)
        Up to eight: the state at the start, its change, and more of its curvature
        (hybrid_model/engine/methods/dense.c). More than that: the coefficients of a Chebyshev series
        (hybrid_model/engine/methods/chebyshev.c).
    a : float or ndarray, broadcast against (..., states)
        From 0 at the start of a step to 1 at its end.
    """
    if vectors.shape[-2] <= _NESTED_VECTORS:
        return _nested(vectors, a)
    return np.asarray(chebval(2.0 * np.asarray(a) - 1.0, np.moveaxis(vectors, -2, 0), tensor=False))


def _nested(vectors: FloatArray, a: FloatArray | float) -> FloatArray:
    b = 1.0 - a
    found = np.zeros(())
    for k in range(vectors.shape[-2] - 1, 0, -1):
        found = (a if k % 2 else b) * (vectors[..., k, :] + found)
    return np.asarray(vectors[..., 0, :] + found)


@dataclass(frozen=True, eq=False)
class _Interpolation:
    """The dense output of one step."""

    t0: float
    t1: float
    vectors: FloatArray

    def __call__(self, t: float | FloatArray) -> FloatArray:
        part = (np.asarray(t) - self.t0) / (self.t1 - self.t0)
        return interpolated(self.vectors, part) if part.ndim == 0 else interpolated(self.vectors, part[:, None]).T


class RowFlows(Sequence[FlowRecord]):
    """The flows of a run; each is made when it is asked for.

    Parameters
    ----------
    rows : Rows
        What the engine has recorded.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows.jumps)

    @overload
    def __getitem__(self, k: int) -> FlowRecord: ...
    @overload
    def __getitem__(self, k: slice) -> list[FlowRecord]: ...
    def __getitem__(self, k: int | slice) -> FlowRecord | list[FlowRecord]:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = range(len(self))[k]
        rows, x0 = self.rows, self.rows.begun[k]
        pieces, x = list[FlowPiece](), x0
        for step in range(rows.firsts[k], rows.firsts[k + 1]):
            t0, t1, end = (float(t) for t in rows.steps[step, :_BEFORE_STATES])
            reached = rows.reached[step]
            inside = refuse_inside if rows.events_only else _Interpolation(t0, t1, rows.vectors(step))
            pieces.append(FlowPiece(t0, end, x, reached, inside))
            x = reached
        return FlowRecord(float(rows.starts[k]), x0, rows.held[k], tuple(pieces))

    def __iter__(self) -> Iterator[FlowRecord]:
        return (self[k] for k in range(len(self)))


class RowJumps(Sequence[JumpRecord]):
    """The jumps of a run; each is made when it is asked for.

    Parameters
    ----------
    rows : Rows
        What the engine has recorded.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows.jumps) - 1

    @overload
    def __getitem__(self, k: int) -> JumpRecord: ...
    @overload
    def __getitem__(self, k: slice) -> list[JumpRecord]: ...
    def __getitem__(self, k: int | slice) -> JumpRecord | list[JumpRecord]:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = range(len(self))[k]
        row, rows = self.rows.jumps[k + 1], self.rows
        ends = np.cumsum([_BEFORE_STATES, rows.states, rows.discrete, rows.states])
        x_before, z_before, x_after, z_after = np.split(row, ends)[1:]
        index = int(row[2])
        return JumpRecord(float(row[1]), k, index, rows.names[index], x_before, z_before, x_after, z_after)

    def __iter__(self) -> Iterator[JumpRecord]:
        return (self[k] for k in range(len(self)))

    def times(self, name: str) -> FloatArray:
        """Return the times in s of the jumps called `name`."""
        wanted = np.array([known == name for known in self.rows.names], dtype=bool)
        times: FloatArray = self.rows.jumps[1:, 1][wanted[self.rows.indices]]
        return times

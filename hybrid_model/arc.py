"""Hybrid arcs: the result of a run on hybrid time (t, j)."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from hybrid_model.errors import DeclarationError
from hybrid_model.flow import FlowPiece
from hybrid_model.layout import Layout
from hybrid_model.variables import FloatArray, Kind, Values, Variable, unknown_name

if TYPE_CHECKING:
    from hybrid_model.execution import Execution, JumpRecord


@dataclass(frozen=True, eq=False)
class FlowRecord:
    """The flow between two jumps (of length zero in a cascade).

    Attributes
    ----------
    t0 : float
        Start in s.
    x0, z : ndarray
        Continuous states at the start; discrete states throughout.
    pieces : tuple of FlowPiece
        The solver's steps, in order.
    """

    t0: float
    x0: FloatArray
    z: FloatArray
    pieces: tuple[FlowPiece, ...]

    @property
    def t1(self) -> float:
        """End in s."""
        return self.pieces[-1].t1 if self.pieces else self.t0

    def extended(self, pieces: Sequence[FlowPiece]) -> FlowRecord:
        """Return the flow with further steps."""
        return replace(self, pieces=(*self.pieces, *pieces))

    def at(self, t: float) -> FloatArray:
        """Return the continuous states at `t` in [t0, t1]."""
        if not self.pieces:
            return self.x0
        at = bisect.bisect_left([piece.t1 for piece in self.pieces], t)
        return self.pieces[min(at, len(self.pieces) - 1)].at(t)


class HybridArc:
    """A run of an automaton: its samples on hybrid time, its jumps, and why it ended.

    Attributes
    ----------
    t, j : ndarray, shape (n,)
        Hybrid time of the samples: every solver step and both sides of every jump.
    jumps : list of JumpRecord
        In order, with the states on both sides.
    stop : Stop
        Why the run ended; its value is the remedy.
    message : str
        The particulars of the end, with names and numbers.
    event_tolerance : float
        Location tolerance of the run in s, see `Solver`.
    """

    def __init__(self, execution: Execution, flows: Sequence[FlowRecord], jumps: list[JumpRecord]) -> None:
        assert execution.stopped is not None
        self.automaton = execution.automaton
        self.stop = execution.stopped
        self.message = execution.message
        self.event_tolerance = execution.solver.event_tolerance
        self.jumps = jumps
        self._flows = list(flows)
        self._starts, self._ends = [flow.t0 for flow in flows], [flow.t1 for flow in flows]
        self._layout = Layout(self.automaton)
        self._inputs = execution.inputs
        self._p = execution.p
        times = [[flow.t0, *(piece.t1 for piece in flow.pieces)] for flow in self._flows]
        self.t: FloatArray = np.concatenate([np.array(row) for row in times])
        self.j = np.concatenate([np.full(len(row), j) for j, row in enumerate(times)])

    def __repr__(self) -> str:
        return (
            f"HybridArc({self.automaton.name}: t from {self.t[0]:g} to {self.t[-1]:g} s, {len(self.jumps)} jumps, "
            f"{self.stop.name})"
        )

    def __getitem__(self, name: str) -> FloatArray:
        """Return a variable's samples, shape (n, *shape): a state, input, parameter or output."""
        rows = []
        for flow in self._flows:
            points = [(flow.t0, flow.x0), *((piece.t1, piece.x1) for piece in flow.pieces)]
            rows += [self._value(name, t, x, flow.z) for t, x in points]
        return np.array(rows, dtype=np.float64)

    def at(self, name: str, t: npt.ArrayLike, *, before: bool = False) -> FloatArray:
        """Return a variable at given times, interpolated by the solver's dense output.

        Parameters
        ----------
        name : str
            A variable of the automaton.
        t : float or array_like
            Times in s within the run.
        before : bool
            At the time of a jump return the value before it; default: after the last jump at that time.

        Returns
        -------
        ndarray
            Shape of `t` followed by the variable's shape.

        Raises
        ------
        DeclarationError
            For an unknown name or a time outside the run.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        # Written so that a time that is not a number is outside as well.
        if times.size and not (times.min() >= self.t[0] and times.max() <= self.t[-1]):
            raise DeclarationError(
                f"a time in [{times.min():g}, {times.max():g}] s lies outside the run, "
                f"which covers [{self.t[0]:g}, {self.t[-1]:g}] s."
            )
        values = []
        for time in times.ravel():
            flow = self._flow_at(float(time), before)
            values.append(self._value(name, float(time), flow.at(float(time)), flow.z))
        return np.array(values, dtype=np.float64).reshape(np.shape(t) + self._variable(name).shape)

    def event_times(self, name: str) -> FloatArray:
        """Return the times in s of the jumps called `name`."""
        if name not in [info.name for info in self.automaton.jumps]:
            known = {info.name: info for info in self.automaton.jumps}
            raise DeclarationError(unknown_name(f"{self.automaton.name} (jumps)", name, known))
        return np.array([jump.t for jump in self.jumps if jump.name == name])

    def before(self, jump: JumpRecord) -> Values:
        """Return all values just before a jump."""
        return self._values(jump.t, jump.x_before, jump.z_before)

    def after(self, jump: JumpRecord) -> Values:
        """Return all values just after a jump."""
        return self._values(jump.t, jump.x_after, jump.z_after)

    @property
    def end(self) -> Values:
        """All values at the end of the run."""
        flow = self._flows[-1]
        return self._values(flow.t1, flow.at(flow.t1), flow.z)

    def _variable(self, name: str) -> Variable:
        known = {variable.name: variable for variable in self.automaton.variables}
        if name not in known:
            raise DeclarationError(unknown_name(self.automaton.name, name, known))
        return known[name]

    def _flow_at(self, t: float, before: bool) -> FlowRecord:
        at = bisect.bisect_left(self._ends, t) if before else bisect.bisect_right(self._starts, t) - 1
        return self._flows[min(max(at, 0), len(self._flows) - 1)]

    def _values(self, t: float, x: FloatArray, z: FloatArray) -> Values:
        return self._layout.values(t, x, z, self._inputs.at(t), self._p)

    def _value(self, name: str, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        s = self._values(t, x, z)
        if any(place.variable.name == name for place in self._layout.places[Kind.OUTPUT]):
            outputs = self.automaton.output_values(s)
            return np.asarray(outputs[name], dtype=np.float64)
        return np.asarray(s[name], dtype=np.float64)

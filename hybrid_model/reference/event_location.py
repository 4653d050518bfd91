"""Location: the first event on a step of the solver, lines 16 to 18 of the algorithm in docs/semantics.md."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from hybrid_model.declare.transitions import Priority
from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece
from hybrid_model.reference.point import Point
from hybrid_model.reference.steppers import FlowMap
from hybrid_model.reference.tolerances import border, instant, look
from hybrid_model.reference.zero_crossings import (
    DEGREE,
    SMALLEST,
    MarginAtTimes,
    first_nonnegative,
    first_rise,
    may_rise,
    scan_times,
)
from hybrid_model.scales import BORDER, NOISE


class EventLocator:
    """Looks for the first event in each step of one flow: a jump margin that rises, or the flow set left.

    The rows of its margins are those of the jumps on state and, last, the exit: minus the margin of the flow set, less
    the slack by which a state may be outside.
    """

    def __init__(self, point: Point) -> None:
        automaton = point.automaton
        self._point = point
        self._panels = math.ceil(point.solver.scan_points / DEGREE)
        self._exit = point.guards
        rows = range(point.guards + automaton.has_flow_set)
        # Under flow priority only the exit counts, and it counts at once; else, and while a state is outside where
        # rounding has put it, it counts beyond the border.
        self._flow_first = automaton.priority is Priority.FLOW
        self._watched = rows[self._exit :] if self._flow_first else rows
        self._beyond: tuple[FlowPiece, FloatArray] | None = None
        self._seen_inside = False

    def state(self, piece: FlowPiece, t: float) -> FloatArray:
        """Return the continuous states in a piece, or less than the tolerance after it.

        After it they go on with the derivative at its end: the dense output of a piece of some ulp means nothing there.
        """
        if t <= piece.t1:
            return piece.at(t)
        if self._beyond is None or self._beyond[0] is not piece:
            self._beyond = piece, FlowMap(self._point, piece.t1)(piece.t1, piece.x1)
        return piece.x1 + (t - piece.t1) * self._beyond[1]

    def first_event(self, piece: FlowPiece, end: float) -> tuple[float, bool] | None:
        """Return the time of the first event in a step, and whether it is an exit from the flow set."""
        if not self._watched:
            return None
        width = border(self._point, piece.t1, piece.x1) if self._point.automaton.has_flow_set else 0.0
        for a, b in itertools.pairwise(np.linspace(piece.t0, piece.t1, self._panels + 1)):
            for start, stop, slack in self._parts(piece, float(a), float(b), width):
                found = self._first_in_panel(piece, start, stop, slack)
                if found is not None and self._flow_first:
                    found = self._beyond_border(piece, start, stop, found[0])
                if found is not None:
                    t, row = found
                    left = row == self._exit
                    if left and not self._flow_first:
                        t = self._last_inside(piece, t)
                    return self._latest_of_simultaneous(piece, t, end), left
        return None

    def _parts(self, piece: FlowPiece, a: float, b: float, width: float) -> Iterator[tuple[float, float, float]]:
        """Yield a panel with the slack of the exit; under flow priority cut where a state that began outside gets in.

        A state begins outside by rounding only; once it has been seen inside there is no slack.
        """
        if self._flow_first and not self._seen_inside:
            times = scan_times(a, b)
            inside = np.flatnonzero(self._point.margins_along(times, piece.sample(times))[:, -1] >= 0.0)
            if inside.size:
                seen = float(times[inside[0]])
                if seen > a:
                    yield a, seen, width
                self._seen_inside, a = True, seen
        if b > a:
            yield a, b, 0.0 if self._flow_first and self._seen_inside else width

    def _beyond_border(self, piece: FlowPiece, a: float, b: float, t: float) -> tuple[float, int] | None:
        """Return an exit that is found at `t` as one beyond the border as it is there, if it is one."""
        width = border(self._point, t, self.state(piece, t))
        return self._first_in_panel(piece, a, b, width * (NOISE / BORDER) if self._seen_inside else width)

    def _last_inside(self, piece: FlowPiece, t: float) -> float:
        """Return the time before `t` at which a flow that is beyond the border there has crossed it."""
        times = scan_times(piece.t0, t)
        inside = np.flatnonzero(self._table(piece, times, 0.0)[:, -1] < 0.0)
        if inside.size:
            t = first_nonnegative(self._along(piece, self._exit, 0.0), float(times[inside[-1]]), t)
        return t

    def _first_in_panel(self, piece: FlowPiece, a: float, b: float, slack: float) -> tuple[float, int] | None:
        """Return the first time in a panel at which a row has risen to zero or above, and the row."""
        times = scan_times(a, b)
        table = self._table(piece, times, slack)
        if table.shape[1] > self._exit and table[0, -1] >= 0.0:
            return a, self._exit
        first: tuple[float, int] | None = None
        candidates = may_rise(table)
        for row in self._watched:
            if not candidates[row]:
                continue
            bracket = first_rise(times, table[:, row], self._row_at_times(piece, row, slack))
            if bracket is None:
                continue
            first = first_nonnegative(self._along(piece, row, slack), *bracket), row
            # The others count only if they are earlier still.
            times = scan_times(a, first[0])
            table = self._table(piece, times, slack)
            candidates &= may_rise(table)
        return first

    def _latest_of_simultaneous(self, piece: FlowPiece, t: float, end: float) -> float:
        """Move on so that every guard that crosses within the same instant has crossed (rule 6)."""
        point = self._point
        horizon = min(t + instant(point, t), end)
        then = look(point, horizon, self.state(piece, horizon), point.inputs.at(horizon))
        if point.guards == 0 or then is None or np.isnan(then).any():
            return t
        now = point.margins(t, self.state(piece, t))
        rows = np.flatnonzero((now < 0.0)[: point.guards] & (then >= 0.0)[: point.guards])
        return max([t, *(first_nonnegative(self._along(piece, int(row), 0.0), t, horizon) for row in rows)])

    def _table(self, piece: FlowPiece, times: FloatArray, slack: float) -> FloatArray:
        """Return the rows at several times of a step, shape (times, rows)."""
        table = self._point.margins_along(times, piece.sample(times))
        if table.shape[1] > self._exit:
            outside = -table[:, -1] - slack
            # Zero is inside the flow set, so it is not yet an exit.
            table[:, -1] = np.where(outside == 0.0, -SMALLEST, outside)
        return table

    def _row_at_times(self, piece: FlowPiece, row: int, slack: float) -> MarginAtTimes:
        def margin(times: FloatArray) -> FloatArray:
            column: FloatArray = self._table(piece, times, slack)[:, row]
            return column

        return margin

    def _along(self, piece: FlowPiece, row: int, slack: float) -> Callable[[float], float]:
        def margin(t: float) -> float:
            value = float(self._point.margins(t, self.state(piece, t))[row])
            return (-value - slack or -SMALLEST) if row == self._exit else value

        return margin

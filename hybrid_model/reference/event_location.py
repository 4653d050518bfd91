"""EventLocatoring a flow for its first event: a jump margin that rises, or the flow set left."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from hybrid_model.declare.transitions import Priority
from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.reference.point import Point
from hybrid_model.reference.steppers import FlowMap
from hybrid_model.reference.tolerances import border, instant, look, one_instant_on, quiet_rates
from hybrid_model.reference.zero_crossings import (
    DEGREE,
    SMALLEST,
    MarginAtTimes,
    first_nonnegative,
    first_rise,
    may_rise,
    scan_times,
)
from hybrid_model.scales import BORDER, NOISE, OVERSHOOT, ulp


class EventLocator:
    """Looks for the first event in each step: a jump margin that rises, or the flow set left."""

    def __init__(self, point: Point) -> None:
        automaton = point.automaton
        self._point = point
        self._panels = math.ceil(point.solver.scan_points / DEGREE)
        self._guards = point.guards
        rows = range(self._guards + automaton.has_flow_set)
        # Under flow priority only the exit counts, and it counts at once; else, and while a state is outside where
        # rounding has put it, it counts beyond the border.
        self._flow_first = automaton.priority is Priority.FLOW
        self._watched = rows[self._guards :] if self._flow_first else rows
        self._beyond: tuple[FlowPiece, FloatArray] | None = None
        self._seen_inside = False
        self._slack = 0.0

    def state(self, piece: FlowPiece, t: float) -> FloatArray:
        """Return the continuous states in a piece, or less than the tolerance after it.

        After it they go on with the derivative at its end: the dense output of a piece of some ulp means nothing there.
        """
        if t <= piece.t1:
            return piece.at(t)
        if self._beyond is None or self._beyond[0] is not piece:
            self._beyond = piece, FlowMap(self._point, piece.t1)(piece.t1, piece.x1)
        return piece.x1 + (t - piece.t1) * self._beyond[1]

    def _margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the jump margins and, last, the margin by which the flow set is left."""
        row = self._point.margins(t, x)
        if len(row) > self._guards:
            # Zero is inside the flow set, so it is not yet an exit.
            row[-1] = -row[-1] - self._slack or -SMALLEST
        return row

    def first_event(self, piece: FlowPiece, end: float) -> tuple[float, bool] | None:
        """Return the time of the first event in a step, and whether it is an exit from the flow set."""
        if not self._watched:
            return None
        if self._point.automaton.has_flow_set:
            at_once = self._flow_first and self._seen_inside
            self._slack = 0.0 if at_once else border(self._point, piece.t1, piece.x1)
        for a, b in itertools.pairwise(np.linspace(piece.t0, piece.t1, self._panels + 1)):
            for start, stop in self._parts(piece, float(a), float(b)):
                found = self._first_in_panel(piece, start, stop)
                if found is not None and self._flow_first:
                    found = self._beyond_border(piece, start, stop, found[0])
                if found is not None:
                    t, row = found
                    left = row >= self._guards
                    if left and not self._flow_first:
                        t = self._last_inside(piece, t)
                    return self._latest_of_simultaneous(piece, t, end), left
        return None

    def _beyond_border(self, piece: FlowPiece, a: float, b: float, t: float) -> tuple[float, int] | None:
        """Return an exit that is found at `t` as one beyond the border as it is there, if it is one."""
        before, width = self._slack, border(self._point, t, self.state(piece, t))
        self._slack = width * (NOISE / BORDER) if self._seen_inside else width
        found = self._first_in_panel(piece, a, b)
        self._slack = before
        return found

    def _last_inside(self, piece: FlowPiece, t: float) -> float:
        """Return the time before `t` at which a flow that is beyond the border there has crossed it."""
        beyond, self._slack = self._slack, 0.0
        times = scan_times(piece.t0, t)
        outside = self._table(piece, times)[:, -1]
        inside = np.flatnonzero(outside < 0.0)
        if inside.size:
            t = first_nonnegative(self._along(piece, self._guards), float(times[inside[-1]]), t)
        self._slack = beyond
        return t

    def _parts(self, piece: FlowPiece, a: float, b: float) -> Iterator[tuple[float, float]]:
        """Yield a panel; under flow priority cut where a state that began outside by rounding is seen inside."""
        if self._flow_first and not self._seen_inside:
            times = scan_times(a, b)
            inside = np.flatnonzero(self._point.margins_along(times, piece.sample(times))[:, -1] >= 0.0)
            if inside.size:
                seen = float(times[inside[0]])
                if seen > a:
                    yield a, seen
                self._seen_inside, self._slack, a = True, 0.0, seen
        if b > a:
            yield a, b

    def _first_in_panel(self, piece: FlowPiece, a: float, b: float) -> tuple[float, int] | None:
        times = scan_times(a, b)
        table = self._table(piece, times)
        if table.shape[1] > self._guards and table[0, -1] >= 0.0:
            return a, self._guards
        first: tuple[float, int] | None = None
        candidates = may_rise(table)
        for row in self._watched:
            if not candidates[row]:
                continue
            bracket = first_rise(times, table[:, row], self._row_at_times(piece, row))
            if bracket is None:
                continue
            first = first_nonnegative(self._along(piece, row), *bracket), row
            # The others count only if they are earlier still.
            times = scan_times(a, first[0])
            table = self._table(piece, times)
            candidates &= may_rise(table)
        return first

    def _table(self, piece: FlowPiece, times: FloatArray) -> FloatArray:
        """Return the margins as `_margins` does, at several times of a step."""
        table = self._point.margins_along(times, piece.sample(times))
        if table.shape[1] > self._guards:
            outside = -table[:, -1] - self._slack
            table[:, -1] = np.where(outside == 0.0, -SMALLEST, outside)
        return table

    def _row_at_times(self, piece: FlowPiece, row: int) -> MarginAtTimes:
        def margin(times: FloatArray) -> FloatArray:
            column: FloatArray = self._table(piece, times)[:, row]
            return column

        return margin

    def raise_levels(self, piece: FlowPiece) -> None:
        """Enable the guards that would cross within one instant if the flow did not end with this piece (rule 6).

        A flow that ends at a time event may not go on to see whether a guard reaches zero a rounding later. Such a
        guard counts as crossed: it is due as long as no jump lowers its margin.
        """
        point = self._point
        if self._guards == 0 or len(self._watched) == 0 or self._watched[0] >= self._guards:
            return
        then = one_instant_on(point, FlowMap(point, piece.t1)(piece.t1, piece.x1))
        if then is not None:
            now = self._margins(piece.t1, piece.x1)[: self._guards]
            point.levels = np.where((now < 0.0) & (then[: self._guards] >= 0.0), now, 0.0)

    def reach_guard(self, end: float) -> FlowPiece | None:
        """Go on straight to the nearest guard where the solver cannot, if it is as near as a solver comes.

        A flow map that is defined up to a guard only, as a root is, stops every stepper some ulp before it.
        """
        point = self._point
        t, x = point.t, point.x
        rates, reach = quiet_rates(point, t, x), min(OVERSHOOT * ulp(t), end - t)
        then = one_instant_on(point, rates)
        if self._guards == 0 or self._flow_first or then is None or not np.isfinite(rates).all():
            return None
        now = point.margins(t, x)[: self._guards]
        rising = (now < 0.0) & (then[: self._guards] > now)
        slopes = np.where(rising, (then[: self._guards] - now) / instant(point, t), 1.0)
        wait = np.where(rising, -now / slopes, math.inf)
        row = int(wait.argmin())
        if not wait[row] <= reach:
            return None
        stop = max(t + float(wait[row]), float(np.nextafter(t, math.inf)))
        piece = point.follow(straight_piece(t, stop, x, x + (stop - t) * rates))
        margin = point.margins(stop, piece.x1)[row]
        point.levels = np.zeros(self._guards)
        point.levels[row] = min(0.0, float(margin))
        return piece

    def go_on_to(self, end: float) -> FlowPiece:
        """Take a guard that is crossed within one instant before a time event to that event's time (rule 6)."""
        point = self._point
        t, x = point.t, point.x
        enabled = self._margins(t, x)[: self._guards] >= point.levels
        piece = point.follow(straight_piece(t, end, x, x + (end - t) * FlowMap(point, end)(t, x)))
        now = self._margins(end, piece.x1)[: self._guards]
        point.levels = np.where(enabled & (now < 0.0), now, 0.0)
        return piece

    def _along(self, piece: FlowPiece, row: int) -> Callable[[float], float]:
        def margin(t: float) -> float:
            return float(self._margins(t, self.state(piece, t))[row])

        return margin

    def _latest_of_simultaneous(self, piece: FlowPiece, t: float, end: float) -> float:
        """Move on so that every guard that crosses within the same instant has crossed (rule 6)."""
        horizon = min(t + instant(self._point, t), end)
        then = look(self._point, horizon, self.state(piece, horizon), self._point.inputs.at(horizon))
        if self._guards == 0 or then is None or np.isnan(then).any():
            return t
        now = self._margins(t, self.state(piece, t))
        crossing = (now < 0.0) & (then >= 0.0)
        rows = np.flatnonzero(crossing[: self._guards])
        return max([t, *(first_nonnegative(self._along(piece, int(row)), t, horizon) for row in rows)])

"""Integrate the flow map over SciPy's steppers and stop at the first event."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_model.errors import SimulationError
from hybrid_model.layout import not_finite
from hybrid_model.locate import DEGREE, MarginAtTimes, first_nonnegative, first_rise, may_rise, scan_times, ulp
from hybrid_model.transitions import Priority
from hybrid_model.variables import FloatArray, Kind

if TYPE_CHECKING:
    from hybrid_model.execution import Execution

SHORTEST = 16.0
"""Pieces shorter than this many ulp of t are made in one explicit Euler step: no stepper can subdivide them."""
FLOW_FIRST_SLACK = 1e-15
"""Under flow priority a flow set is left when its margin is below zero by this: at zero the state is still in it."""
ATTEMPTS = 1000
"""Evaluations, a state, after which a step that has met a derivative that is not finite is given up: a stepper that
halves its step to nothing needs hundreds, and LSODA would try the same step for ever."""
STATELESS_STEPS = 25
"""Steps over a flow without continuous states, where no error estimate limits them."""


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


def integrate(execution: Execution, limit: float, time_event: float) -> tuple[list[FlowPiece], bool]:
    """Move an execution along its flow to `limit` or the next time event, or to the first event before them.

    Returns
    -------
    pieces : list of FlowPiece
        The steps made.
    left : bool
        Whether the flow ended by leaving the flow set.
    """
    pieces: list[FlowPiece] = []
    end = min(limit, time_event)
    watch = _Watch(execution)
    if end - execution.t <= SHORTEST * ulp(end):
        x1 = execution.x + (end - execution.t) * _FlowMap(execution, end)(execution.t, execution.x)
        pieces.append(_move(execution, straight_piece(execution.t, end, execution.x, x1)))
        watch.raise_levels(pieces[-1])
        return pieces, False
    for piece in _steps(execution, end):
        found = watch.first_event(piece, end)
        if found is None:
            pieces.append(_move(execution, piece))
            continue
        t, left = found
        x = watch.state(piece, t)
        pieces.append(_move(execution, FlowPiece(piece.t0, t, piece.x0, x, piece.interpolate)))
        if t + execution.solver.event_tolerance > end:
            watch.raise_levels(pieces[-1])
            if not left and t < end == time_event:
                pieces.append(watch.go_on_to(end))
        return pieces, left
    if pieces:
        watch.raise_levels(pieces[-1])
    return pieces, False


def _move(execution: Execution, piece: FlowPiece) -> FlowPiece:
    bad = not_finite(execution.layout, Kind.STATE, piece.x1)
    if bad:
        raise SimulationError(f"{execution.automaton.name}: {bad} at t = {piece.t1:.9g} s: states must stay finite.")
    execution.t, execution.x = piece.t1, piece.x1
    return piece


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


class _FlowMap:
    """The derivative as steppers call it; it remembers values that are not finite.

    A stepper may try a point outside the flow set and come back with a shorter step, so one such value is no error yet.
    """

    def __init__(self, execution: Execution, end: float) -> None:
        self._execution = execution
        # Inputs are continuous from the right: the last stage of a step that ends at a breakpoint belongs to the left.
        self._last = float(np.nextafter(end, -np.inf)) if execution.inputs.vary else end
        # This is the innermost loop of a run: what does not change along a flow is looked up once.
        self._rates, self._z, self._p = execution.maps.rates, execution.z, execution.p
        self._held = None if execution.inputs.vary else execution.inputs.at(execution.t)
        self.forget()

    def forget(self) -> None:
        """Begin anew: a step was accepted."""
        self.trouble = ""
        self._count = 0

    def __call__(self, t: float, x: FloatArray) -> FloatArray:
        execution = self._execution
        t = min(t, self._last)
        u = execution.inputs.at(t) if self._held is None else self._held
        rates = self._rates(t, x, self._z, u, self._p)
        # A sum is finite if its terms are, but for an overflow.
        if not math.isfinite(rates.sum()) and not np.isfinite(rates).all():
            self.trouble = f"derivative of {not_finite(execution.layout, Kind.STATE, rates)} at t = {t:.9g} s"
        if self.trouble:
            self._count += 1
            if self._count > ATTEMPTS * (1 + rates.size):
                raise SimulationError(_failure(execution, self, t, x, None))
        return rates


def _steps(execution: Execution, end: float) -> Any:
    """Yield the steps of the flow from the execution's state to `end`."""
    options = execution.solver
    if execution.x.size == 0:
        yield from _stateless_steps(execution, end)
        return
    flow_map = _FlowMap(execution, end)
    # Not left to the steppers: with a first derivative that is not a number some of them never return.
    flow_map(execution.t, execution.x)
    if flow_map.trouble:
        raise SimulationError(_failure(execution, flow_map, execution.t, execution.x, None))
    first = min(execution.next_step, end - execution.t) if execution.next_step else None
    stepper = options.stepper(
        flow_map,
        execution.t,
        execution.x,
        end,
        rtol=options.rtol,
        atol=options.atol,
        max_step=options.max_step,
        first_step=first,
    )
    while stepper.status == "running":
        t0, x0 = stepper.t, stepper.y
        flow_map.forget()
        try:
            problem = stepper.step()
        except ValueError as error:
            # The linear algebra of the implicit methods refuses what is not finite.
            raise SimulationError(_failure(execution, flow_map, t0, x0, str(error))) from error
        # LSODA calls a step done that went nowhere.
        if stepper.status == "failed" or not stepper.t > t0:
            raise SimulationError(_failure(execution, flow_map, t0, x0, problem or "the step length fell to zero"))
        execution.next_step = getattr(stepper, "h_abs", None)
        yield FlowPiece(t0, stepper.t, x0, stepper.y, stepper.dense_output())


def _stateless_steps(execution: Execution, end: float) -> Any:
    step = min(execution.solver.max_step, (end - execution.t) / STATELESS_STEPS)
    times = np.linspace(execution.t, end, int(np.ceil((end - execution.t) / step)) + 1)
    for t0, t1 in itertools.pairwise(times):
        yield straight_piece(float(t0), float(t1), execution.x, execution.x)


def _failure(execution: Execution, flow_map: _FlowMap, t: float, x: FloatArray, problem: str | None) -> str:
    why = f"{flow_map.trouble}; the flow map must give finite numbers in the flow set" if flow_map.trouble else problem
    state = execution.layout.describe({Kind.STATE: x, Kind.DISCRETE: execution.z})
    return f"{execution.automaton.name}: the flow cannot go on at t = {t:.9g} s ({state}): {why}."


class _Watch:
    """Looks for the first event in each step: a jump margin that rises, or the flow set left."""

    def __init__(self, execution: Execution) -> None:
        automaton = execution.automaton
        self._execution = execution
        self._tolerance = execution.solver.event_tolerance
        self._panels = math.ceil(execution.solver.scan_points / DEGREE)
        self._guards = execution.guards
        rows = range(self._guards + automaton.has_flow_set)
        # Under flow priority only the exit counts, and it counts at once; else, and while a state is outside where
        # rounding has put it, it counts beyond the tolerance.
        self._flow_first = automaton.priority is Priority.FLOW
        self._watched = rows[self._guards :] if self._flow_first else rows
        self._beyond: tuple[FlowPiece, FloatArray] | None = None
        self._slack = self._tolerance

    def state(self, piece: FlowPiece, t: float) -> FloatArray:
        """Return the continuous states in a piece, or less than the tolerance after it.

        After it they go on with the derivative at its end: the dense output of a piece of some ulp means nothing there.
        """
        if t <= piece.t1:
            return piece.at(t)
        if self._beyond is None or self._beyond[0] is not piece:
            self._beyond = piece, _FlowMap(self._execution, piece.t1)(piece.t1, piece.x1)
        return piece.x1 + (t - piece.t1) * self._beyond[1]

    def _margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the jump margins and, last, the margin by which the flow set is left."""
        row = self._execution.margins(t, x)
        if len(row) > self._guards:
            row[-1] = -row[-1] - self._slack
        return row

    def first_event(self, piece: FlowPiece, end: float) -> tuple[float, bool] | None:
        """Return the time of the first event in a step, and whether it is an exit from the flow set."""
        if not self._watched:
            return None
        for a, b in itertools.pairwise(np.linspace(piece.t0, piece.t1, self._panels + 1)):
            for start, stop in self._parts(piece, float(a), float(b)):
                found = self._first_in_panel(piece, start, stop)
                if found is not None:
                    t, row = found
                    return self._latest_of_simultaneous(piece, t, end), row >= self._guards
        return None

    def _parts(self, piece: FlowPiece, a: float, b: float) -> Iterator[tuple[float, float]]:
        """Yield a panel; under flow priority cut where a state that began outside by rounding is seen inside."""
        if self._flow_first and self._slack == self._tolerance:
            times = scan_times(a, b)
            inside = np.flatnonzero(self._execution.margins_along(times, piece.sample(times))[:, -1] >= 0.0)
            if inside.size:
                seen = float(times[inside[0]])
                if seen > a:
                    yield a, seen
                self._slack, a = FLOW_FIRST_SLACK, seen
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
        table = self._execution.margins_along(times, piece.sample(times))
        if table.shape[1] > self._guards:
            table[:, -1] = -table[:, -1] - self._slack
        return table

    def _row_at_times(self, piece: FlowPiece, row: int) -> MarginAtTimes:
        def margin(times: FloatArray) -> FloatArray:
            column: FloatArray = self._table(piece, times)[:, row]
            return column

        return margin

    def raise_levels(self, piece: FlowPiece) -> None:
        """Enable the guards that would cross within the tolerance if the flow did not end with this piece (rule 6).

        A flow that ends at a time event may not go on to see whether a guard reaches zero a rounding later. Such a
        guard counts as crossed: it is due as long as no jump lowers its margin.
        """
        execution = self._execution
        if self._guards == 0 or len(self._watched) == 0 or self._watched[0] >= self._guards:
            return
        now = self._margins(piece.t1, piece.x1)[: self._guards]
        soon = piece.t1 + self._tolerance
        then = self._margins(soon, self.state(piece, soon))[: self._guards]
        execution.levels = np.where((now < 0.0) & (then >= 0.0), now, 0.0)

    def go_on_to(self, end: float) -> FlowPiece:
        """Take a guard that is crossed within the tolerance before a time event to that event's instant (rule 6)."""
        execution = self._execution
        t, x = execution.t, execution.x
        enabled = self._margins(t, x)[: self._guards] >= execution.levels
        piece = _move(execution, straight_piece(t, end, x, x + (end - t) * _FlowMap(execution, end)(t, x)))
        now = self._margins(end, piece.x1)[: self._guards]
        execution.levels = np.where(enabled & (now < 0.0), now, 0.0)
        return piece

    def _along(self, piece: FlowPiece, row: int) -> Callable[[float], float]:
        def margin(t: float) -> float:
            return float(self._margins(t, self.state(piece, t))[row])

        return margin

    def _latest_of_simultaneous(self, piece: FlowPiece, t: float, end: float) -> float:
        """Move the instant on so that every guard that crosses within the tolerance has crossed (rule 6)."""
        horizon = min(t + self._tolerance, end)
        now, then = self._margins(t, self.state(piece, t)), self._margins(horizon, self.state(piece, horizon))
        crossing = (now < 0.0) & (then >= 0.0)
        rows = np.flatnonzero(crossing[: self._guards])
        return max([t, *(first_nonnegative(self._along(piece, int(row)), t, horizon) for row in rows)])

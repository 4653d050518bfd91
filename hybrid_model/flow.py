"""Integrate the flow map over SciPy's steppers and stop at the first event."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_model.borders import border, extrapolated, instant, look, quiet_rates, step_from
from hybrid_model.errors import HybridModelError, SimulationError
from hybrid_model.layout import not_finite
from hybrid_model.locate import DEGREE, SMALLEST, MarginAtTimes, first_nonnegative, first_rise, may_rise, scan_times
from hybrid_model.scales import ABSOLUTE, BORDER, NOISE, OVERSHOOT, ulp
from hybrid_model.transitions import Priority
from hybrid_model.variables import FloatArray, Kind

if TYPE_CHECKING:
    from hybrid_model.execution import Execution

SHORTEST = 16.0
"""Pieces shorter than this many ulp of t are made in one explicit Euler step: no stepper can subdivide them."""
ATTEMPTS = 1000
"""Evaluations, a state, after which a step that has met a derivative that is not finite is given up: a stepper that
halves its step to nothing needs hundreds, and LSODA would try the same step for ever."""
STATELESS_STEPS = 25
"""Steps over a flow without continuous states, where no error estimate limits them."""
PACE_STEPS = 2000
"""So often the pace of a flow is looked at."""
MOST_STEPS = 1e7
"""A flow that would need more steps than this at its present pace is given up: no run lasts that long."""


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
    if end - execution.t <= SHORTEST * max(ulp(end), ulp(execution.t)):
        x1 = execution.x + (end - execution.t) * _FlowMap(execution, end)(execution.t, execution.x)
        pieces.append(_move(execution, straight_piece(execution.t, end, execution.x, x1)))
        watch.raise_levels(pieces[-1])
        return pieces, False
    try:
        for piece in _steps(execution, end):
            found = watch.first_event(piece, end)
            if found is None:
                pieces.append(_move(execution, piece))
                continue
            return pieces + _to_event(execution, watch, piece, found, (end, time_event)), found[1]
    except _StuckError:
        reached = watch.reach_guard(end)
        if reached is None:
            raise
        return [*pieces, reached], False
    if pieces:
        watch.raise_levels(pieces[-1])
    return pieces, False


def _to_event(
    execution: Execution, watch: _Watch, piece: FlowPiece, event: tuple[float, bool], ends: tuple[float, float]
) -> list[FlowPiece]:
    """Move to an event in a piece, and on to a time event if that is the same instant (rule 6)."""
    (t, left), (end, time_event) = event, ends
    pieces = [_move(execution, FlowPiece(piece.t0, t, piece.x0, watch.state(piece, t), piece.interpolate))]
    if t + instant(execution, t) > end:
        watch.raise_levels(pieces[-1])
        if not left and t < end == time_event:
            pieces.append(watch.go_on_to(end))
    return pieces


class _StuckError(SimulationError):
    """The flow map is not a number wherever the solver tries to go on."""


def _move(execution: Execution, piece: FlowPiece) -> FlowPiece:
    bad = not_finite(execution.layout, Kind.STATE, piece.x1)
    if bad:
        raise SimulationError(f"{execution.automaton.name}: {bad} at t = {piece.t1:.9g} s: states must stay finite.")
    execution.arrive(piece.t1, piece.x1)
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
        try:
            rates = self._rates(t, x, self._z, u, self._p)
        except HybridModelError:
            raise
        except (ArithmeticError, ValueError) as error:
            # As `math.sqrt` of a negative number: what numpy's functions answer by a nan.
            self.trouble = f"{type(error).__name__} ({error}) in the flow map at t = {t:.9g} s"
            rates = np.full(x.shape, np.nan)
        # A sum is finite if its terms are, but for an overflow.
        if not self.trouble and not math.isfinite(rates.sum()) and not np.isfinite(rates).all():
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
    first = min(execution.next_step or step_from(execution, end), options.max_step, end - execution.t)
    stepper = _stepper(execution, flow_map, end, first)
    pace = _Pace(execution, end)
    while stepper.status == "running":
        t0, x0 = stepper.t, stepper.y
        flow_map.forget()
        try:
            problem = stepper.step()
        except HybridModelError:
            raise
        except ValueError as error:
            # The linear algebra of the implicit methods refuses what is not finite.
            first = 0.1 * getattr(stepper, "h_abs", 0.0)
            if not first > SHORTEST * ulp(t0):
                raise _StuckError(_failure(execution, flow_map, t0, x0, str(error))) from error
            stepper = _stepper(execution, flow_map, end, first)
            continue
        # LSODA calls a step done that went nowhere.
        if stepper.status == "failed" or not stepper.t > t0:
            kind = _StuckError if flow_map.trouble else SimulationError
            raise kind(_failure(execution, flow_map, t0, x0, problem or "the step length fell to zero"))
        execution.next_step = getattr(stepper, "h_abs", None)
        yield FlowPiece(t0, stepper.t, x0, stepper.y, stepper.dense_output())
        stepper.atol = _absolute_tolerance(execution, 0.0)
        pace.check(stepper.t)


def _stepper(execution: Execution, flow_map: _FlowMap, end: float, first: float) -> Any:
    """Return SciPy's stepper at the execution's state."""
    options = execution.solver
    atol = _absolute_tolerance(execution, first * float(np.abs(flow_map(execution.t, execution.x)).max()))
    return options.stepper(
        flow_map,
        execution.t,
        execution.x,
        end,
        rtol=options.rtol,
        atol=atol,
        max_step=options.max_step,
        first_step=first,
    )


def _absolute_tolerance(execution: Execution, reach: float) -> FloatArray:
    """Return the absolute tolerance of each state: a part of its nominal value, else of the largest state so far.

    A state of its own size would not do: of one that is zero up to rounding no digit is to be had. `reach` is how far
    the first step leads: states that start at zero have no size yet.
    """
    if execution.solver.atol is not None:
        return np.full(execution.x.shape, execution.solver.atol)
    largest = max(float(execution.sizes.max()), reach, SMALLEST / ABSOLUTE)
    return ABSOLUTE * np.where(np.isnan(execution.nominal), largest, execution.nominal)


class _Pace:
    """Gives up a flow that would take for ever: a stepper that creeps does not fail by itself."""

    def __init__(self, execution: Execution, end: float) -> None:
        self._execution, self._end = execution, end
        self._t, self._steps = execution.t, 0

    def check(self, t: float) -> None:
        """Count a step that ends at `t` in s."""
        self._steps += 1
        if self._steps % PACE_STEPS:
            return
        needed = (self._end - t) / (t - self._t) * PACE_STEPS
        if needed > MOST_STEPS:
            execution = self._execution
            state = execution.layout.describe({Kind.STATE: execution.x, Kind.DISCRETE: execution.z})
            raise SimulationError(
                f"{execution.automaton.name}: the flow creeps: its last {PACE_STEPS} steps led from t = {self._t:.9g} "
                f"to {t:.9g} s ({state}), so that it would need {needed:.2g} more to reach {self._end:.9g} s. Look for "
                "a flow map that is not smooth there (a root at zero, a sign): write it as modes with a switch, or "
                "smooth it; for a stiff flow choose Radau or BDF, and looser tolerances."
            )
        self._t = t


def _stateless_steps(execution: Execution, end: float) -> Any:
    step = min(execution.solver.max_step, (end - execution.t) / STATELESS_STEPS)
    times = np.linspace(execution.t, end, int(np.ceil((end - execution.t) / step)) + 1)
    for t0, t1 in itertools.pairwise(times):
        yield straight_piece(float(t0), float(t1), execution.x, execution.x)


def _failure(execution: Execution, flow_map: _FlowMap, t: float, x: FloatArray, problem: str | None) -> str:
    why = problem
    if flow_map.trouble:
        why = f"{flow_map.trouble}; the flow map must give finite numbers in the flow set"
        if execution.automaton.has_flow_set or execution.guards:
            why += ", and trial steps look a little outside: np.maximum(h, 0) under a root keeps it defined there"
    state = execution.layout.describe({Kind.STATE: x, Kind.DISCRETE: execution.z})
    return f"{execution.automaton.name}: the flow cannot go on at t = {t:.9g} s ({state}): {why}."


class _Watch:
    """Looks for the first event in each step: a jump margin that rises, or the flow set left."""

    def __init__(self, execution: Execution) -> None:
        automaton = execution.automaton
        self._execution = execution
        self._panels = math.ceil(execution.solver.scan_points / DEGREE)
        self._guards = execution.guards
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
            self._beyond = piece, _FlowMap(self._execution, piece.t1)(piece.t1, piece.x1)
        return piece.x1 + (t - piece.t1) * self._beyond[1]

    def _margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the jump margins and, last, the margin by which the flow set is left."""
        row = self._execution.margins(t, x)
        if len(row) > self._guards:
            # Zero is inside the flow set, so it is not yet an exit.
            row[-1] = -row[-1] - self._slack or -SMALLEST
        return row

    def first_event(self, piece: FlowPiece, end: float) -> tuple[float, bool] | None:
        """Return the time of the first event in a step, and whether it is an exit from the flow set."""
        if not self._watched:
            return None
        if self._execution.automaton.has_flow_set:
            width = border(self._execution, piece.t1, piece.x1)
            self._slack = width * (NOISE / BORDER) if self._flow_first and self._seen_inside else width
        for a, b in itertools.pairwise(np.linspace(piece.t0, piece.t1, self._panels + 1)):
            for start, stop in self._parts(piece, float(a), float(b)):
                found = self._first_in_panel(piece, start, stop)
                if found is not None:
                    t, row = found
                    left = row >= self._guards
                    if left and not self._flow_first:
                        t = self._last_inside(piece, t)
                    return self._latest_of_simultaneous(piece, t, end), left
        return None

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
            inside = np.flatnonzero(self._execution.margins_along(times, piece.sample(times))[:, -1] >= 0.0)
            if inside.size:
                seen = float(times[inside[0]])
                if seen > a:
                    yield a, seen
                self._seen_inside, a = True, seen
                self._slack *= NOISE / BORDER
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
        execution = self._execution
        if self._guards == 0 or len(self._watched) == 0 or self._watched[0] >= self._guards:
            return
        then = extrapolated(execution, _FlowMap(execution, piece.t1)(piece.t1, piece.x1))
        if then is not None:
            now = self._margins(piece.t1, piece.x1)[: self._guards]
            execution.levels = np.where((now < 0.0) & (then[: self._guards] >= 0.0), now, 0.0)

    def reach_guard(self, end: float) -> FlowPiece | None:
        """Go on straight to the nearest guard where the solver cannot, if it is as near as a solver comes.

        A flow map that is defined up to a guard only, as a root is, stops every stepper some ulp before it.
        """
        execution = self._execution
        t, x = execution.t, execution.x
        rates, reach = quiet_rates(execution, t, x), min(OVERSHOOT * ulp(t), end - t)
        then = extrapolated(execution, rates)
        if self._guards == 0 or self._flow_first or then is None or not np.isfinite(rates).all():
            return None
        now = execution.margins(t, x)[: self._guards]
        rising = (now < 0.0) & (then[: self._guards] > now)
        slopes = np.where(rising, (then[: self._guards] - now) / instant(execution, t), 1.0)
        wait = np.where(rising, -now / slopes, math.inf)
        row = int(wait.argmin())
        if not wait[row] <= reach:
            return None
        stop = max(t + float(wait[row]), float(np.nextafter(t, math.inf)))
        piece = _move(execution, straight_piece(t, stop, x, x + (stop - t) * rates))
        margin = execution.margins(stop, piece.x1)[row]
        execution.levels = np.zeros(self._guards)
        execution.levels[row] = min(0.0, float(margin))
        return piece

    def go_on_to(self, end: float) -> FlowPiece:
        """Take a guard that is crossed within one instant before a time event to that event's time (rule 6)."""
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
        """Move on so that every guard that crosses within the same instant has crossed (rule 6)."""
        horizon = min(t + instant(self._execution, t), end)
        then = look(self._execution, horizon, self.state(piece, horizon), self._execution.inputs.at(horizon))
        if self._guards == 0 or then is None or np.isnan(then).any():
            return t
        now = self._margins(t, self.state(piece, t))
        crossing = (now < 0.0) & (then >= 0.0)
        rows = np.flatnonzero(crossing[: self._guards])
        return max([t, *(first_nonnegative(self._along(piece, int(row)), t, horizon) for row in rows)])

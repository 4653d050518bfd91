"""Integrate the flow map over SciPy's steppers and stop at the first event."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_model.automaton import Priority
from hybrid_model.errors import SimulationError
from hybrid_model.layout import not_finite
from hybrid_model.locate import first_nonnegative, rise_in_samples, ulp
from hybrid_model.variables import FloatArray, Kind

if TYPE_CHECKING:
    from hybrid_model.execution import Execution

SHORTEST = 16.0
"""Pieces shorter than this many ulp of t are made in one explicit Euler step: no stepper can subdivide them."""
STATELESS_STEPS = 200
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
        ``interpolate(t) -> x`` between the ends: the solver's dense output.
    """

    t0: float
    t1: float
    x0: FloatArray
    x1: FloatArray
    interpolate: Callable[[float], FloatArray]

    def at(self, t: float) -> FloatArray:
        """Return the continuous states at `t` in [t0, t1]."""
        if t <= self.t0:
            return self.x0
        return self.x1 if t >= self.t1 else self.interpolate(t)


def integrate(execution: Execution, end: float) -> tuple[list[FlowPiece], bool]:
    """Move an execution along its flow to `end`, or to the first event before it.

    Returns
    -------
    pieces : list of FlowPiece
        The steps made.
    left : bool
        Whether the flow ended by leaving the flow set.
    """
    pieces: list[FlowPiece] = []
    watch = _Watch(execution)
    if end - execution.t <= SHORTEST * ulp(end):
        x1 = execution.x + (end - execution.t) * _derivative(execution, end)(execution.t, execution.x)
        return [_move(execution, _straight(execution.t, end, execution.x, x1))], False
    for piece in _steps(execution, end):
        found = watch.first_event(piece, end)
        if found is None:
            pieces.append(_move(execution, piece))
            continue
        t, left = found
        x = piece.at(t) if t <= piece.t1 else piece.interpolate(t)
        pieces.append(_move(execution, FlowPiece(piece.t0, t, piece.x0, x, piece.interpolate)))
        return pieces, left
    return pieces, False


def _move(execution: Execution, piece: FlowPiece) -> FlowPiece:
    bad = not_finite(execution.layout.names(Kind.STATE), piece.x1)
    if bad:
        raise SimulationError(f"{execution.automaton.name}: {bad} at t = {piece.t1:.9g} s: states must stay finite.")
    execution.t, execution.x = piece.t1, piece.x1
    return piece


def _straight(t0: float, t1: float, x0: FloatArray, x1: FloatArray) -> FlowPiece:
    span = t1 - t0 or 1.0
    return FlowPiece(t0, t1, x0, x1, lambda t: x0 + (x1 - x0) * ((t - t0) / span))


def _derivative(execution: Execution, end: float) -> Callable[[float, FloatArray], FloatArray]:
    layout, automaton = execution.layout, execution.automaton
    # Inputs are continuous from the right: the last stage of a step that ends at a breakpoint belongs to the left side.
    last = float(np.nextafter(end, -np.inf)) if execution.inputs.vary else end

    def flow_map(t: float, x: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return layout.pack(Kind.STATE, automaton.derivatives(execution.values_at(min(t, last), x)))

    return flow_map


def _steps(execution: Execution, end: float) -> Any:
    """Yield the steps of the flow from the execution's state to `end`."""
    options = execution.solver
    if execution.x.size == 0:
        yield from _stateless_steps(execution, end)
        return
    flow_map = _derivative(execution, end)
    first = min(execution.next_step, end - execution.t) if execution.next_step else None
    stepper = options.method.value(
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
        problem = stepper.step()
        if stepper.status == "failed":
            raise SimulationError(_failure(execution, flow_map, stepper.t, stepper.y, problem))
        execution.next_step = getattr(stepper, "h_abs", None)
        yield FlowPiece(t0, stepper.t, x0, stepper.y, stepper.dense_output())


def _stateless_steps(execution: Execution, end: float) -> Any:
    step = min(execution.solver.max_step, (end - execution.t) / STATELESS_STEPS)
    times = np.linspace(execution.t, end, int(np.ceil((end - execution.t) / step)) + 1)
    for t0, t1 in itertools.pairwise(times):
        yield _straight(float(t0), float(t1), execution.x, execution.x)


def _failure(execution: Execution, flow_map: Any, t: float, x: FloatArray, problem: str | None) -> str:
    names = execution.layout.names(Kind.STATE)
    bad = not_finite([f"derivative of {name}" for name in names], flow_map(t, x))
    why = f"{bad}; the flow map must give finite numbers in the flow set" if bad else problem
    state = execution.layout.describe({Kind.STATE: x, Kind.DISCRETE: execution.z})
    return f"{execution.automaton.name}: the flow cannot go on at t = {t:.9g} s ({state}): {why}."


class _Watch:
    """Looks for the first event in each step: a jump margin that rises, or the flow set left."""

    def __init__(self, execution: Execution) -> None:
        automaton = execution.automaton
        self._execution = execution
        self._tolerance = execution.solver.event_tolerance
        flow_first = automaton.priority is Priority.FLOW
        # Under flow priority only the exit counts, and it counts at once; else rounding may leave the state outside.
        self._slack = 1e-15 if flow_first else self._tolerance
        self._guards = 0 if flow_first else sum(1 for _ in automaton.jump_margins(execution.values()))
        self._rows = self._guards + automaton.has_flow_set
        self._last: tuple[float, FloatArray] | None = None

    def _margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the jump margins and, last, the margin by which the flow set is left."""
        automaton = self._execution.automaton
        s = self._execution.values_at(t, x)
        with np.errstate(all="ignore"):
            row = [float(m) for m in automaton.jump_margins(s)] if self._guards else []
            if automaton.has_flow_set:
                row.append(-float(automaton.flow_margin(s)) - self._slack)
        margins = np.array(row)
        if np.any(np.isnan(margins)):
            raise SimulationError(
                f"{automaton.name}: a margin is not a number at t = {t:.9g} s: margins must be defined on every flow."
            )
        return margins

    def first_event(self, piece: FlowPiece, end: float) -> tuple[float, bool] | None:
        """Return the time of the first event in a step, and whether it is an exit from the flow set."""
        if self._rows == 0:
            return None
        times = np.linspace(piece.t0, piece.t1, self._execution.solver.scan_points + 2)
        first = self._last[1] if self._last and self._last[0] == piece.t0 else self._margins(piece.t0, piece.x0)
        table = np.array([first, *(self._margins(float(t), piece.at(float(t))) for t in times[1:])])
        self._last = (piece.t1, table[-1])
        found = [
            (first_nonnegative(margin, *bracket), row)
            for row in range(self._rows)
            for margin in [self._along(piece, row)]
            for bracket in [rise_in_samples(times, table[:, row], margin)]
            if bracket is not None
        ]
        if not found:
            return None
        t, row = min(found)
        if row >= self._guards:
            return t, True
        return self._latest_of_simultaneous(piece, t, end), False

    def _along(self, piece: FlowPiece, row: int) -> Callable[[float], float]:
        def margin(t: float) -> float:
            x = piece.at(t) if t <= piece.t1 else piece.interpolate(t)
            return float(self._margins(t, x)[row])

        return margin

    def _latest_of_simultaneous(self, piece: FlowPiece, t: float, end: float) -> float:
        """Move the instant on so that every guard that crosses within the tolerance has crossed (rule 6)."""
        horizon = min(t + self._tolerance, end)
        latest = t
        for row in range(self._guards):
            margin = self._along(piece, row)
            if margin(t) < 0.0 <= margin(horizon):
                latest = max(latest, first_nonnegative(margin, t, horizon))
        return latest

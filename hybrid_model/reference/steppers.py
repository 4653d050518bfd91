"""The steps of a flow by SciPy's steppers, and what to do where a stepper cannot go on."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from hybrid_model.declare.layout import not_finite
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import HybridModelError, SimulationError
from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.reference.point import Point
from hybrid_model.reference.progress import Progress
from hybrid_model.reference.rounding import LOOK_AFTER, left_by_rounding
from hybrid_model.reference.tolerances import reach, step_from
from hybrid_model.reference.zero_crossings import SMALLEST
from hybrid_model.scales import ABSOLUTE, UNKNOWN, tolerance_sizes, ulp

SHORTEST = 16.0
"""Pieces shorter than this many ulp of t are made in one explicit Euler step: no stepper can subdivide them."""
ATTEMPTS = 1000
"""Evaluations, a state, after which a step that has met a derivative that is not finite is given up: a stepper that
halves its step to nothing needs hundreds, and LSODA would try the same step for ever."""
STATELESS_STEPS = 25
"""Steps over a flow without continuous states, where no error estimate limits them."""


class StuckError(SimulationError):
    """The flow map is not a number wherever the solver tries to go on."""


class FlowMap:
    """The derivative as steppers call it; it remembers values that are not finite.

    A stepper may try a point outside the flow set and come back with a shorter step, so one such value is no error yet.
    """

    def __init__(self, point: Point, end: float) -> None:
        self._point = point
        # Inputs are continuous from the right: the last stage of a step that ends at a breakpoint belongs to the left.
        self._last = float(np.nextafter(end, -np.inf)) if point.inputs.vary else end
        # This is the innermost loop of a run: what does not change along a flow is looked up once.
        self._rates, self._z, self._p = point.maps.rates, point.z, point.p
        self._held = None if point.inputs.vary else point.inputs.at(point.t)
        self.forget()

    def forget(self) -> None:
        """Begin anew: a step was accepted."""
        self.trouble = ""
        self._count = 0

    def __call__(self, t: float, x: FloatArray) -> FloatArray:
        """Return dx/dt; not a number where the map cannot be evaluated."""
        point = self._point
        t = min(t, self._last)
        u = point.inputs.at(t) if self._held is None else self._held
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
            self.trouble = f"derivative of {not_finite(point.layout, Kind.STATE, rates)} at t = {t:.9g} s"
        if self.trouble:
            self._count += 1
            if self._count > ATTEMPTS * (1 + rates.size):
                raise SimulationError(_failure(point, self, t, x, None))
        return rates


def steps(point: Point, end: float) -> Any:
    """Yield the steps of the flow from the point to `end`."""
    options = point.solver
    if point.x.size == 0:
        yield from _stateless_steps(point, end)
        return
    flow_map = FlowMap(point, end)
    # Not left to the steppers: with a first derivative that is not a number some of them never return.
    flow_map(point.t, point.x)
    if flow_map.trouble:
        raise SimulationError(_failure(point, flow_map, point.t, point.x, None))
    if point.t == point.t_start or point.sizes.max() == 0.0:
        _raise_floor(point, end)
    first = min(point.next_step or _first_step(point, end), options.max_step, end - point.t)
    stepper, progress, rounds = _stepper(point, flow_map, end, first), Progress(point, end), False
    while stepper.status == "running":
        t0, x0, evaluations = stepper.t, stepper.y, stepper.nfev
        flow_map.forget()
        try:
            problem = stepper.step()
        except HybridModelError:
            raise
        except ValueError as error:
            # The linear algebra of the implicit methods refuses what is not finite.
            first = 0.1 * getattr(stepper, "h_abs", 0.0)
            if not first > SHORTEST * ulp(t0):
                raise StuckError(_failure(point, flow_map, t0, x0, str(error))) from error
            stepper = _stepper(point, flow_map, end, first)
            continue
        # LSODA calls a step done that went nowhere.
        if stepper.status != "failed" and stepper.t > t0:
            point.propose_step(getattr(stepper, "h_abs", None))
            yield FlowPiece(t0, stepper.t, x0, stepper.y, stepper.dense_output())
            stepper.atol = _absolute_tolerance(point, 0.0)
            progress.check(stepper.t - t0, stepper.atol)
            if rounds or stepper.nfev - evaluations > LOOK_AFTER:
                rounds = _raise_tolerance(point, stepper)
        elif not flow_map.trouble and _raise_floor(point, end):
            stepper = _stepper(point, flow_map, end, min(_first_step(point, end), options.max_step))
        else:
            kind = StuckError if flow_map.trouble else SimulationError
            what = "" if flow_map.trouble else progress.what_jumps(_absolute_tolerance(point, 0.0))
            raise kind(_failure(point, flow_map, t0, x0, problem or "the step length fell to zero", what))


def _raise_tolerance(point: Point, stepper: Any) -> bool:
    """Allow steps the error that rounding of the rates makes; return whether they ask for less."""
    wanted = stepper.atol
    stepper.atol = np.maximum(wanted, left_by_rounding(point, getattr(stepper, "h_abs", stepper.step_size)))
    return bool((stepper.atol > wanted + point.solver.rtol * np.abs(point.x)).any())


def _stepper(point: Point, flow_map: FlowMap, end: float, first: float) -> Any:
    """Return SciPy's stepper at the point."""
    options = point.solver
    atol = _absolute_tolerance(point, first * float(np.abs(flow_map(point.t, point.x)).max()))
    return options.stepper(
        flow_map,
        point.t,
        point.x,
        end,
        rtol=options.rtol,
        atol=atol,
        max_step=options.max_step,
        first_step=first,
    )


def _first_step(point: Point, end: float) -> float:
    """Return the length of a first step towards `end`, in s."""
    return step_from(point, end, max(float(point.sizes.max(initial=0.0)), point.floor))


def _raise_floor(point: Point, end: float) -> bool:
    """Give states that are far below where the flow may lead a size of that; return whether they got one."""
    found = reach(point, end)
    if not max(float(point.sizes.max()), point.floor) < UNKNOWN * found:
        return False
    point.raise_floor(found)
    return True


def _absolute_tolerance(point: Point, first_reach: float) -> FloatArray:
    """Return the absolute tolerance of each state: a part of its nominal value, else of its usual size.

    `first_reach` is how far the first step leads: states that start at zero have no size yet.
    """
    if point.solver.atol is not None:
        return np.full(point.x.shape, point.solver.atol)
    sizes = point.sizes
    if first_reach > sizes.max():
        sizes = np.maximum(sizes, first_reach)
    sizes = np.maximum(sizes, point.floor)
    usual = tolerance_sizes(np.maximum(sizes, SMALLEST / ABSOLUTE))
    return ABSOLUTE * np.where(np.isnan(point.nominal), usual, point.nominal)


def _stateless_steps(point: Point, end: float) -> Any:
    step = min(point.solver.max_step, (end - point.t) / STATELESS_STEPS)
    times = np.linspace(point.t, end, int(np.ceil((end - point.t) / step)) + 1)
    for t0, t1 in itertools.pairwise(times):
        yield straight_piece(float(t0), float(t1), point.x, point.x)


def _failure(point: Point, flow_map: FlowMap, t: float, x: FloatArray, problem: str | None, what: str = "") -> str:
    why = (
        f"no step meets the tolerances ({str(problem).rstrip('.')}){'; ' + what if what else ''}; where the flow map "
        "jumps, write it as modes with a switch, or let a jump or a time event happen, and where an input jumps, give "
        "it as a Signal with its breakpoints"
    )
    if flow_map.trouble:
        why = f"{flow_map.trouble}; the flow map must give finite numbers in the flow set"
        if point.automaton.has_flow_set or point.guards:
            why += ", and trial steps look a little outside: np.maximum(h, 0) under a root keeps it defined there"
    state = point.layout.describe({Kind.STATE: x, Kind.DISCRETE: point.z})
    return f"{point.automaton.name}: the flow cannot go on at t = {t:.9g} s ({state}): {why}."

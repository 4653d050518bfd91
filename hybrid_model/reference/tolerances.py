"""How far across the border of a set a state may be, where a flow leads from there, and what one instant is.

All of it is measured against the run itself (rule 12), and looked at within the run's own time only (rule 13): what
lies behind the end is extrapolated from what lies before it. A look that fails says nothing.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError
from hybrid_model.reference.first_step import first_step
from hybrid_model.reference.point import Point
from hybrid_model.reference.zero_crossings import SMALLEST
from hybrid_model.scales import PROBE, PROBE_PARTS, REACH_AT, REACH_STEP, STEADY, moves, one_instant, usual_sizes

ORDER = 7
"""Of the step that probes are a part of."""


def instant(point: Point, t: float) -> float:
    """Return in s how far apart crossings may be at `t` and still be one instant."""
    declared = point.solver.event_tolerance
    return one_instant(t, point.t_start, point.t_jump) if declared is None else declared


def look(point: Point, t: float, x: FloatArray, u: FloatArray) -> FloatArray | None:
    """Return the margins at a point that the run need not reach; None if they cannot be evaluated there."""
    if not np.isfinite(x).all():
        return None
    try:
        return point.maps.margins(t, x, point.z, u, point.p)
    except (ArithmeticError, ValueError, SimulationError):
        return None


def border(point: Point, t: float, x: FloatArray) -> float:
    """Return by how much, in its unit, the margin of the flow set may be negative at a state that counts as inside.

    By no more than it changes when the states move by a small part of their sizes, or go on for one instant.
    """
    if point.solver.event_tolerance is not None:
        return point.solver.event_tolerance
    u = point.inputs.at(t)
    # As large as the states are here: what they once were counts only where they may be rounding errors of that.
    present = np.maximum(np.abs(point.x), np.abs(x))
    sizes = np.where(np.isnan(point.nominal), usual_sizes(present, point.sizes), point.nominal)
    moved = [x + move for move in moves(sizes)]
    rates = quiet_rates(point, t, x)
    if np.isfinite(rates).all():
        moved.append(x + instant(point, t) * rates)
    here = point.margins(t, x)[-1]
    found = [look(point, t, beside, u) for beside in moved]
    widths = [0.0 if margins is None else abs(float(margins[-1] - here)) for margins in found]
    return max(widths[:2]) + sum(widths[2:]) if np.isfinite(widths).all() else 0.0


def quiet_rates(point: Point, t: float, x: FloatArray) -> FloatArray:
    """Return dx/dt at a point that the run need not reach; not numbers if it cannot be evaluated there."""
    try:
        return point.rates_at(t, x)
    except (ArithmeticError, ValueError, SimulationError):
        return np.full(x.shape, np.nan)


def one_instant_on(point: Point, rates: FloatArray) -> FloatArray | None:
    """Return the margins one instant after the present point; past the end of the run time itself stands still.

    Parameters
    ----------
    point : Point
        At the end of a flow.
    rates : ndarray
        Derivative of the states there, in the flow that ends.

    Returns
    -------
    ndarray or None
        None if they cannot be told.
    """
    t, x = point.t, point.x
    ahead = instant(point, t)
    soon = min(t + ahead, point.t_stop)
    # An input that changes by a jump meanwhile is another flow's.
    u = point.inputs.at(t if point.inputs.next_breakpoint(t) <= soon else soon)
    then = look(point, soon, x + ahead * rates, u)
    before = max(t - (t + ahead - soon), point.t_start)
    if then is None or soon == t + ahead or not before < t:
        return then
    # What time alone changes goes on as it did.
    u = point.inputs.at(t if point.inputs.next_breakpoint(before) <= t else before)
    earlier = look(point, before, x, u)
    return None if earlier is None else then + point.margins(t, x) - earlier


def leads_out(point: Point) -> bool:
    """Whether the flow leads out of the flow set from the present point, which is on its border."""
    rates = quiet_rates(point, point.t, point.x)
    if not np.isfinite(rates).all():
        return False
    size, shown = shown_size(point)
    probe = PROBE * step_from(point, point.t_stop, size)
    margin = point.flow_margin()
    for span in (probe,) if shown else (part * probe for part in PROBE_PARTS):
        change = _margin_change(point, rates, margin, span)
        if span < probe:
            twice = _margin_change(point, rates, margin, 2.0 * span)
            if change == 0.0 or not abs(twice - 2.0 * change) <= STEADY * abs(twice):
                continue
        return change < 0.0
    return False


def shown_size(point: Point) -> tuple[float, bool]:
    """Return the largest size of the states, and whether the run or a nominal value has shown it.

    Else the end of the run suggests one, which may be far too large.
    """
    size = float(point.sizes.max(initial=0.0))
    declared = not np.isnan(point.nominal).all()
    if size >= SMALLEST and (size >= point.floor or declared or point.t_jump > point.t_start):
        return size, True
    return max(size, point.floor), False


def _margin_change(point: Point, rates: FloatArray, margin: float, span: float) -> float:
    """Return how the margin of the flow set changes along the flow in a time; not a number if that cannot be told."""
    t, x = point.t, point.x
    forward = t + span <= point.t_stop
    if not forward and t - span < point.t_start:
        return math.nan
    there = t + span if forward else t - span
    u = point.inputs.at(there if forward else t)
    found = look(point, there, x + (there - t) * rates, u)
    if found is None:
        return math.nan
    change = float(found[-1]) - margin
    return change if forward else -change


def step_from(point: Point, end: float, size: float) -> float:
    """Return the length of a first step from the present point, not beyond `end`, for states of a size."""
    if not end > point.t:
        return end - point.t_start
    rates_at = functools.partial(quiet_rates, point)
    return first_step(rates_at, point.t, point.x, end, size=size, rtol=point.solver.rtol, order=ORDER)


def reach(point: Point, end: float) -> float:
    """Return how far a flow to `end` may lead: the size of states that have shown none so far.

    Looked at with the states as they are, at a few times; where the flow turns back by itself, up to there.
    """
    t, x = point.t, point.x
    found = 0.0
    for part in REACH_AT:
        span = part * (end - t)
        rates = quiet_rates(point, t + span, x)
        speed = float(np.abs(rates).max(initial=0.0))
        if not (math.isfinite(span) and 0.0 < speed < math.inf):
            continue
        step = REACH_STEP * span
        change = float(np.abs(quiet_rates(point, t + span, x + step * rates) - rates).max())
        turned = change / (speed * step)
        found = max(found, speed * (min(span, 1.0 / turned) if turned > 0.0 else span))
    return found

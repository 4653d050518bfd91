"""How far across the border of a set a state may be, where a flow leads from there, and what one instant is.

All of it is measured against the run itself (rule 12), and looked at within the run's own time only (rule 13): what
lies behind the end is extrapolated from what lies before it. A look that fails says nothing.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError
from hybrid_model.reference.first_step import first_step
from hybrid_model.scales import PROBE, REACH_AT, REACH_STEP, moves, one_instant, usual_sizes

if TYPE_CHECKING:
    from hybrid_model.reference.execution import Execution

ORDER = 7
"""Of the step that probes are a part of."""


def instant(execution: Execution, t: float) -> float:
    """Return in s how far apart crossings may be at `t` and still be one instant."""
    declared = execution.solver.event_tolerance
    return one_instant(t, execution.t_start, execution.t_jump) if declared is None else declared


def look(execution: Execution, t: float, x: FloatArray, u: FloatArray) -> FloatArray | None:
    """Return the margins at a point that the run need not reach; None if they cannot be evaluated there."""
    if not np.isfinite(x).all():
        return None
    try:
        return execution.maps.margins(t, x, execution.z, u, execution.p)
    except (ArithmeticError, ValueError, SimulationError):
        return None


def border(execution: Execution, t: float, x: FloatArray) -> float:
    """Return by how much, in its unit, the margin of the flow set may be negative at a state that counts as inside.

    By no more than it changes when the states move by a small part of their sizes, or go on for one instant.
    """
    if execution.solver.event_tolerance is not None:
        return execution.solver.event_tolerance
    u = execution.inputs.at(t)
    # As large as the states are here: what they once were counts only where they may be rounding errors of that.
    present = np.maximum(np.abs(execution.x), np.abs(x))
    sizes = np.where(np.isnan(execution.nominal), usual_sizes(present, execution.sizes), execution.nominal)
    points = [x + move for move in moves(sizes)]
    rates = quiet_rates(execution, t, x)
    if np.isfinite(rates).all():
        points.append(x + instant(execution, t) * rates)
    here = execution.margins(t, x)[-1]
    found = [look(execution, t, point, u) for point in points]
    widths = [0.0 if margins is None else abs(float(margins[-1] - here)) for margins in found]
    return max(widths[:2]) + sum(widths[2:]) if np.isfinite(widths).all() else 0.0


def quiet_rates(execution: Execution, t: float, x: FloatArray) -> FloatArray:
    """Return dx/dt at a point that the run need not reach; not numbers if it cannot be evaluated there."""
    try:
        return execution.rates_at(t, x)
    except (ArithmeticError, ValueError, SimulationError):
        return np.full(x.shape, np.nan)


def one_instant_on(execution: Execution, rates: FloatArray) -> FloatArray | None:
    """Return the margins one instant after the present point; past the end of the run time itself stands still.

    Parameters
    ----------
    execution : Execution
        At the end of a flow.
    rates : ndarray
        Derivative of the states there, in the flow that ends.

    Returns
    -------
    ndarray or None
        None if they cannot be told.
    """
    t, x = execution.t, execution.x
    ahead = instant(execution, t)
    soon = min(t + ahead, execution.t_stop)
    # An input that changes by a jump meanwhile is another flow's.
    u = execution.inputs.at(t if execution.inputs.next_breakpoint(t) <= soon else soon)
    then = look(execution, soon, x + ahead * rates, u)
    before = max(t - (t + ahead - soon), execution.t_start)
    if then is None or soon == t + ahead or not before < t:
        return then
    # What time alone changes goes on as it did.
    u = execution.inputs.at(t if execution.inputs.next_breakpoint(before) <= t else before)
    earlier = look(execution, before, x, u)
    return None if earlier is None else then + execution.margins(t, x) - earlier


def leads_out(execution: Execution) -> bool:
    """Whether the flow leads out of the flow set from the present point, which is on its border."""
    t, x = execution.t, execution.x
    rates = quiet_rates(execution, t, x)
    if not np.isfinite(rates).all():
        return False
    probe = PROBE * step_from(execution, execution.t_stop)
    forward = t + probe <= execution.t_stop
    if not forward and t - probe < execution.t_start:
        return False
    there = t + probe if forward else t - probe
    u = execution.inputs.at(there if forward else t)
    found = look(execution, there, x + (there - t) * rates, u)
    if found is None:
        return False
    change = float(found[-1]) - execution.flow_margin()
    return change < 0.0 if forward else change > 0.0


def step_from(execution: Execution, end: float) -> float:
    """Return the length of a first step from the present point, not beyond `end`."""
    if not end > execution.t:
        return end - execution.t_start
    size = max(float(execution.sizes.max(initial=0.0)), execution.floor)
    rates_at = functools.partial(quiet_rates, execution)
    return first_step(rates_at, execution.t, execution.x, end, size=size, rtol=execution.solver.rtol, order=ORDER)


def reach(execution: Execution, end: float) -> float:
    """Return how far a flow to `end` may lead: the size of states that have shown none so far.

    Looked at with the states as they are, at a few times; where the flow turns back by itself, up to there.
    """
    t, x = execution.t, execution.x
    found = 0.0
    for part in REACH_AT:
        span = part * (end - t)
        rates = quiet_rates(execution, t + span, x)
        speed = float(np.abs(rates).max(initial=0.0))
        if not (math.isfinite(span) and 0.0 < speed < math.inf):
            continue
        step = REACH_STEP * span
        change = float(np.abs(quiet_rates(execution, t + span, x + step * rates) - rates).max())
        turned = change / (speed * step)
        found = max(found, speed * (min(span, 1.0 / turned) if turned > 0.0 else span))
    return found

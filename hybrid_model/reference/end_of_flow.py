"""What rounding must not decide at the end of a flow: line 15 of docs/semantics.md (rules 6 and 13)."""

from __future__ import annotations

import math

import numpy as np

from hybrid_model.declare.transitions import Priority
from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.reference.point import Point
from hybrid_model.reference.steppers import FlowMap
from hybrid_model.reference.tolerances import instant, one_instant_on, quiet_rates
from hybrid_model.scales import OVERSHOOT, ulp


def raise_levels(point: Point, piece: FlowPiece) -> None:
    """Enable the guards that would cross within one instant if the flow did not end with this piece.

    A flow that ends at a time event may not go on to see whether a guard reaches zero a rounding later. Such a
    guard counts as crossed: it is due as long as no jump lowers its margin. Under flow priority the flow set counts
    as left likewise.
    """
    if point.guards == 0:
        return
    then = one_instant_on(point, FlowMap(point, piece.t1)(piece.t1, piece.x1))
    if then is None:
        return
    now = point.margins(point.t, point.x)
    guards, soon = now[: point.guards], then[: point.guards]
    leaves = point.automaton.priority is Priority.FLOW and point.automaton.has_flow_set and now[-1] > 0.0 > then[-1]
    point.enable_from(np.where((guards < 0.0) & (soon >= 0.0), guards, 0.0), float(now[-1]) if leaves else 0.0)


def go_on_to(point: Point, time_event: float) -> FlowPiece:
    """Take a guard that is crossed within one instant before a time event to that event's time."""
    t, x = point.t, point.x
    enabled = _guards(point) >= point.levels
    rates = FlowMap(point, time_event)(t, x)
    piece = point.follow(straight_piece(t, time_event, x, x + (time_event - t) * rates))
    now = _guards(point)
    point.enable_from(np.where(enabled & (now < 0.0), now, 0.0))
    return piece


def reach_guard(point: Point, end: float) -> FlowPiece | None:
    """Go on straight to the nearest guard where the solver cannot, if it is as near as a solver comes.

    A flow map that is defined up to a guard only, as a root is, stops every stepper some ulp before it.
    """
    t, x = point.t, point.x
    rates, reach = quiet_rates(point, t, x), min(OVERSHOOT * ulp(t), end - t)
    then = one_instant_on(point, rates)
    flow_first = point.automaton.priority is Priority.FLOW
    if point.guards == 0 or flow_first or then is None or not np.isfinite(rates).all():
        return None
    now = _guards(point)
    rising = (now < 0.0) & (then[: point.guards] > now)
    slopes = np.where(rising, (then[: point.guards] - now) / instant(point, t), 1.0)
    wait = np.where(rising, -now / slopes, math.inf)
    row = int(wait.argmin())
    if not wait[row] <= reach:
        return None
    stop = max(t + float(wait[row]), float(np.nextafter(t, math.inf)))
    piece = point.follow(straight_piece(t, stop, x, x + (stop - t) * rates))
    levels = np.zeros(point.guards)
    levels[row] = min(0.0, float(_guards(point)[row]))
    point.enable_from(levels)
    return piece


def _guards(point: Point) -> FloatArray:
    """Return the margins of the jumps on state at the point."""
    return point.margins(point.t, point.x)[: point.guards]

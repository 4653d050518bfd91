"""Flow to the first event: lines 11 to 15 of the algorithm in docs/semantics.md."""

from __future__ import annotations

from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.reference.end_of_flow import go_on_to, raise_levels, reach_guard
from hybrid_model.reference.event_location import EventLocator
from hybrid_model.reference.point import Point
from hybrid_model.reference.steppers import SHORTEST, FlowMap, StuckError, steps
from hybrid_model.reference.tolerances import instant
from hybrid_model.scales import ulp


def flow_to_first_event(point: Point, limit: float, time_event: float) -> tuple[list[FlowPiece], bool]:
    """Move a point along its flow to `limit` or the next time event, or to the first event before them.

    Returns
    -------
    pieces : list of FlowPiece
        The steps made.
    left : bool
        Whether the flow ended by leaving the flow set.
    """
    end = min(limit, time_event)  # line 11
    locator, pieces, left = EventLocator(point), list[FlowPiece](), False
    if end - point.t <= SHORTEST * max(ulp(end), ulp(point.t)):
        x1 = point.x + (end - point.t) * FlowMap(point, end)(point.t, point.x)
        pieces.append(point.follow(straight_piece(point.t, end, point.x, x1)))
    else:
        try:
            for piece in steps(point, end):  # lines 12 to 14
                event = locator.first_event(piece, end)
                if event is not None:
                    s, left = event
                    pieces.append(
                        point.follow(FlowPiece(piece.t0, s, piece.x0, locator.state(piece, s), piece.interpolate))
                    )
                    break
                pieces.append(point.follow(piece))
        except StuckError:
            reached = reach_guard(point, end)
            if reached is None:
                raise
            return [*pieces, reached], False
    if pieces and (point.t == end or point.t + instant(point, point.t) > end):  # line 15
        raise_levels(point, pieces[-1])
        if not left and point.t < end == time_event:
            pieces.append(go_on_to(point, end))
    return pieces, left

"""Integrate the flow map over SciPy's steppers and stop at the first event."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.reference.borders import instant
from hybrid_model.reference.steppers import SHORTEST, FlowMap, StuckError, move, steps
from hybrid_model.reference.watch import Watch
from hybrid_model.scales import ulp

if TYPE_CHECKING:
    from hybrid_model.reference.execution import Execution


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
    watch = Watch(execution)
    if end - execution.t <= SHORTEST * max(ulp(end), ulp(execution.t)):
        x1 = execution.x + (end - execution.t) * FlowMap(execution, end)(execution.t, execution.x)
        pieces.append(move(execution, straight_piece(execution.t, end, execution.x, x1)))
        watch.raise_levels(pieces[-1])
        return pieces, False
    try:
        for piece in steps(execution, end):
            found = watch.first_event(piece, end)
            if found is None:
                pieces.append(move(execution, piece))
                continue
            return pieces + _to_event(execution, watch, piece, found, (end, time_event)), found[1]
    except StuckError:
        reached = watch.reach_guard(end)
        if reached is None:
            raise
        return [*pieces, reached], False
    if pieces:
        watch.raise_levels(pieces[-1])
    return pieces, False


def _to_event(
    execution: Execution, watch: Watch, piece: FlowPiece, event: tuple[float, bool], ends: tuple[float, float]
) -> list[FlowPiece]:
    """Move to an event in a piece, and on to a time event if that is the same instant (rule 6)."""
    (t, left), (end, time_event) = event, ends
    pieces = [move(execution, FlowPiece(piece.t0, t, piece.x0, watch.state(piece, t), piece.interpolate))]
    if t + instant(execution, t) > end:
        watch.raise_levels(pieces[-1])
        if not left and t < end == time_event:
            pieces.append(watch.go_on_to(end))
    return pieces

"""The flow between two jumps, as a run leaves it."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece


@dataclass(frozen=True, eq=False)
class FlowRecord:
    """The flow between two jumps (of length zero in a cascade).

    Attributes
    ----------
    t0 : float
        Start in s.
    x0, z : ndarray
        What flows, at the start: the continuous states, or more in an arc from a file (see
        `hybrid_model.record.arc_values`). Discrete states throughout.
    pieces : tuple of FlowPiece
        The solver's steps, in order.
    """

    t0: float
    x0: FloatArray
    z: FloatArray
    pieces: tuple[FlowPiece, ...]

    @property
    def t1(self) -> float:
        """End in s."""
        return self.pieces[-1].t1 if self.pieces else self.t0

    @property
    def points(self) -> list[tuple[float, FloatArray]]:
        """Its samples: the start and the end of every step, as times with what flows."""
        return [(self.t0, self.x0), *((piece.t1, piece.x1) for piece in self.pieces)]

    def extended(self, pieces: Sequence[FlowPiece]) -> FlowRecord:
        """Return the flow with further steps."""
        return replace(self, pieces=(*self.pieces, *pieces))

    def at(self, t: float) -> FloatArray:
        """Return what flows at `t` in [t0, t1]."""
        if not self.pieces:
            return self.x0
        at = bisect.bisect_left(self.pieces, t, key=lambda piece: piece.t1)
        return self.pieces[min(at, len(self.pieces) - 1)].at(t)

    def cut(self, a: float, b: float) -> FlowRecord:
        """Return the part on [a, b], cut inside steps by their dense output."""
        a, b = max(a, self.t0), min(b, self.t1)
        if (a, b) == (self.t0, self.t1):
            return self
        pieces = [
            replace(piece, t0=max(a, piece.t0), t1=min(b, piece.t1), x0=piece.at(max(a, piece.t0)), x1=piece.at(b))
            for piece in self.pieces
            if max(a, piece.t0) < min(b, piece.t1)
        ]
        return FlowRecord(a, self.at(a), self.z, tuple(pieces))

"""Look ahead: run a copy of an execution to its next event, and remember the way there."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.record.recording import Recording
from hybrid_model.reference.execution import Execution

PIECES = 8
"""Solver steps of one look-ahead: what lies beyond is looked at when the time comes, for an input may change before."""


def take_internal(run: Execution) -> list[JumpRecord]:
    """Take the breakpoints that are due, jumps that nobody outside sees, and return them."""
    taken = []
    while run.stopped is None and (index := run.due()) is not None and run.automaton.jumps[index].internal:
        taken.append(run.jump(index))
    return taken


@dataclass(frozen=True, eq=False)
class _Flown:
    """A solver step on the way, with what is constant along it."""

    piece: FlowPiece
    z: FloatArray
    j: int


@dataclass
class PredictedRun:
    """The way from an execution's present to its next event, or to where the look-ahead ended.

    Attributes
    ----------
    end : Execution
        A copy of the execution, at the end of the way.
    """

    end: Execution
    _way: deque[_Flown | JumpRecord] = field(default_factory=deque)

    @classmethod
    def from_run(cls, run: Execution, t_stop: float) -> PredictedRun:
        """Look ahead from `run`, at most to `t_stop` in s and over a bounded number of solver steps.

        What is set from outside at a known time can change outputs there, so the next such time ends the look-ahead.
        """
        t_stop = min(t_stop, run.inputs.next_breakpoint(run.t))
        ahead = cls(run.copy())
        end = ahead.end
        while end.stopped is None and end.t < t_stop and end.due() is None and len(ahead._way) < PIECES:
            z, j = end.z, end.j
            ahead._way += [_Flown(piece, z, j) for piece in end.flow(t_stop)]
            ahead._way += take_internal(end)
        return ahead

    def move(self, run: Execution, t: float, recording: Recording) -> None:
        """Move `run` along the way to time `t` in s before its end, without integrating again.

        A breakpoint exactly at `t` is taken: it belongs to what comes after it.
        """
        while self._way:
            leg = self._way[0]
            if isinstance(leg, JumpRecord):
                run.move(leg.t, leg.x_after, leg.z_after, leg.j + 1)
                recording.jumped(leg)
            elif leg.piece.t1 <= t:
                run.move(leg.piece.t1, leg.piece.x1, leg.z, leg.j)
                recording.flowed([leg.piece])
            else:
                if t > leg.piece.t0:
                    x = leg.piece.at(t)
                    run.move(t, x, leg.z, leg.j)
                    recording.flowed([replace(leg.piece, t1=t, x1=x)])
                    self._way[0] = replace(leg, piece=replace(leg.piece, t0=t, x0=x))
                return
            self._way.popleft()

    def move_to_end(self, recording: Recording) -> Execution:
        """Record the rest of the way and return the execution at its end."""
        for leg in self._way:
            if isinstance(leg, JumpRecord):
                recording.jumped(leg)
            else:
                recording.flowed([leg.piece])
        self._way.clear()
        return self.end

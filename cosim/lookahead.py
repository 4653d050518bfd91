"""Look ahead: run a copy of an execution to its next event, and remember the way there."""

from __future__ import annotations

from dataclasses import dataclass, field

from hybrid_model import Execution
from hybrid_model.flow import FlowPiece
from hybrid_model.variables import FloatArray

PIECES = 32
"""Solver steps of one look-ahead: what lies beyond is looked at when the time comes, for an input may change before."""


def take_internal(run: Execution) -> None:
    """Take the breakpoints that are due: jumps that nobody outside sees."""
    while run.stopped is None and (index := run.due()) is not None and run.automaton.jumps[index].internal:
        run.jump(index)


@dataclass
class Lookahead:
    """The way from an execution's present to its next event, or to where the look-ahead ended.

    Attributes
    ----------
    end : Execution
        A copy of the execution, at the end of the way.
    """

    end: Execution
    _way: list[tuple[FlowPiece, FloatArray, int]] = field(default_factory=list)

    @classmethod
    def from_run(cls, run: Execution, t_stop: float) -> Lookahead:
        """Look ahead from `run`, at most to `t_stop` in s and over a bounded number of solver steps."""
        ahead = cls(run.copy())
        end = ahead.end
        while end.stopped is None and end.t < t_stop and end.due() is None and len(ahead._way) < PIECES:
            z, j = end.z, end.j
            ahead._way += [(piece, z, j) for piece in end.flow(t_stop)]
            take_internal(end)
        return ahead

    def move(self, run: Execution, t: float) -> None:
        """Move `run` along the way to time `t` before its end, without integrating again."""
        for piece, z, j in self._way:
            if piece.t1 >= t:
                run.move(t, piece.at(t), z, j)
                break
        self._way = [step for step in self._way if step[0].t1 > t]
        # A breakpoint exactly at t belongs to what comes after it.
        take_internal(run)

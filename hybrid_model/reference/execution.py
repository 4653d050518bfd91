"""One run in progress: a point, made to flow and to jump.

`simulate` drives it to an end time; a co-simulation drives it from communication point to communication point.
The numbered rules and lines are those of docs/semantics.md.
"""

from __future__ import annotations

import copy
import math

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.transitions import Priority
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import SimulationError
from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.reference.flow import flow_to_first_event
from hybrid_model.reference.point import Point
from hybrid_model.reference.tolerances import border, leads_out
from hybrid_model.reference.zeno import ZenoMonitor
from hybrid_model.scales import ROUNDINGS, ulp
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

_QUIET = np.errstate(all="ignore")
"""Values that are not finite are found and named by the checks of rule 10, not by numpy's warnings."""


class Execution(Point):
    """A point, and the two things that it can do: `flow` and `jump`.

    Parameters
    ----------
    automaton, t_start, t_stop, inputs, solver
        See `Point`.
    zeno : ZenoGuard
        What counts as an accumulation of jumps.

    Attributes
    ----------
    stopped : Stop or None
        Set when the run cannot go on; `message` has the particulars.
    """

    def __init__(
        self,
        automaton: Automaton,
        *,
        t_start: float = 0.0,
        t_stop: float = math.inf,
        inputs: Inputs | None = None,
        solver: Solver | None = None,
        zeno: ZenoGuard | None = None,
    ) -> None:
        super().__init__(automaton, t_start=t_start, t_stop=t_stop, inputs=inputs, solver=solver)
        self.monitor = ZenoMonitor(zeno or ZenoGuard())
        self.stopped: Stop | None = None
        self.message = ""
        self._left_flow_set = False

    def copy(self) -> Execution:
        """Return an independent copy: what happens to it does not happen here."""
        other = copy.copy(self)
        other.inputs = self.inputs.copy()
        other.monitor = copy.deepcopy(self.monitor)
        other.looks = copy.copy(self.looks)
        other.begin_at(self.x.copy(), self.z.copy())
        return other

    def stop(self, why: Stop, message: str) -> None:
        """End the run."""
        self.stopped, self.message = why, f"{self.automaton.name}: {message}"

    @_QUIET
    def due(self) -> int | None:
        """Return the number of the jump to be taken now, the first in the declared order that is due (line 6)."""
        if not self.automaton.jumps:
            return None
        due = np.zeros(len(self.automaton.jumps), dtype=bool)
        enabled = self.margins(self.t, self.x)[: self.guards] >= self.levels
        if enabled.any() and (self.automaton.priority is Priority.JUMP or self._left_flow_set or self._flow_is_over()):
            due[self.on_state] = enabled
        due[~self.on_state] = self.event_times() <= self.t
        return int(due.argmax()) if due.any() else None

    @_QUIET
    def jump(self, index: int) -> JumpRecord:
        """Take a jump: reset states at the same t, advance j (lines 7 to 9).

        Raises
        ------
        SimulationError
            If a new value is not finite or not whole, or a time event does not move on.
        """
        info, on_state = self.automaton.jumps[index], bool(self.on_state[index])
        j, x, z, times = self.j, self.x, self.z, self.event_times()
        self.reset(index)
        self._left_flow_set = False
        if not on_state:
            self._require_progress(index, times)
        message = self.monitor.record(info.name, self.t, on_state=on_state)
        if message:
            self.stop(Stop.ZENO, message)
        elif self.j >= self.monitor.guard.max_jumps:
            self.stop(Stop.JUMPS, f"{self.j} jumps by t = {self.t:.9g} s. {Stop.JUMPS.value}")
        return JumpRecord(self.t, j, index, info.name, x, z, self.x, self.z)

    @_QUIET
    def flow(self, limit: float) -> list[FlowPiece]:
        """Flow to the first event or to `limit`, whichever comes first, and never across a time event (lines 10 to 15).

        Parameters
        ----------
        limit : float
            Time in s, not before the present.

        Returns
        -------
        list of FlowPiece
            What was flown, step by step.

        Raises
        ------
        SimulationError
            If the flow map gives values that are not finite, or the solver cannot go on.
        """
        if not self.in_flow_set():
            self._block()
            return []
        self.clear_levels()
        pieces, left = flow_to_first_event(self, limit, self.next_time_event())
        self.tune()
        self._left_flow_set = left
        if left and self.due() is None and not self._outside_by_rounding():
            self._block()
        return pieces

    @_QUIET
    def drift(self, t: float) -> list[FlowPiece]:
        """Move on within one instant with the present derivative, although a jump is due.

        Simultaneous events of other parts are handled at the latest of their times (rule 6).
        """
        if t <= self.t:
            return []
        piece = straight_piece(self.t, t, self.x, self.x + (t - self.t) * self.rates_at(self.t, self.x))
        self.arrive(piece.t1, piece.x1)
        self.tune()
        return [piece]

    @_QUIET
    def next_time_event(self) -> float:
        """Return the earliest known time, in s, at which a time event or an input's breakpoint comes.

        Times that differ by rounding only are one: the latest of them.
        """
        times = [*map(float, self.event_times()), self.inputs.next_breakpoint(self.t)]
        first = min(times)
        return max(time for time in times if time <= first + ROUNDINGS * ulp(first)) if math.isfinite(first) else first

    @_QUIET
    def in_flow_set(self) -> bool:
        """Whether the state lies in the flow set, or outside by rounding only (rule 3)."""
        if not self.automaton.has_flow_set:
            return True
        margin = self.flow_margin()
        return margin >= 0.0 or margin >= -border(self, self.t, self.x)

    def _flow_is_over(self) -> bool:
        """Whether the state is outside the flow set; on the border, up to rounding, whether the flow leads out."""
        if not self.automaton.has_flow_set:
            return False
        margin = self.flow_margin()
        if margin > self.exit_level:
            return False
        return margin < -border(self, self.t, self.x) or leads_out(self)

    def _outside_by_rounding(self) -> bool:
        """Whether, under flow priority, a state that has left the flow set may flow on (rule 3)."""
        flow_first = self.automaton.priority is Priority.FLOW
        return flow_first and self.flow_margin() > -border(self, self.t, self.x)

    def _block(self) -> None:
        state = self.layout.describe({Kind.STATE: self.x, Kind.DISCRETE: self.z})
        self.stop(
            Stop.BLOCKED,
            f"Blocked: the state is in neither the flow set nor the jump set at t = {self.t:.9g} s: {state}; margin of "
            f"the flow set {self.flow_margin():.3g}. Enlarge one of the sets, or make the jump map land in their "
            "union.",
        )

    def _require_progress(self, index: int, times: FloatArray) -> None:
        was, now = times[self.row(index)], self.event_times()[self.row(index)]
        if not now > was:
            raise SimulationError(
                f"{self.automaton.name}: time event {self.automaton.jumps[index].name!r} was due at {was:.9g} s and "
                f"after its jump is due at {now:.9g} s: its jump map must move its time on."
            )

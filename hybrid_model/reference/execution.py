"""One run in progress: the state of an automaton on hybrid time, made to flow and to jump.

`simulate` drives it to an end time; a co-simulation drives it from communication point to communication point.
The numbered rules are those of docs/semantics.md.
"""

from __future__ import annotations

import copy
import math

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import not_finite
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.transitions import Priority, Trigger
from hybrid_model.declare.variables import FloatArray, Kind, Values
from hybrid_model.declare.vector_form import vector_form
from hybrid_model.errors import SimulationError
from hybrid_model.record.flow_piece import FlowPiece, straight_piece
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.reference.borders import border, leads_out
from hybrid_model.reference.flow import integrate
from hybrid_model.reference.zeno import ZenoGuard, ZenoMonitor
from hybrid_model.scales import ROUNDINGS, one_instant, ulp
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop

_QUIET = np.errstate(all="ignore")
"""Values that are not finite are found and named by the checks of rule 10, not by numpy's warnings."""


class Execution:
    """The state of a run, and the two things it can do: `flow` and `jump`.

    Parameters
    ----------
    automaton : Automaton
        What runs.
    t_start, t_stop : float
        Start time, and the time that maps and inputs are not asked beyond (rule 13), in s.
    inputs : Inputs, optional
        The input vector as a function of time; default: start values.
    solver : Solver
        Accuracy.
    zeno : ZenoGuard
        What counts as an accumulation of jumps.

    Attributes
    ----------
    t, j : float, int
        Hybrid time.
    x, z, p : ndarray
        Continuous states, discrete states, and parameters as they are at t.
    t_jump : float
        Time in s of the last jump that is no breakpoint; at first the start time.
    sizes : ndarray
        Usual size of each continuous state: the nominal value, or the largest that the run has shown.
    floor : float
        Size that all states have at least, where they have shown none by themselves.
    guards : int
        Number of jumps on state.
    levels : ndarray
        The margin from which on each jump on state is due: zero, or slightly below where the crossing is so near to the
        end of a flow that it counts as reached (rule 6).
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
        if not math.isfinite(t_start):
            raise SimulationError(f"the start time of {automaton.name} is {t_start}: give a finite number.")
        self.automaton = automaton
        self.maps = vector_form(automaton)
        self.layout = self.maps.layout
        self.inputs = inputs or Inputs(self.layout)
        self.solver = solver or Solver()
        self.monitor = ZenoMonitor(zeno or ZenoGuard())
        self._on_state = np.array([info.trigger is Trigger.STATE for info in automaton.jumps], dtype=bool)
        self.guards = int(np.count_nonzero(self._on_state))
        self.t = self.t_start = self.t_jump = float(t_start)
        self.t_stop = float(t_stop)
        self.j = 0
        self.x = self.layout.start(Kind.STATE)
        self.z = self.layout.start(Kind.DISCRETE)
        self.tune()
        self.stopped: Stop | None = None
        self.message = ""
        self.next_step: float | None = None
        self._left_flow_set = False
        self._whole = np.array(self.layout.whole, dtype=bool)
        self.nominal = np.concatenate(
            [np.full(place.variable.size, place.variable.nominal or np.nan) for place in self.layout.places[Kind.STATE]]
            or [np.zeros(0)]
        )
        self.sizes = np.zeros(self.x.size)
        self.floor = 0.0
        self.levels = self._zero_levels()
        self.compute_start()

    def compute_start(self) -> None:
        """Give the computed states their start values, from parameters, inputs and the other states."""
        self.x, self.z = self.maps.start(self.t, self.x, self.z, self.inputs.at(self.t), self.p)
        self._require_finite("at the start")
        self._require_whole("at the start")
        self.sizes = np.where(np.isnan(self.nominal), np.abs(self.x), self.nominal)

    def arrive(self, t: float, x: FloatArray) -> None:
        """Take another point of the present flow."""
        self.t, self.x = t, x
        self.sizes = self.sizes_with(x)

    def sizes_with(self, x: FloatArray) -> FloatArray:
        """Return the usual sizes of the states if the run also came to `x`."""
        return np.where(np.isnan(self.nominal), np.maximum(self.sizes, np.abs(x)), self.nominal)

    @property
    def event_tolerance(self) -> float:
        """In s: the longest time that this run has taken for one instant, see `Solver.event_tolerance`."""
        declared = self.solver.event_tolerance
        return one_instant(self.t, self.t_start, self.t_start) if declared is None else declared

    def values(self) -> Values:
        """Return all values at the present hybrid time, by name."""
        return self.values_at(self.t, self.x)

    def values_at(self, t: float, x: FloatArray) -> Values:
        """Return all values at another point of the present flow."""
        return self.layout.values(t, x, self.z, self.inputs.at(t), self.p)

    def copy(self) -> Execution:
        """Return an independent copy: what happens to it does not happen here."""
        other = copy.copy(self)
        other.inputs = self.inputs.copy()
        other.monitor = copy.deepcopy(self.monitor)
        other.x, other.z = self.x.copy(), self.z.copy()
        return other

    def tune(self) -> None:
        """Take the parameters as they are from the present time on."""
        self.p = self.inputs.parameters_at(self.t)

    # Jumps.

    @_QUIET
    def due(self) -> int | None:
        """Return the number of the first jump enabled now, in the automaton's fixed order (rules 2, 3 and 6)."""
        if not self.automaton.jumps:
            return None
        due = np.zeros(len(self.automaton.jumps), dtype=bool)
        enabled = self.margins(self.t, self.x)[: self.guards] >= self.levels
        if enabled.any() and (self.automaton.priority is Priority.JUMP or self._left_flow_set or self._flow_is_over()):
            due[self._on_state] = enabled
        due[~self._on_state] = self.event_times() <= self.t
        return int(due.argmax()) if due.any() else None

    @_QUIET
    def jump(self, index: int) -> JumpRecord:
        """Take a jump: reset states at the same t, advance j.

        Raises
        ------
        SimulationError
            If a new value is not finite, or a time event does not move on.
        """
        info = self.automaton.jumps[index]
        x, z = self.x, self.z
        times = self.event_times()
        self.x, self.z = self.maps.reset(index, self.t, x, z, self.inputs.at(self.t), self.p)
        self._require_finite(f"after jump {info.name!r} at t = {self.t:.9g} s")
        self._require_whole(f"after jump {info.name!r} at t = {self.t:.9g} s")
        record = JumpRecord(self.t, self.j, index, info.name, x, z, self.x, self.z)
        self.j += 1
        if not info.internal:
            self.t_jump = self.t
        self.arrive(self.t, self.x)
        self._left_flow_set = False
        on_state = info.trigger is Trigger.STATE
        if on_state:
            self.levels = self.levels.copy()
            self.levels[self._row(index)] = 0.0
        else:
            self._require_progress(index, times)
        message = self.monitor.record(self.automaton.name, info.name, self.t, on_state=on_state)
        if message:
            self.stopped, self.message = Stop.ZENO, message
        elif self.j >= self.monitor.guard.max_jumps:
            self.stopped = Stop.JUMPS
            self.message = f"{self.automaton.name}: {self.j} jumps by t = {self.t:.9g} s. {Stop.JUMPS.value}"
        return record

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
        if margin > 0.0:
            return False
        return margin < -border(self, self.t, self.x) or leads_out(self)

    # Rates, margins and times; the latter two must be numbers (rule 10).

    def rates_at(self, t: float, x: FloatArray) -> FloatArray:
        """Return dx/dt at a point of the present flow."""
        return self.maps.rates(t, x, self.z, self.inputs.at(t), self.p)

    def margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the margins at a point of the present flow: of the jumps on state, and then of the flow set if any."""
        return self._require_margins(self.maps.margins(t, x, self.z, self.inputs.at(t), self.p), t)

    def margins_along(self, times: FloatArray, x: FloatArray) -> FloatArray:
        """Return the margins at points of the present flow, shape (times, margins); x has shape (times, states)."""
        u = [self.inputs.at(float(t)) for t in times] if self.inputs.vary else [self.inputs.at(self.t)] * len(times)
        table = self.maps.margins_along(times, x, self.z, u, self.p)
        if np.isnan(table).any():
            at = int(np.isnan(table).any(axis=1).argmax())
            self._require_margins(table[at], float(times[at]))
        if (table == 0.0).any():
            self._refuse_indicators(table)
        return table

    def _refuse_indicators(self, table: FloatArray) -> None:
        indicators = ((table == 0.0) | (table == 1.0)).all(axis=0) & (table.min(axis=0) < table.max(axis=0))
        if indicators.any():
            row = int(indicators.argmax())
            guards = [info.name for info in self.automaton.jumps if info.trigger is Trigger.STATE]
            whose = f"jump {guards[row]!r}" if row < self.guards else "the flow set"
            raise SimulationError(
                f"{self.automaton.name}: the margin of {whose} is 0 or 1 along the flow, as if it said no or yes: "
                "return a number that is zero or above inside the set and negative outside (for h >= 0 return h)."
            )

    def flow_margin(self) -> float:
        """Return the margin of the flow set, which the automaton must have."""
        return float(self.margins(self.t, self.x)[-1])

    def event_times(self) -> FloatArray:
        """Return the absolute times in s of the jumps on time."""
        times = self.maps.event_times(self.t, self.x, self.z, self.inputs.at(self.t), self.p)
        if np.isnan(times).any():
            raise SimulationError(self._undefined("time of jump", self._name(times, on_state=False), self.t))
        return times

    def _require_margins(self, margins: FloatArray, t: float) -> FloatArray:
        if np.isnan(margins).any():
            if np.isnan(margins[: self.guards]).any():
                raise SimulationError(self._undefined("margin of jump", self._name(margins, on_state=True), t))
            raise SimulationError(self._undefined("margin of", "the flow set", t))
        return margins

    def _undefined(self, what: str, whose: str, t: float) -> str:
        return (
            f"{self.automaton.name}: the {what} {whose} is not a number at t = {t:.9g} s: it must be defined wherever "
            "a flow or a jump leads."
        )

    def _name(self, numbers: FloatArray, *, on_state: bool) -> str:
        rows = np.flatnonzero(self._on_state == on_state)
        return repr(self.automaton.jumps[rows[np.isnan(numbers[: len(rows)]).argmax()]].name)

    # Flow.

    @_QUIET
    def next_time_event(self) -> float:
        """Return the earliest known time, in s, at which a time event or an input's breakpoint comes.

        Times that differ by rounding only are one: the latest of them.
        """
        times = [*map(float, self.event_times()), self.inputs.next_breakpoint(self.t)]
        first = min(times)
        return max(time for time in times if time <= first + ROUNDINGS * ulp(first)) if math.isfinite(first) else first

    @_QUIET
    def flow(self, limit: float) -> list[FlowPiece]:
        """Flow to the first event or to `limit`, whichever comes first, and never across a time event (rule 5).

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
            self._block("the state is in neither the flow set nor the jump set")
            return []
        self.levels = self._zero_levels()
        pieces, left = integrate(self, limit, self.next_time_event())
        self.tune()
        self._left_flow_set = left
        if left and self.due() is None and not self._outside_by_rounding():
            self._block("the flow left the flow set, and the state is not in the jump set")
        return pieces

    def _outside_by_rounding(self) -> bool:
        """Whether, under flow priority, a state that has left the flow set may flow on (rule 3)."""
        flow_first = self.automaton.priority is Priority.FLOW
        return flow_first and self.flow_margin() > -border(self, self.t, self.x)

    def move(self, t: float, x: FloatArray, z: FloatArray, j: int) -> None:
        """Move to a point of a flow that a copy of this execution has already flown."""
        self.z, self.j = z, j
        self.arrive(t, x)
        self.tune()
        self.levels = self._zero_levels()

    def _zero_levels(self) -> FloatArray:
        return np.zeros(self.guards)

    def _row(self, index: int) -> int:
        """Return which of the jumps with its trigger jump `index` is."""
        return int(np.count_nonzero(self._on_state[:index] == self._on_state[index]))

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

    def _block(self, what: str) -> None:
        self.stopped = Stop.BLOCKED
        state = self.layout.describe({Kind.STATE: self.x, Kind.DISCRETE: self.z})
        margin = self.flow_margin()
        self.message = (
            f"{self.automaton.name}: {what} at t = {self.t:.9g} s: {state}; margin of the flow set {margin:.3g}. "
            "Enlarge one of the sets, or make the jump map land in their union."
        )

    def _require_finite(self, when: str) -> None:
        if not (np.isfinite(self.x).all() and np.isfinite(self.z).all()):
            bad = not_finite(self.layout, Kind.STATE, self.x) or not_finite(self.layout, Kind.DISCRETE, self.z)
            raise SimulationError(f"{self.automaton.name}: {bad} {when}: states must stay finite numbers.")

    def _require_whole(self, when: str) -> None:
        fractions = self._whole & (self.z != np.round(self.z))
        if np.any(fractions):
            k = int(np.argmax(fractions))
            raise SimulationError(
                f"{self.automaton.name}: {self.layout.names(Kind.DISCRETE)[k]} = {self.z[k]:.9g} {when}: it is "
                "declared integer and must stay a whole number."
            )

    def _require_progress(self, index: int, times: FloatArray) -> None:
        was, now = times[self._row(index)], self.event_times()[self._row(index)]
        if not now > was:
            raise SimulationError(
                f"{self.automaton.name}: time event {self.automaton.jumps[index].name!r} was due at {was:.9g} s and "
                f"after its jump is due at {now:.9g} s: its jump map must move its time on."
            )

"""One run in progress: the state of an automaton on hybrid time, made to flow and to jump.

`simulate` drives it to an end time; a co-simulation drives it from communication point to communication point.
The numbered rules are those of docs/semantics.md.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np

from hybrid_model.automaton import Automaton
from hybrid_model.errors import SimulationError
from hybrid_model.flow import FlowPiece, integrate
from hybrid_model.layout import Layout, not_finite
from hybrid_model.locate import ulp
from hybrid_model.signals import Inputs
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.transitions import Priority, Trigger
from hybrid_model.variables import FloatArray, Kind, Values
from hybrid_model.zeno import ZenoGuard, ZenoMonitor

ROUNDING = 8.0
"""Time events closer than this many ulp differ by rounding: 3 * 0.1 and 0.3 are one time."""


@dataclass(frozen=True, eq=False)
class JumpRecord:
    """One jump of a run.

    Attributes
    ----------
    t : float
        Time in s.
    j : int
        Jump count before the jump.
    index : int
        Number of the jump among the automaton's jumps.
    name : str
        Its name.
    x_before, z_before, x_after, z_after : ndarray
        Continuous and discrete states on both sides.
    """

    t: float
    j: int
    index: int
    name: str
    x_before: FloatArray
    z_before: FloatArray
    x_after: FloatArray
    z_after: FloatArray


class Execution:
    """The state of a run, and the two things it can do: `flow` and `jump`.

    Parameters
    ----------
    automaton : Automaton
        What runs.
    t_start : float
        Start time in s.
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
        Continuous states, discrete states, parameters.
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
        inputs: Inputs | None = None,
        solver: Solver | None = None,
        zeno: ZenoGuard | None = None,
    ) -> None:
        if not math.isfinite(t_start):
            raise SimulationError(f"the start time of {automaton.name} is {t_start}: give a finite number.")
        self.automaton = automaton
        self.layout = Layout(automaton)
        self.inputs = inputs or Inputs(self.layout)
        self.solver = solver or Solver()
        self.monitor = ZenoMonitor(zeno or ZenoGuard())
        self.t = float(t_start)
        self.j = 0
        self.x = self.layout.start(Kind.STATE)
        self.z = self.layout.start(Kind.DISCRETE)
        self.p = self.layout.start(Kind.PARAMETER)
        self.stopped: Stop | None = None
        self.message = ""
        self.next_step: float | None = None
        self._left_flow_set = False
        self._whole = np.repeat(
            [place.variable.integer for place in self.layout.places[Kind.DISCRETE]],
            [place.variable.size for place in self.layout.places[Kind.DISCRETE]],
        ).astype(bool)
        self.levels = self._zero_levels()
        self.compute_start()

    def compute_start(self) -> None:
        """Give the computed states their start values, from parameters, inputs and the other states."""
        start = self.automaton.start_values(self.values())
        self.x = self.layout.pack(Kind.STATE, start, self.x)
        self.z = self.layout.pack(Kind.DISCRETE, start, self.z)
        self._require_finite("at the start")

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
        other.x, other.z, other.p = self.x.copy(), self.z.copy(), self.p.copy()
        return other

    # Jumps.

    def due(self) -> int | None:
        """Return the number of the first jump enabled now, in the automaton's fixed order (rules 2, 3 and 6)."""
        if not self.automaton.jumps:
            return None
        s = self.values()
        margins, levels, times = iter(self.jump_margins(s)), iter(self.levels), iter(self.event_times(s))
        may_jump = self.automaton.priority is Priority.JUMP or self._left_flow_set or self._flow_is_over()
        for index, info in enumerate(self.automaton.jumps):
            if info.trigger is Trigger.STATE:
                if next(margins) >= next(levels) and may_jump:
                    return index
            elif next(times) <= self.t:
                return index
        return None

    def jump(self, index: int) -> JumpRecord:
        """Take a jump: reset states at the same t, advance j.

        Raises
        ------
        SimulationError
            If a new value is not finite, or a time event does not move on.
        """
        info = self.automaton.jumps[index]
        before = self.values()
        with np.errstate(all="ignore"):
            new = self.automaton.reset(index, before)
        x, z = self.x, self.z
        self.x = self.layout.pack(Kind.STATE, new, x)
        self.z = self.layout.pack(Kind.DISCRETE, new, z)
        self._require_finite(f"after jump {info.name!r} at t = {self.t:.9g} s")
        self._require_whole(f"after jump {info.name!r} at t = {self.t:.9g} s")
        record = JumpRecord(self.t, self.j, index, info.name, x, z, self.x, self.z)
        self.j += 1
        self._left_flow_set = False
        on_state = info.trigger is Trigger.STATE
        if on_state:
            self.levels = self.levels.copy()
            self.levels[self._number_of_guard(index)] = 0.0
        else:
            self._require_progress(index, before)
        message = self.monitor.record(self.automaton.name, info.name, self.t, on_state=on_state)
        if message:
            self.stopped, self.message = Stop.ZENO, message
        elif self.j >= self.monitor.guard.max_jumps:
            self.stopped = Stop.JUMPS
            self.message = f"{self.automaton.name}: {self.j} jumps by t = {self.t:.9g} s. {Stop.JUMPS.value}"
        return record

    def in_flow_set(self, tolerance: float) -> bool:
        """Whether the state lies in the flow set, or outside by no more than `tolerance`."""
        return not self.automaton.has_flow_set or self.flow_margin(self.values()) >= -tolerance

    def _flow_is_over(self) -> bool:
        """Whether the state is outside the flow set; on the border, up to rounding, whether the flow leads out."""
        if not self.automaton.has_flow_set:
            return False
        margin = self.flow_margin(self.values())
        tolerance = self.solver.event_tolerance
        if margin > 0.0 or margin < -tolerance:
            return margin < 0.0
        with np.errstate(all="ignore"):
            rates = self.layout.pack(Kind.STATE, self.automaton.derivatives(self.values()))
        return self.flow_margin(self.values_at(self.t + tolerance, self.x + tolerance * rates)) < margin

    # Margins and times, which must be numbers (rule 10).

    def jump_margins(self, s: Values) -> list[float]:
        """Return the margins of the jumps on state."""
        with np.errstate(all="ignore"):
            margins = [float(margin) for margin in self.automaton.jump_margins(s)]
        return self._require_numbers(margins, Trigger.STATE, "margin", s)

    def event_times(self, s: Values) -> list[float]:
        """Return the absolute times in s of the jumps on time."""
        with np.errstate(all="ignore"):
            times = [float(time) for time in self.automaton.event_times(s)]
        return self._require_numbers(times, Trigger.TIME, "time", s)

    def flow_margin(self, s: Values) -> float:
        """Return the margin of the flow set."""
        with np.errstate(all="ignore"):
            margin = float(self.automaton.flow_margin(s))
        if math.isnan(margin):
            raise SimulationError(
                f"{self.automaton.name}: the margin of the flow set is not a number at t = {s['t']:.9g} s: it must "
                "be defined wherever a flow or a jump leads."
            )
        return margin

    def _require_numbers(self, numbers: list[float], trigger: Trigger, what: str, s: Values) -> list[float]:
        if any(map(math.isnan, numbers)):
            names = [info.name for info in self.automaton.jumps if info.trigger is trigger]
            name = next(name for name, number in zip(names, numbers, strict=True) if math.isnan(number))
            raise SimulationError(
                f"{self.automaton.name}: the {what} of jump {name!r} is not a number at t = {s['t']:.9g} s: it must be "
                "defined wherever a flow or a jump leads."
            )
        return numbers

    # Flow.

    def next_time_event(self) -> float:
        """Return the earliest known time, in s, at which a time event or an input's breakpoint comes.

        Times that differ by rounding only are one: the latest of them.
        """
        times = [*self.event_times(self.values()), self.inputs.next_breakpoint(self.t)]
        first = min(times)
        return max(time for time in times if time <= first + ROUNDING * ulp(first)) if math.isfinite(first) else first

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
        if not self.in_flow_set(self.solver.event_tolerance):
            self._block("the state is in neither the flow set nor the jump set")
            return []
        self.levels = self._zero_levels()
        pieces, left = integrate(self, limit, self.next_time_event())
        self._left_flow_set = left
        tolerance = self.solver.event_tolerance
        # Under flow priority a state that is outside by rounding flows on while it stays so (rule 3).
        if left and self.due() is None and not self.flow_margin(self.values()) > -tolerance:
            self._block("the flow left the flow set, and the state is not in the jump set")
        return pieces

    def move(self, t: float, x: FloatArray, z: FloatArray, j: int) -> None:
        """Move to a point of a flow that a copy of this execution has already flown."""
        self.t, self.x, self.z, self.j = t, x, z, j
        self.levels = self._zero_levels()

    def _zero_levels(self) -> FloatArray:
        return np.zeros(sum(info.trigger is Trigger.STATE for info in self.automaton.jumps))

    def _number_of_guard(self, index: int) -> int:
        return sum(info.trigger is Trigger.STATE for info in self.automaton.jumps[:index])

    def drift(self, t: float) -> None:
        """Move on by no more than the event tolerance with the present derivative, although a jump is due.

        Simultaneous events of other parts are handled at the latest of their times (rule 6).
        """
        if t > self.t:
            rates = self.layout.pack(Kind.STATE, self.automaton.derivatives(self.values()))
            self.x = self.x + (t - self.t) * rates
            self.t = t

    def _block(self, what: str) -> None:
        self.stopped = Stop.BLOCKED
        state = self.layout.describe({Kind.STATE: self.x, Kind.DISCRETE: self.z})
        margin = self.flow_margin(self.values())
        self.message = (
            f"{self.automaton.name}: {what} at t = {self.t:.9g} s: {state}; margin of the flow set {margin:.3g}. "
            "Enlarge one of the sets, or make the jump map land in their union."
        )

    def _require_finite(self, when: str) -> None:
        bad = not_finite(self.layout.names(Kind.STATE), self.x) or not_finite(self.layout.names(Kind.DISCRETE), self.z)
        if bad:
            raise SimulationError(f"{self.automaton.name}: {bad} {when}: states must stay finite numbers.")

    def _require_whole(self, when: str) -> None:
        fractions = self._whole & (self.z != np.round(self.z))
        if np.any(fractions):
            k = int(np.argmax(fractions))
            raise SimulationError(
                f"{self.automaton.name}: {self.layout.names(Kind.DISCRETE)[k]} = {self.z[k]:.9g} {when}: it is "
                "declared integer and must stay a whole number."
            )

    def _require_progress(self, index: int, before: Values) -> None:
        infos = self.automaton.jumps
        at = sum(info.trigger is Trigger.TIME for info in infos[:index])
        was = self.event_times(before)[at]
        now = self.event_times(self.values())[at]
        if not now > was:
            raise SimulationError(
                f"{self.automaton.name}: time event {infos[index].name!r} was due at {was:.9g} s and after its "
                f"jump is due at {now:.9g} s: its jump map must move its time on."
            )

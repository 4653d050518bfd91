"""A Model Exchange FMU behind the slave interface: its flow is integrated here, its events are located here."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.instances.continuous_part import ContinuousPart
from hybrid_model import Solver
from hybrid_model.declare.variables import FloatArray
from hybrid_model.reference.zero_crossings import SMALLEST, first_nonnegative, first_rise, may_rise, scan_times
from hybrid_model.schedule.blocks import Step, Update
from hybrid_model.schedule.scheduler import ITERATIONS

SOLVER = Solver(rtol=1e-10)
"""What the flow of FMUs is integrated with where nothing else is given."""


LOOK = 1e-12
"""Part of the rest of a run by which is looked ahead to tell the domain of an indicator that is zero."""


class ExchangeSlave(FmuSlave):
    """A Model Exchange FMU that a master steps as one of Co-Simulation with event mode.

    Between events its derivatives are integrated by one of SciPy's steppers. Its event indicators are watched on the
    dense output of each step, by the same search as jumps of automata (`hybrid_model.reference.zero_crossings`), and a
    change of domain (z > 0 or not, FMI 3.0.2 section 3.1) is located to rounding. Where the master does not handle
    events, they are handled in the step.

    Parameters
    ----------
    name : str
        Name in the system.
    path : str or Path
        The FMU.
    validate : bool
        Whether to hold its description against the schema and fmpy's checks.
    solver : Solver, optional
        Method and accuracy; `rtol` alone of the tolerances, which states are held to by their nominal values.
    """

    kind = "ModelExchange"

    def __init__(self, name: str, path: str | Path, *, validate: bool = True, solver: Solver | None = None) -> None:
        super().__init__(name, path, validate=validate)
        self.has_event_mode = self.variable_step = True
        self.foresees = False
        self.internal_step = None
        self._solver = solver or SOLVER
        self._flow: ContinuousPart | None = None
        self._t, self._t_stop, self._due = 0.0, math.inf, math.inf
        self._x: FloatArray = np.zeros(0)
        self._atol: FloatArray = np.zeros(0)
        self._above = np.zeros(0, dtype=bool)
        self._length: float | None = None

    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """See `Slave.start`."""
        super().start(t_start, t_stop, events=events, early=early)
        self._t, self._t_stop, self._due, self._length = t_start, t_stop, math.inf, None
        description = self._file.description
        states = sum(self._variables.size(unknown.variable.derivative) for unknown in description.derivatives)
        indicators = int(description.numberOfEventIndicators)
        if description.eventIndicators:
            indicators = sum(self._variables.size(unknown.variable) for unknown in description.eventIndicators)
        completes = not bool(
            getattr(self._file.interface, "completedIntegratorStepNotNeeded", False)
            or (self._instance.major == 3 and not getattr(self._file.interface, "needsCompletedIntegratorStep", True))
        )
        self._flow = ContinuousPart(self._instance, self.calls, states, indicators, completes)

    def begin(self) -> None:
        """See `Slave.begin`."""
        super().begin()
        if not self._events:
            self._handle()
            self.enter_step_mode()

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""
        self._part.put(self._t, self._x)
        super().enter_event_mode()

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""
        part = self._part
        part.begin_flow()
        self._x = part.at()
        self._atol = self._solver.rtol * part.nominals()
        z = part.margins(self._t, self._x)
        self._above = np.where(
            z == 0.0, self._ahead(self._t + LOOK * max(self._t_stop - self._t, SMALLEST)) > 0.0, z > 0.0
        )
        self._length = None

    def update(self) -> Update:
        """See `Slave.update`."""
        made = super().update()
        if not made.again:
            self._due = math.inf if made.next_event is None else made.next_event
        return made

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`; CosimError if its events come without end."""
        if t_next <= self._t:
            return Step(self._t, False)
        for _ in range(ITERATIONS):
            event, terminate = self._advance(t_next)
            if terminate:
                return Step(self._t, event, self.calls.termination())
            if not event:
                return Step(self._t, False)
            if self._events:
                return Step(self._t, True)
            ended = self._handle_inside()
            if ended is not None or self._t >= t_next:
                return Step(self._t, False, ended)
        raise CosimError(f"{self.name} gets no further than t = {self._t:.12g} s: {ITERATIONS} events are there.")

    def save(self) -> Any:
        """See `Block.save`."""
        here = (self._t, self._due, self._x.copy(), self._atol, self._above.copy(), self._length)
        return (*super().save(), here)

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        super().restore(state)
        self._t, self._due, x, self._atol, above, self._length = state[-1]
        self._x, self._above = x.copy(), above.copy()

    @property
    def _part(self) -> ContinuousPart:
        if self._flow is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._flow

    def _handle_inside(self) -> Any:
        self.enter_event_mode()
        ended = self._handle()
        if ended is None:
            self.enter_step_mode()
        return ended

    def _handle(self) -> Any:
        """Iterate the events of this instant; return why the run ends, if it does."""
        for _ in range(ITERATIONS):
            made = self.update()
            if made.terminated is not None:
                return made.terminated
            if not made.again:
                return None
        raise CosimError(f"{self.name} asks for more than {ITERATIONS} event iterations at t = {self._t:.9g} s.")

    def _advance(self, t_next: float) -> tuple[bool, bool]:
        """Flow to `t_next` in s or the first event; return whether there is one, and whether the FMU ends the run."""
        part, goal = self._part, min(t_next, max(self._due, self._t))
        if goal > self._t and self._is_elsewhere(goal):
            return True, False  # what was set has brought an event about
        event = terminate = False
        stepper: Any = self._stepper(goal) if part.states and goal > self._t else None
        while self._t < goal and not (event or terminate):
            t0, t1 = self._t, goal
            at: Any = _Still(self._x)
            if stepper is not None:
                problem = stepper.step()
                if stepper.status == "failed":
                    raise CosimError(f"{self.name}: no step can be made at t = {t0:.9g} s: {problem}.")
                t1, at, self._length = stepper.t, stepper.dense_output(), stepper.h_abs
            found = self._first_event(t0, t1, at)
            self._t = t1 if found is None else found
            self._x = np.array(stepper.y if stepper is not None and found is None else at(self._t))
            part.put(self._t, self._x)
            event, terminate = part.completed()
            event = event or found is not None
        return event or self._t >= self._due, terminate

    def _is_elsewhere(self, goal: float) -> bool:
        """Return whether an indicator is in its other domain from the start on, and the flow does not lead back."""
        z = self._part.margins(self._t, self._x)
        off = (z != 0.0) & ((z > 0.0) != self._above)
        return bool(np.any(off)) and bool(np.any(off & ((self._ahead(goal) > 0.0) != self._above)))

    def _ahead(self, t: float) -> FloatArray:
        """Return the indicators where the rates of now lead to at `t` in s."""
        part = self._part
        z = part.margins(t, self._x + (t - self._t) * part.rates(self._t, self._x))
        part.put(self._t, self._x)
        return z

    def _stepper(self, goal: float) -> Any:
        part, left = self._part, goal - self._t
        first = None if self._length is None else min(self._length, left)
        return self._solver.stepper(
            part.rates,
            self._t,
            self._x,
            goal,
            rtol=self._solver.rtol,
            atol=self._atol,
            first_step=first,
            max_step=self._solver.max_step,
        )

    def _first_event(self, t0: float, t1: float, at: Any) -> float | None:
        """Return the first time in s at which an indicator is in its other domain; None if none is in the step."""
        part, above = self._part, self._above
        if not part.indicators:
            return None

        def margins(times: FloatArray) -> FloatArray:
            z = np.array([part.margins(float(t), np.asarray(at(float(t)))) for t in times])
            return np.where(above, -z, z - SMALLEST)

        times, first = scan_times(t0, t1), math.inf
        samples = margins(times)
        for row in np.flatnonzero(may_rise(samples)):
            bracket = first_rise(times, samples[:, row], _Row(margins, int(row)))
            if bracket is not None and bracket[0] < first:
                first = min(first, first_nonnegative(_Row(margins, int(row)).one, *bracket))
        return first if math.isfinite(first) else None


class _Row:
    """One of several margins as a function of times."""

    def __init__(self, margins: Callable[[FloatArray], FloatArray], row: int) -> None:
        self._margins, self._row = margins, row

    def __call__(self, times: FloatArray) -> FloatArray:
        return self._margins(times)[:, self._row]

    def one(self, t: float) -> float:
        """Return the margin at `t` in s."""
        return float(self(np.array([t]))[0])


class _Still:
    """A state that does not change."""

    def __init__(self, x: FloatArray) -> None:
        self._x = x

    def __call__(self, t: float) -> FloatArray:
        return self._x

"""Runs of an FMU over its default experiment: co-simulation, model exchange, scheduled execution."""

from __future__ import annotations

import math
from typing import Any

from fmu.check.child.calls import DISCARD, OK, WARNING, Recorder, Variable

ITERATIONS = 100
"""Event iterations at one instant."""
OUTPUTS = 500
"""Outputs that are read at each communication point; all variables are read at the first one."""
RETURNS = 10_000
"""Returns of steps, over a whole run, before the next communication point."""

Bits = tuple[float, tuple[bytes, ...]]


class Run:
    """What all interface types share: start values, initialisation, reading."""

    def __init__(self, fmu: Any, recorder: Recorder) -> None:
        self.fmu, self.recorder, self.plan = fmu, recorder, fmu.plan
        self.t = float(self.plan["start"])
        self.next_time: float | None = None
        self.ended = False
        self.readable = [v for v in fmu.variables if v.readable]
        self.outputs = [v for v in self.readable if v.causality == "output"][:OUTPUTS]
        self._nan: set[str] = set()

    def initialize(self) -> None:
        """Set the start values, and pass initialisation."""
        for variable in self.fmu.variables:
            if variable.start is not None:
                self.fmu.set(variable)
        self.fmu.enter_initialization()
        self.fmu.do("ExitInitializationMode")

    def iterate(self) -> None:
        """Iterate over events until nothing changes."""
        next_time = None
        for _ in range(ITERATIONS):
            again, terminate, next_time = self.fmu.update()
            self.ended = self.ended or terminate
            if not again or self.ended:
                break
        else:
            raise self.recorder.stop(
                "run.iteration",
                f"At t = {self.t!r} the event iteration wants to go on after {ITERATIONS} updates: it must end.",
            )
        if next_time is not None and not next_time >= self.t - 1e-9 * max(1.0, abs(self.t)):
            self.recorder.find(
                "error", "run.next_time", f"At t = {self.t!r} the next event time {next_time!r} lies in the past."
            )
            next_time = None
        self.next_time = next_time

    def read_all(self) -> list[bytes]:
        """Read every declared variable, twice: reading must change nothing."""
        first = [self.fmu.get(variable)[1] for variable in self.readable]
        second = [self.fmu.get(variable)[1] for variable in self.readable]
        for variable, before, after in zip(self.readable, first, second, strict=True):
            if before != after:
                self.recorder.find(
                    "error", "run.getter", f"Reading {variable.name!r} twice gives two values: getters must not act."
                )
        return first

    def point(self) -> Bits:
        """Read the outputs; a NaN among them is a finding."""
        found = []
        for variable in self.outputs:
            values, bits = self.fmu.get(variable)
            found.append(bits)
            self.require_numbers(f"The output {variable.name!r}", values)
        return self.t, tuple(found)

    def require_numbers(self, name: str, values: list[Any]) -> None:
        """Report the first NaN of something."""
        if name not in self._nan and any(isinstance(value, float) and math.isnan(value) for value in values):
            self._nan.add(name)
            self.recorder.find("error", "run.nan", f"{name} is NaN at t = {self.t!r} without an error status.")

    def mark(self) -> tuple[Any, ...]:
        """Return what the importer must restore beside the FMU state."""
        return self.t, self.next_time, self.ended

    def back(self, mark: tuple[Any, ...]) -> None:
        """Restore it."""
        self.t, self.next_time, self.ended = mark[:3]

    def begin(self) -> None:
        """From instantiated to the first communication point."""
        raise NotImplementedError

    def advance(self, points: int) -> list[Bits]:
        """Go on by some communication points; return the outputs at each."""
        raise NotImplementedError


class CoSimulation(Run):
    """Communication points at a fixed distance, events where the FMU has them."""

    def __init__(self, fmu: Any, recorder: Recorder) -> None:
        super().__init__(fmu, recorder)
        self.passed = 0
        self.returns = 0

    def begin(self) -> None:
        """See `Run.begin`."""
        self.initialize()
        if self.fmu.events:
            self.iterate()
            if not self.ended:
                self.fmu.do("EnterStepMode")

    def advance(self, points: int) -> list[Bits]:
        """See `Run.advance`."""
        found = []
        for _ in range(points):
            if self.ended:
                break
            self.passed += 1
            self._to(self.plan["start"] + self.passed * self.plan["step"])
            found.append(self.point())
        return found

    def _to(self, target: float) -> None:
        while not self.ended and target - self.t > 1e-12 * max(1.0, abs(target)):
            goal = target
            if self.next_time is not None and self.plan["variable_step"] and self.t < self.next_time < target:
                goal = self.next_time
            self._step(goal)
            self.returns += 1
            if self.returns > RETURNS:
                raise self.recorder.stop(
                    "run.progress", f"After {RETURNS} steps t is only {self.t!r}: it makes no progress."
                )

    def _step(self, goal: float) -> None:
        h = goal - self.t
        step = self.fmu.step(self.t, h)
        if step.status not in (OK, WARNING, DISCARD):
            raise self.recorder.stop(
                "run.step",
                f"doStep({self.t!r}, {h!r}) returns {self.fmu.status(step.status)} within the default "
                f"experiment: {self.fmu.said()}.",
            )
        self._require_honest_time(step, goal)
        self.t = goal if step.time == goal or not step.early else step.time
        if step.status == DISCARD:
            self.recorder.find(
                "note",
                "run.discard",
                f"doStep discards at t = {step.time!r}: the run of the check ends there ({self.fmu.said()}).",
            )
            self.ended = True
        elif step.terminate:
            self.recorder.find(
                "note", "run.ended", f"The FMU ends the simulation at t = {self.t!r} ({self.fmu.said()})."
            )
            self.ended = True
        elif self.fmu.events and (step.event or (self.next_time is not None and self.t >= self.next_time)):
            self.fmu.do("EnterEventMode")
            self.iterate()
            if not self.ended:
                self.fmu.do("EnterStepMode")

    def _require_honest_time(self, step: Any, goal: float) -> None:
        slack = 1e-9 * max(1.0, abs(goal))
        wrong = None
        if not math.isfinite(step.time) or step.time > goal + slack or step.time < self.t - slack:
            wrong = "it must lie within the step"
        elif not step.early and abs(step.time - goal) > slack and not step.terminate:
            wrong = "without an early return it must be the end of the step"
        elif step.early and not self.fmu.events and step.status != DISCARD:
            wrong = "early return was not allowed"
        if wrong:
            raise self.recorder.stop(
                "run.time",
                f"doStep from {self.t!r} to {goal!r} reports the last successful time {step.time!r}: {wrong}.",
            )

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), self.passed)

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.passed = mark[3]


class ModelExchange(Run):
    """Explicit Euler steps, short ones; events where indicators change sign or the FMU asks for them."""

    def begin(self) -> None:
        """See `Run.begin`."""
        self.initialize()
        self.iterate()
        self.states, self.indicators = self.fmu.counts()
        if (self.states, self.indicators) != (self.plan["states"], self.plan["indicators"]):
            self.recorder.find(
                "error",
                "run.counts",
                f"The FMU has {self.states} continuous states and {self.indicators} event indicators, its description "
                f"{self.plan['states']} and {self.plan['indicators']}.",
            )
        if not self.ended:
            self._go_on()

    def _go_on(self) -> None:
        self.fmu.do("EnterContinuousTimeMode")
        self._refresh()

    def _refresh(self) -> None:
        self.x = self.fmu.vector("states", self.states)
        self.z = self.fmu.vector("indicators", self.indicators)
        nominals = self.fmu.vector("nominals", self.states)
        if any(not nominal > 0.0 for nominal in nominals):
            self.recorder.find(
                "error", "run.nominals", f"The nominal values of the states are {nominals[:10]}: they must be positive."
            )

    def advance(self, points: int) -> list[Bits]:
        """See `Run.advance`."""
        found = []
        for _ in range(points):
            if self.ended:
                break
            self._step(self.plan["euler_step"])
            found.append(self.point())
        return found

    def _step(self, h: float) -> None:
        goal = self.t + h
        if self.next_time is not None and self.t < self.next_time < goal:
            goal = self.next_time
        derivatives = self.fmu.vector("derivatives", self.states)
        self.require_numbers("A state derivative", derivatives)
        self.require_numbers("An event indicator", self.z)
        self.x = [x + (goal - self.t) * slope for x, slope in zip(self.x, derivatives, strict=True)]
        self.t = goal
        self.fmu.set_states(self.t, self.x)
        z = self.fmu.vector("indicators", self.indicators)
        crossed = any((before > 0.0) != (after > 0.0) for before, after in zip(self.z, z, strict=True))
        self.z = z
        event = terminate = False
        if self.plan["completed_step"]:
            event, terminate = self.fmu.completed_step()
        if terminate:
            self.ended = True
        elif event or crossed or (self.next_time is not None and self.t >= self.next_time):
            self.fmu.do("EnterEventMode")
            self.iterate()
            if not self.ended:
                self._go_on()
        if self.ended:
            self.recorder.find(
                "note", "run.ended", f"The FMU ends the simulation at t = {self.t!r} ({self.fmu.said()})."
            )

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), list(self.x), list(self.z))

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.x, self.z = list(mark[3]), list(mark[4])


class ScheduledExecution(Run):
    """Each input clock is activated once a point, in the order of the description."""

    def __init__(self, fmu: Any, recorder: Recorder) -> None:
        super().__init__(fmu, recorder)
        self.clocks: list[Variable] = [v for v in fmu.variables if v.type == "Clock" and v.causality == "input"]
        self.passed = 0

    def begin(self) -> None:
        """See `Run.begin`."""
        self.initialize()

    def advance(self, points: int) -> list[Bits]:
        """See `Run.advance`."""
        found = []
        for _ in range(points):
            self.t = self.plan["start"] + self.passed * self.plan["step"]
            self.passed += 1
            for clock in self.clocks:
                self.fmu.activate(clock, self.t)
            found.append(self.point())
        return found

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), self.passed)

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.passed = mark[3]


RUNS: dict[str, type[Run]] = {
    "CoSimulation": CoSimulation,
    "ModelExchange": ModelExchange,
    "ScheduledExecution": ScheduledExecution,
}

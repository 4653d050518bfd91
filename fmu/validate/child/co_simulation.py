"""A run of a Co-Simulation FMU."""

from __future__ import annotations

import math
from typing import Any

from fmu.validate.child.calls import DISCARD, OK, WARNING, Recorder
from fmu.validate.child.run import RETURNS, Bits, Run

LAST_TIME = "FMI 3.0.2 section 4.2.1: lastSuccessfulTime, earlyReturn"


class CoSimulation(Run):
    """Communication points at a fixed distance, events where the FMU has them."""

    def __init__(self, fmu: Any, recorder: Recorder) -> None:
        super().__init__(fmu, recorder)
        self.passed = 0
        self.returns = 0
        self.apart = False

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
            # The last sum may be larger than the stop time by rounding.
            self._to(min(self.plan["start"] + self.passed * self.plan["step"], self.plan["stop"]))
            found.append(self.point())
        return found

    def _to(self, target: float) -> None:
        while not self.ended and target - self.t > 1e-12 * max(1.0, abs(target)):
            goal = target
            if self.next_time is not None and self.plan["variable_step"] and self.t < self.next_time < target:
                goal = self.next_time
            self._step(goal)
            self.returns += 1
            if self.returns > RETURNS and not self.ended:
                self._give_up()

    def _give_up(self) -> None:
        if self.t - self.plan["start"] < 1e-3 * (self.plan["stop"] - self.plan["start"]):
            raise self.recorder.stop(
                "run.progress", f"After {RETURNS} steps t is only {self.t!r}: it makes no progress."
            )
        text = f"After {RETURNS} steps, many for events, the run of the check ends at t = {self.t!r}."
        self.recorder.find("note", "run.long", text)
        self.ended = True

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
            self.end()
        elif self.fmu.events and (step.event or (self.next_time is not None and self.t >= self.next_time)):
            self.fmu.do("EnterEventMode")
            self.iterate()
            if not self.ended:
                self.fmu.do("EnterStepMode")

    def _require_honest_time(self, step: Any, goal: float) -> None:
        slack = 1e-9 * max(1.0, abs(goal))
        wrong = None
        if not math.isfinite(step.time):
            wrong = "it must be a number"
        elif step.early and not self.fmu.events and step.status != DISCARD:
            wrong = "early return was not allowed"
        elif step.early and not self.t - slack <= step.time <= goal + slack:
            wrong = "after an early return it must lie within the step"
        text = f"doStep from {self.t!r} to {goal!r} reports the last successful time {step.time!r}"
        if wrong:
            raise self.recorder.stop("run.time", f"{text}: {wrong}.", LAST_TIME)
        if not step.early and not step.terminate and abs(step.time - goal) > slack and not self.apart:
            self.apart = True
            remark = "without an early return the two may differ, but importers may go on from the one or the other"
            self.recorder.find("warning", "run.time", f"{text}: {remark}.", LAST_TIME)

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), self.passed)

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.passed = mark[3]

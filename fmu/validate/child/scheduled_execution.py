"""A run of a Scheduled Execution FMU."""

from __future__ import annotations

from typing import Any

from fmu.validate.child.calls import Recorder, Variable
from fmu.validate.child.run import Bits, Run


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

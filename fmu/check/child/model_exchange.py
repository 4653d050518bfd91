"""A run of a Model Exchange FMU."""

from __future__ import annotations

from typing import Any

from fmu.check.child.run import Bits, Run


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
            self.end()
        elif event or crossed or (self.next_time is not None and self.t >= self.next_time):
            self.fmu.do("EnterEventMode")
            self.iterate()
            if not self.ended:
                self._go_on()

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), list(self.x), list(self.z))

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.x, self.z = list(mark[3]), list(mark[4])

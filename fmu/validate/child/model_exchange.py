"""A run of a Model Exchange FMU."""

from __future__ import annotations

import math
from typing import Any

from fmu.validate.child.run import Bits, Run

_SUBSTEPS = 10
"""Steps within one point; a stiff model gets less far in them."""
_RELATIVE, _ABSOLUTE = 1e-3, 1e-6
"""Error of a step allowed: of a state's value, and of its nominal value."""
_SHORTEST = 1e-12
"""Step, of the longest one or of t, that is not tried any more."""


class ModelExchange(Run):
    """Explicit Euler steps, as short as their error asks for, so that stiff models stay stable.

    Events are entered where indicators change sign or the FMU asks for them; accuracy is not needed here.
    """

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
        self.h = float(self.plan["longest_step"])
        if not self.ended:
            self._go_on()

    def _go_on(self) -> None:
        self.fmu.do("EnterContinuousTimeMode")
        self.x = self.fmu.vector("states", self.states)
        self.z = self.fmu.vector("indicators", self.indicators)
        self.nominals = self.fmu.vector("nominals", self.states)
        if any(not nominal > 0.0 for nominal in self.nominals):
            self.recorder.find(
                "error",
                "run.nominals",
                f"The nominal values of the states are {self.nominals[:10]}: they must be positive.",
            )
            self.nominals = [1.0] * self.states

    def advance(self, points: int) -> list[Bits]:
        """See `Run.advance`."""
        found = []
        for _ in range(points):
            if self.ended:
                break
            goal = self.t + self.plan["longest_step"]
            for _ in range(_SUBSTEPS):
                if not self.ended and self.t < goal:
                    self._step(goal)
            found.append(self.point())
        return found

    def _step(self, goal: float) -> None:
        if self.next_time is not None and self.t < self.next_time < goal:
            goal = self.next_time
        slopes = self.fmu.vector("derivatives", self.states)
        self.require_numbers("A state derivative", slopes)
        self.require_numbers("An event indicator", self.z)
        if not self._integrate(goal, slopes):
            self.ended = True
            return
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

    def _integrate(self, goal: float, slopes: list[float]) -> bool:
        """Take a step of which the error is small; tell whether there is one."""
        x, t = self.x, self.t
        shortest = _SHORTEST * max(abs(t), self.plan["longest_step"])
        while True:
            self.t = goal if goal - t <= self.h else t + self.h
            h = self.t - t
            self.x = [value + h * slope for value, slope in zip(x, slopes, strict=True)]
            self.fmu.set_states(self.t, self.x)
            error = self._error(h, slopes)
            if error <= 1.0:
                # The error grows with the square of the step; a step cut at the goal says nothing against a long one.
                self.h = min(max(self.h, h * min(4.0, 0.9 / math.sqrt(max(error, 1e-4)))), self.plan["longest_step"])
                return True
            self.h = h * max(0.1, 0.9 / math.sqrt(error)) if math.isfinite(error) else h / 4.0
            if self.h < shortest:
                break
        if all(map(math.isfinite, slopes)):
            text = f"From t = {t!r} on no step is short enough for an explicit method: the run of the check ends there."
            self.recorder.find("note", "run.stiff", text)
        return False

    def _error(self, h: float, slopes: list[float]) -> float:
        """Return the error of a step, in units of what is allowed; infinite where the FMU has no slopes after it."""
        after = self.fmu.trial_derivatives(self.states)
        if after is None or not all(map(math.isfinite, after)):
            return math.inf
        errors = (
            h / 2.0 * abs(one - other) / (_RELATIVE * abs(value) + _ABSOLUTE * nominal)
            for one, other, value, nominal in zip(slopes, after, self.x, self.nominals, strict=True)
        )
        return max(errors, default=0.0)

    def mark(self) -> tuple[Any, ...]:
        """See `Run.mark`."""
        return (*super().mark(), list(self.x), list(self.z), self.h)

    def back(self, mark: tuple[Any, ...]) -> None:
        """See `Run.back`."""
        super().back(mark)
        self.x, self.z, self.h = list(mark[3]), list(mark[4]), mark[5]

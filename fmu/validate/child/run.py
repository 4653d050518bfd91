"""A run of an FMU over its default experiment: what all interface types share."""

from __future__ import annotations

import math
from typing import Any

from fmu.validate.child.calls import Recorder

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
            if terminate:
                self.end()
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

    def end(self) -> None:
        """Take note that the FMU ends the simulation."""
        self.ended = True
        self.recorder.find("note", "run.ended", f"The FMU ends the simulation at t = {self.t!r} ({self.fmu.said()}).")

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

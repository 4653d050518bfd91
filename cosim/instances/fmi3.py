"""Co-Simulation of FMI 3.0, over fmpy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmpy.fmi3 import FMU3Slave

from cosim.instances.instance import Advance, FmuInstance, Getter
from fmu.importer.loading import load_binary
from fmu.standard.value_types import accessor


class Fmi3Instance(FmuInstance):
    """An instance of an FMU of FMI 3.0; see `FmuInstance`."""

    def _load(self, description: Any, folder: Path, **arguments: Any) -> Any:
        return load_binary(FMU3Slave, folder, 3, guid=description.instantiationToken, **arguments)

    def instantiate(self, events: bool) -> None:
        """See `FmuInstance.instantiate`."""
        self.fmu.instantiate(
            eventModeUsed=events,
            earlyReturnAllowed=events,
            logMessage=lambda environment, status, category, message: self.log(status, _text(message)),
        )

    def enter_initialization(self, t_start: float, t_stop: float) -> None:
        """See `FmuInstance.enter_initialization`."""
        self.fmu.enterInitializationMode(startTime=t_start, stopTime=t_stop)

    def getter(self, variable: Any, size: int) -> Getter:
        """See `FmuInstance.getter`."""
        return getattr(self.fmu, f"get{accessor(variable.type, 3)}"), ([variable.valueReference], size)

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """See `FmuInstance.set`."""
        getattr(self.fmu, f"set{accessor(variable.type, 3)}")([variable.valueReference], values)

    def step(self, t: float, size: float) -> Advance:
        """See `FmuInstance.step`."""
        event, terminate, early, reached = self.fmu.doStep(t, size)
        return Advance(reached, event, terminate, early)

    def save(self) -> Any:
        """See `FmuInstance.save`."""
        return self.fmu.getFMUState()

    def restore(self, state: Any) -> None:
        """See `FmuInstance.restore`."""
        self.fmu.setFMUState(state)

    def release(self, state: Any) -> None:
        """See `FmuInstance.release`."""
        self.fmu.freeFMUState(state)

    def free(self) -> None:
        """See `FmuInstance.free`."""
        self.fmu.fmi3FreeInstance(self.fmu.component)

    def ticks(self, references: Sequence[int]) -> list[bool]:
        """See `FmuInstance.ticks`."""
        return list(self.fmu.getClock(references))

    def update(self) -> tuple[bool, bool, float | None]:
        """See `FmuInstance.update`."""
        again, terminate, _, _, defined, time = self.fmu.updateDiscreteStates()
        return again, terminate, time if defined else None

    def enter_configuration(self) -> None:
        """See `FmuInstance.enter_configuration`."""
        self.fmu.enterConfigurationMode()

    def exit_configuration(self) -> None:
        """See `FmuInstance.exit_configuration`."""
        self.fmu.exitConfigurationMode()

    def enter_event_mode(self) -> None:
        """See `FmuInstance.enter_event_mode`."""
        self.fmu.enterEventMode()

    def enter_step_mode(self) -> None:
        """See `FmuInstance.enter_step_mode`."""
        self.fmu.enterStepMode()


def _text(message: bytes | None) -> str:
    return (message or b"").decode("utf-8", "replace")

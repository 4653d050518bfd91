"""Co-Simulation of FMI 2.0, over fmpy: no event mode, but steps may end early, with fmi2Discard."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Discard, fmi2LastSuccessfulTime, fmi2Terminated

from cosim.instances.instance import Advance, FmuInstance, Getter
from fmu.importer.callbacks import Callbacks
from fmu.importer.loading import load_binary
from fmu.standard.value_types import accessor


class Fmi2Instance(FmuInstance):
    """An instance of an FMU of FMI 2.0; see `FmuInstance`."""

    def _load(self, description: Any, folder: Path, **arguments: Any) -> Any:
        return load_binary(FMU2Slave, folder, 2, guid=description.guid, **arguments)

    def instantiate(self, events: bool) -> None:
        """See `FmuInstance.instantiate`."""
        if events:
            raise self._no_events()
        self._callbacks = Callbacks(self.log, self.name)
        try:
            self.fmu.instantiate(callbacks=self._callbacks.functions)
        except Exception:
            self._callbacks.release()
            raise

    def enter_initialization(self, t_start: float, t_stop: float) -> None:
        """See `FmuInstance.enter_initialization`."""
        self.fmu.setupExperiment(startTime=t_start, stopTime=t_stop)
        self.fmu.enterInitializationMode()

    def getter(self, variable: Any, size: int) -> Getter:
        """See `FmuInstance.getter`."""
        return getattr(self.fmu, f"get{accessor(variable.type, 2)}"), ([variable.valueReference],)

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """See `FmuInstance.set`."""
        getattr(self.fmu, f"set{accessor(variable.type, 2)}")([variable.valueReference], values)

    def step(self, t: float, size: float) -> Advance:
        """See `FmuInstance.step`."""
        try:
            self.fmu.doStep(t, size)
        except FMICallException as error:
            if error.status != fmi2Discard:
                raise
            ended = self._status(self.fmu.getBooleanStatus, fmi2Terminated, False)
            return Advance(self._status(self.fmu.getRealStatus, fmi2LastSuccessfulTime, t), False, ended, True)
        return Advance(t + size, False, False, False)

    @staticmethod
    def _status(ask: Callable[[int], Any], kind: int, otherwise: Any) -> Any:
        """Return what an FMU says of a discarded step; many have no answer."""
        try:
            return ask(kind)
        except FMICallException:
            return otherwise

    def save(self) -> Any:
        """See `FmuInstance.save`."""
        return self.fmu.getFMUstate()

    def restore(self, state: Any) -> None:
        """See `FmuInstance.restore`."""
        self.fmu.setFMUstate(state)

    def release(self, state: Any) -> None:
        """See `FmuInstance.release`."""
        self.fmu.freeFMUstate(state)

    def free(self) -> None:
        """See `FmuInstance.free`."""
        self.fmu.fmi2FreeInstance(self.fmu.component)
        self._callbacks.release()

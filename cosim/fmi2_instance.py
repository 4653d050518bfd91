"""Co-Simulation of FMI 2.0, over fmpy: no event mode, but steps may end early, with fmi2Discard."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Sequence
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    addLoggerProxy,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Discard,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
    printLogMessage,
)

from cosim.fmu_instance import Advance, FmuInstance, Getter

# fmpy formats the messages of all FMUs for one logger of the process, the last that it was given. So there is one
# logger, and it tells the instances apart by the environment that each gives to its FMU.
_listeners: dict[int, Callable[[str], None]] = {}
_environments = itertools.count(1)


class Fmi2Instance(FmuInstance):
    """An instance of an FMU of FMI 2.0; see `FmuInstance`."""

    def _load(self, description: Any, **arguments: Any) -> Any:
        return FMU2Slave(guid=description.guid, **arguments)

    def instantiate(self, events: bool) -> None:
        """See `FmuInstance.instantiate`."""
        if events:
            raise self._no_events()
        self._environment = next(_environments)
        _listeners[self._environment] = self.log
        callbacks = fmi2CallbackFunctions(logger=_logger, componentEnvironment=self._environment)
        addLoggerProxy(ctypes.byref(callbacks))
        try:
            self.fmu.instantiate(callbacks=callbacks)
        except Exception:
            del _listeners[self._environment]
            raise

    def enter_initialization(self, t_start: float, t_stop: float) -> None:
        """See `FmuInstance.enter_initialization`."""
        self.fmu.setupExperiment(startTime=t_start, stopTime=t_stop)
        self.fmu.enterInitializationMode()

    def getter(self, variable: Any, size: int) -> Getter:
        """See `FmuInstance.getter`."""
        return getattr(self.fmu, f"get{_access(variable)}"), ([variable.valueReference],)

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """See `FmuInstance.set`."""
        getattr(self.fmu, f"set{_access(variable)}")([variable.valueReference], values)

    def step(self, t: float, t_next: float) -> Advance:
        """See `FmuInstance.step`."""
        try:
            self.fmu.doStep(t, t_next - t)
        except FMICallException as error:
            if error.status != fmi2Discard:
                raise
            ended = self.fmu.getBooleanStatus(fmi2Terminated)
            return Advance(self.fmu.getRealStatus(fmi2LastSuccessfulTime), False, ended, True)
        return Advance(t_next, False, False, False)

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
        del _listeners[self._environment]


def _log(environment: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    listener = _listeners.get(environment or 0)
    if listener is None:  # of somebody else's instance, made by fmpy
        printLogMessage(environment, name, status, category, message)
    else:
        listener((message or b"").decode("utf-8", "replace"))


_logger = fmi2CallbackLoggerTYPE(_log)


def _access(variable: Any) -> str:
    return "Integer" if variable.type == "Enumeration" else str(variable.type)

"""An FMI 3.0 Co-Simulation FMU behind the slave interface, over fmpy."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

from cosim.errors import CosimError
from cosim.slave import Port, Slave, Step, Termination, Update


class FmuSlave(Slave):
    """An FMU that a master steps.

    Loading an FMU runs its native code in this process: load only FMUs that you trust.

    Parameters
    ----------
    name : str
        Name in the system.
    path : str or Path
        The FMU.

    Raises
    ------
    CosimError
        If the file is not an FMI 3.0 Co-Simulation FMU with a binary for this machine.
    """

    def __init__(self, name: str, path: str | Path) -> None:
        try:
            description = read_model_description(str(path))
        except Exception as error:
            raise CosimError(f"{name}: {path} cannot be read as an FMU: {error}") from error
        if not description.fmiVersion.startswith("3.") or description.coSimulation is None:
            raise CosimError(
                f"{name}: {path} is not an FMI 3.0 Co-Simulation FMU (it says FMI {description.fmiVersion}): "
                "export it as one."
            )
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self._elements = {name: place for v in description.modelVariables for name, place in _elements(v)}
        scalars = [v for v in description.modelVariables if v.type != "Clock"]
        super().__init__(
            name,
            [port for v in scalars if v.causality == "input" for port in _ports(v)],
            [port for v in scalars if v.causality == "output" for port in _ports(v)],
            [v.name for v in description.modelVariables if v.type == "Clock" and v.causality == "output"],
        )
        self.has_event_mode = bool(description.coSimulation.hasEventMode)
        self.can_restore = bool(description.coSimulation.canGetAndSetFMUstate)
        experiment = description.defaultExperiment
        self.default_stop_time = float(experiment.stopTime) if experiment and experiment.stopTime else None
        self._clock_references = [self._variables[clock].valueReference for clock in self.clocks]
        self._messages: list[str] = []
        self._token = description.instantiationToken
        self._identifier = description.coSimulation.modelIdentifier
        self._path = str(path)
        self._library: FMU3Slave | None = None
        self._fmu: FMU3Slave | None = None
        self._starts: dict[str, float] = {}
        self._getters: dict[str, tuple[Callable[..., list[Any]], tuple[Any, ...], int]] = {}

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return list(self._elements)

    def set(self, name: str, value: float) -> None:
        """See `Slave.set`."""
        if name not in self._elements:
            raise self.unknown(name)
        if self._fmu is None:
            self._starts[name] = value
        else:
            self._write(name, value)

    def get(self, name: str) -> float:
        """See `Slave.get`."""
        if name not in self._getters:
            if name not in self._elements:
                raise self.unknown(name)
            whole, index = self._elements[name]
            getter, arguments = self._getter(whole)
            self._getters[name] = getter, arguments, index
        getter, arguments, index = self._getters[name]
        return float(self._call(getter, *arguments)[index])

    def load(self) -> FMU3Slave:
        """Load the FMU's binary, once for all runs; `start` does it if nobody has."""
        if self._library is None:
            folder = extract(self._path)
            self._library = FMU3Slave(
                guid=self._token, unzipDirectory=folder, modelIdentifier=self._identifier, instanceName=self.name
            )
            weakref.finalize(self, _unload, self._library, folder)
        return self._library

    def start(self, t_start: float, t_stop: float, *, events: bool) -> None:
        """See `Slave.start`."""
        if events and not self.has_event_mode:
            raise CosimError(f"{self.name} has no event mode: use the fixed-step master.")
        self._events = events
        self._fmu = self.load()
        try:
            self._fmu.instantiate(eventModeUsed=events, earlyReturnAllowed=events, logMessage=self._log)
        except Exception as error:
            self._fmu = None
            raise CosimError(f"{self.name} refuses to be instantiated: {self._said()}") from error
        for name, value in self._starts.items():
            self._write(name, value)
        self._call(self._fmu.enterInitializationMode, startTime=t_start, stopTime=t_stop)

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._call(self._instance.exitInitializationMode)

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""
        self._call(self._instance.enterEventMode)

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""
        self._call(self._instance.enterStepMode)

    def update(self) -> Update:
        """See `Slave.update`."""
        ticks = self._ticks()
        again, terminate, _, _, defined, time = self._call(self._instance.updateDiscreteStates)
        return Update(again, ticks, time if defined else None, self._termination(terminate))

    def step(self, t: float, t_next: float) -> Step:
        """See `Slave.step`."""
        event, terminate, _, reached = self._call(self._instance.doStep, t, t_next - t)
        return Step(reached, event, self._termination(terminate))

    def save(self) -> Any:
        """See `Slave.save`."""
        return self._call(self._instance.getFMUState)

    def restore(self, state: Any) -> None:
        """See `Slave.restore`."""
        self._call(self._instance.setFMUState, state)

    def release(self, state: Any) -> None:
        """See `Slave.release`."""
        self._call(self._instance.freeFMUState, state)

    def close(self) -> None:
        """See `Slave.close`."""
        if self._fmu is not None:
            self._fmu.fmi3FreeInstance(self._fmu.component)
            self._fmu = None
        self._messages.clear()

    @property
    def _instance(self) -> FMU3Slave:
        if self._fmu is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._fmu

    def _ticks(self) -> tuple[str, ...]:
        if not self.clocks:
            return ()
        active = self._call(self._instance.getClock, self._clock_references)
        return tuple(clock for clock, ticked in zip(self.clocks, active, strict=True) if ticked)

    def _getter(self, whole: str) -> tuple[Callable[..., list[Any]], tuple[Any, ...]]:
        variable = self._variables[whole]
        return getattr(self._instance, f"get{variable.type}"), ([variable.valueReference], _size(variable))

    def _write(self, name: str, value: float) -> None:
        whole, index = self._elements[name]
        variable = self._variables[whole]
        number = float(value) if variable.type.startswith("Float") else round(value)
        values = [number]
        if variable.dimensions:
            getter, arguments = self._getter(whole)
            values = list(self._call(getter, *arguments))
            values[index] = number
        self._call(getattr(self._instance, f"set{variable.type}"), [variable.valueReference], values)

    def _call(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except FMICallException as error:
            raise CosimError(f"{self.name}: {error.function} failed: {self._said()}") from error

    def _log(self, environment: Any, status: int, category: bytes | None, message: bytes) -> None:
        self._messages.append(message.decode("utf-8", "replace"))

    def _termination(self, terminate: bool) -> Termination | None:
        # FMI has no reason for terminateSimulation; the FMUs that this project exports name it in their message.
        return Termination(self._said(), "Zeno" in self._said()) if terminate else None

    def _said(self) -> str:
        return self._messages[-1] if self._messages else "the FMU logged no message"


def _unload(library: FMU3Slave, folder: str) -> None:
    library.freeLibrary()
    shutil.rmtree(folder, ignore_errors=True)


def _elements(variable: Any) -> Iterator[tuple[str, tuple[str, int]]]:
    """Yield the scalars of a variable, counted from 1 row by row, with the place of each."""
    if not variable.dimensions:
        yield variable.name, (variable.name, 0)
        return
    for index, place in enumerate(np.ndindex(*variable.shape)):
        yield f"{variable.name}[{','.join(str(i + 1) for i in place)}]", (variable.name, index)


def _size(variable: Any) -> int:
    return int(np.prod(variable.shape)) if variable.dimensions else 1


def _ports(variable: Any) -> list[Port]:
    discrete = variable.variability == "discrete"
    return [Port(name, variable.unit or "", discrete) for name, _ in _elements(variable)]

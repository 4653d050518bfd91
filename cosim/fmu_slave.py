"""A Co-Simulation FMU of FMI 2.0 or 3.0 behind the slave interface."""

from __future__ import annotations

import math
import shutil
import weakref
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import fmi3OK, fmi3Warning

from cosim.errors import CosimError
from cosim.fmi2_instance import Fmi2Instance
from cosim.fmi3_instance import Fmi3Instance
from cosim.fmu_instance import FmuInstance
from cosim.fmu_variables import INTEGERS, NUMBERS, elements, ports, size
from cosim.slave import Slave, Step, Termination, Update
from fmu.check.archive import Archive
from fmu.importer.folders import temporary_folder
from fmu.importer.loading import read_description
from fmu.importer.unpacking import unpack

OWN_TOOL = "hybrid-fmu"
"""What FMUs that this project exports say of their tool."""
MESSAGES = 100
"""Most messages of one call that are kept."""
MAX_PARTS = 10_000
"""Most early returns without an event within one step."""
ROUNDINGS = 8.0
"""Times that differ by no more ulp are one: 3 * 0.1 and 0.3."""


class FmuSlave(Slave):
    """An FMU that a master steps.

    An FMU of FMI 2.0 has no event mode; a step that it ends early is carried on to its end, so that the fixed-step
    master drives it like any other. Loading an FMU runs its native code in this process: load only FMUs that you trust.

    Parameters
    ----------
    name : str
        Name in the system.
    path : str or Path
        The FMU.

    Raises
    ------
    CosimError
        If the file is not an FMI 2.0 or 3.0 Co-Simulation FMU, or its archive must not be extracted; from `load` or
        `start`, if it has no binary for this machine.
    """

    def __init__(self, name: str, path: str | Path) -> None:
        try:
            description = read_description(path)
        except Exception as error:
            raise CosimError(f"{name}: {path} cannot be read as an FMU: {error}") from error
        self._kind = _kind(description)
        if self._kind is None or description.coSimulation is None:
            raise CosimError(
                f"{name}: {path} is not an FMI 2.0 or 3.0 Co-Simulation FMU (it says FMI {description.fmiVersion}, "
                f"{_interfaces(description)}): export it as one."
            )
        self._variables = {variable.name: variable for variable in description.modelVariables}
        numbers = [variable for variable in description.modelVariables if variable.type in NUMBERS]
        self._elements = {name: place for variable in numbers for name, place in elements(variable)}
        self._clock_references = {
            variable.name: variable.valueReference
            for variable in description.modelVariables
            if variable.type == "Clock" and variable.causality == "output"
        }
        super().__init__(
            name,
            [port for variable in numbers if variable.causality == "input" for port in ports(variable)],
            [port for variable in numbers if variable.causality == "output" for port in ports(variable)],
            list(self._clock_references),
        )
        self.has_event_mode = bool(getattr(description.coSimulation, "hasEventMode", False))
        self.can_restore = bool(description.coSimulation.canGetAndSetFMUstate)
        # FMI asks of others that they name their time events; the events on their states come unannounced.
        self.foresees = str(description.generationTool).startswith(OWN_TOOL)
        experiment = description.defaultExperiment
        self.default_stop_time = float(experiment.stopTime) if experiment and experiment.stopTime else None
        self._messages: deque[tuple[int, str]] = deque(maxlen=MESSAGES)
        self._description = description
        self._path = path
        self._loaded: FmuInstance | None = None
        self._running: FmuInstance | None = None
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
        if not math.isfinite(value):
            raise CosimError(f"{self.name}.{name} is set to {value}: set a finite number.")
        if self._running is None:
            self._starts[name] = value
        else:
            self._write(name, value)

    def get(self, name: str) -> float:
        """See `Slave.get`."""
        if name not in self._getters:
            if name not in self._elements:
                raise self.unknown(name)
            whole, index = self._elements[name]
            variable = self._variables[whole]
            self._getters[name] = *self._instance.getter(variable, size(variable)), index
        getter, arguments, index = self._getters[name]
        return float(self._call(getter, *arguments)[index])

    def load(self) -> FmuInstance:
        """Load the FMU's binary, once for all runs; `start` does it if nobody has."""
        if self._loaded is None:
            assert self._kind is not None
            folder = temporary_folder()
            try:
                with Archive(self._path) as archive:
                    unpack(archive, folder)
                self._loaded = self._kind(self._description, folder, self.name, self._hear)
            except Exception as error:
                shutil.rmtree(folder, ignore_errors=True)
                raise CosimError(f"{self.name}: {self._path} cannot be loaded on this machine: {error}") from error
            weakref.finalize(self, _unload, self._loaded.fmu, folder)
        return self._loaded

    def start(self, t_start: float, t_stop: float, *, events: bool) -> None:
        """See `Slave.start`."""
        if events and not self.has_event_mode:
            raise CosimError(f"{self.name} has no event mode: use the fixed-step master.")
        self._events = events
        loaded = self.load()
        try:
            loaded.instantiate(events)
        except Exception as error:
            raise CosimError(f"{self.name} refuses to be instantiated: {self._said()}") from error
        self._running = loaded
        for name, value in self._starts.items():
            self._write(name, value)
        self._call(loaded.enter_initialization, t_start, t_stop)

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._call(self._instance.exit_initialization)

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""
        self._call(self._instance.enter_event_mode)

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""
        self._call(self._instance.enter_step_mode)

    def update(self) -> Update:
        """See `Slave.update`."""
        ticks = self._ticks()
        again, terminate, time = self._call(self._instance.update)
        return Update(again, ticks, time, self._termination(terminate))

    def step(self, t: float, t_next: float) -> Step:
        """See `Slave.step`."""
        instance = self._instance
        for _ in range(MAX_PARTS):
            told, event, terminate, early = self._call(instance.step, t, t_next)
            # The last successful time is where an FMU is only if it returned early (FMI 3.0.2 section 4.2).
            reached = told if (early or terminate) and not _are_one(told, t_next) else t_next
            if event or terminate or reached >= t_next:
                return Step(reached, event, self._termination(terminate))
            if not reached > t:
                raise CosimError(f"{self.name} returns from a step at {t:.17g} s and gets no further: {self._said()}")
            t = reached
        raise CosimError(f"{self.name} returned early from one step {MAX_PARTS} times, the last time at {t:.17g} s.")

    def save(self) -> Any:
        """See `Slave.save`."""
        return self._call(self._instance.save)

    def restore(self, state: Any) -> None:
        """See `Slave.restore`."""
        self._call(self._instance.restore, state)

    def release(self, state: Any) -> None:
        """See `Slave.release`."""
        self._call(self._instance.release, state)

    def close(self) -> None:
        """See `Slave.close`."""
        if self._running is not None:
            self._running.free()
            self._running = None

    @property
    def _instance(self) -> FmuInstance:
        if self._running is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._running

    def _ticks(self) -> tuple[str, ...]:
        if not self.clocks:
            return ()
        active = self._call(self._instance.ticks, list(self._clock_references.values()))
        return tuple(clock for clock, ticked in zip(self.clocks, active, strict=True) if ticked)

    def _write(self, name: str, value: float) -> None:
        whole, index = self._elements[name]
        variable = self._variables[whole]
        number = round(value) if variable.type in INTEGERS else float(value)
        values = [number]
        if size(variable) > 1:
            getter, arguments = self._instance.getter(variable, size(variable))
            values = list(self._call(getter, *arguments))
            values[index] = number
        self._call(self._instance.set, variable, values)

    def _hear(self, status: int, message: str) -> None:
        self._messages.append((status, message))

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        self._messages.clear()
        try:
            return function(*arguments)
        except FMICallException as error:
            raise CosimError(f"{self.name}: {error.function} failed: {self._said()}") from error

    def _termination(self, terminate: bool) -> Termination | None:
        # FMI has no reason for terminateSimulation, which is no failure by itself; what goes with it on the log tells.
        if not terminate:
            return None
        status, message = self._messages[-1] if self._messages else (fmi3OK, "")
        return Termination(message, "Zeno" in message, failed=status > fmi3Warning)

    def _said(self) -> str:
        return self._messages[-1][1] if self._messages else "the FMU logged no message"


def _kind(description: Any) -> type[FmuInstance] | None:
    if description.fmiVersion == "2.0":
        return Fmi2Instance
    return Fmi3Instance if description.fmiVersion.startswith("3.") else None


def _interfaces(description: Any) -> str:
    offered = {"Co-Simulation": description.coSimulation, "Model Exchange": description.modelExchange}
    return " and ".join(name for name, interface in offered.items() if interface is not None) or "no interface"


def _are_one(t: float, other: float) -> bool:
    return abs(t - other) <= ROUNDINGS * math.ulp(max(abs(t), abs(other)))


def _unload(fmu: Any, folder: Path) -> None:
    fmu.freeLibrary()
    shutil.rmtree(folder, ignore_errors=True)

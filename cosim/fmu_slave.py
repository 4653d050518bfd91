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
from fmpy.model_description import ValidationError

from cosim.errors import CosimError, MisfitError
from cosim.fmi2_instance import Fmi2Instance
from cosim.fmi3_instance import Fmi3Instance
from cosim.fmu_instance import FmuInstance
from cosim.fmu_values import exact, parsed, require_within
from cosim.fmu_variables import STRUCTURAL, FmuVariables
from cosim.slave import Slave, Step, Termination, Update, Value
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
    validate : bool
        Whether to hold its description against the schema and fmpy's checks.

    Raises
    ------
    CosimError
        If the file is not an FMI 2.0 or 3.0 Co-Simulation FMU, or its archive must not be extracted; from `load` or
        `start`, if it has no binary for this machine.
    """

    def __init__(self, name: str, path: str | Path, *, validate: bool = True) -> None:
        try:
            description = read_description(path, validate=validate)
        except ValidationError as error:
            raise CosimError(
                f"{name}: {path} cannot be read as an FMU: {error}\n`hybrid-fmu validate` says more; validate=False "
                "(--no-validate) goes on all the same."
            ) from error
        except Exception as error:
            raise CosimError(f"{name}: {path} cannot be read as an FMU: {error}") from error
        self._kind = _kind(description)
        if self._kind is None or description.coSimulation is None:
            raise CosimError(
                f"{name}: {path} is not an FMI 2.0 or 3.0 Co-Simulation FMU (it says FMI {description.fmiVersion}, "
                f"{_interfaces(description)}): export it as one."
            )
        self._variables = FmuVariables(description)
        self._clock_references = {
            variable.name: variable.valueReference
            for variable in description.modelVariables
            if variable.type == "Clock" and variable.causality == "output"
        }
        inputs, outputs = self._variables.ports("input"), self._variables.ports("output")
        super().__init__(name, inputs, outputs, list(self._clock_references), self._variables.tunable)
        interface = description.coSimulation
        self.has_event_mode = bool(getattr(interface, "hasEventMode", False))
        self.can_restore = bool(interface.canGetAndSetFMUstate)
        self.variable_step = bool(interface.canHandleVariableCommunicationStepSize)
        # FMI asks of others that they name their time events; the events on their states come unannounced.
        self.foresees = str(description.generationTool).startswith(OWN_TOOL)
        self._read_experiment(description)
        self._messages: deque[tuple[int, str]] = deque(maxlen=MESSAGES)
        self._description = description
        self._path = path
        self._loaded: FmuInstance | None = None
        self._running: FmuInstance | None = None
        self._begun = False
        self._starts: dict[str, Any] = {}
        self._getters: dict[str, tuple[Callable[..., list[Any]], tuple[Any, ...], int]] = {}
        self._arrays: dict[str, list[Any]] = {}
        self._step_size = math.nan

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return list(self._variables.places)

    def set(self, name: str, value: Value) -> None:
        """See `Slave.set`."""
        variable, _ = self._place(name)
        held = exact(variable, value, f"{self.name}.{name}")
        if self._running is not None:
            if variable.causality == STRUCTURAL:
                raise MisfitError(f"{self.name}.{name} is a structural parameter: set it before the run.")
            if self._begun and variable.causality == "parameter" and name not in self.tunable:
                raise MisfitError(f"{self.name}.{name} is a parameter that is not tunable: set it before the run.")
            self._write(name, held)
            return
        require_within(variable, held, f"{self.name}.{name}")
        self._starts[name] = held
        if variable.causality == STRUCTURAL:
            self._resize(variable, held)

    def parse(self, name: str, text: str) -> Value:
        """See `Slave.parse`."""
        return parsed(self._place(name)[0], text, f"{self.name}.{name}")

    def get(self, name: str) -> Any:
        """See `Slave.get`; whole numbers are int, Booleans bool."""
        if name not in self._getters:
            variable, index = self._place(name)
            self._getters[name] = *self._instance.getter(variable, self._variables.size(variable)), index
        getter, arguments, index = self._getters[name]
        try:
            return self._call(getter, *arguments)[index]
        except (UnicodeDecodeError, AttributeError) as error:
            raise CosimError(f"{self.name}.{name} holds no text in UTF-8, as FMI wants it.") from error

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
        self._arrays.clear()
        self._configure()
        for name, value in self._starts.items():
            if self._place(name)[0].causality != STRUCTURAL:
                self._write(name, value)
        self._call(loaded.enter_initialization, t_start, t_stop)

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._call(self._instance.exit_initialization)
        self._begun = True

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
        instance, rigid = self._instance, not self.variable_step
        for _ in range(MAX_PARTS):
            size = self._constant(t_next - t) if rigid else t_next - t
            told, event, terminate, early = self._call(instance.step, t, size)
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
        if not self.can_restore:
            raise CosimError(f"{self.name} cannot save its state: its canGetAndSetFMUState is false.")
        return self._call(self._instance.save)

    def restore(self, state: Any) -> None:
        """See `Slave.restore`."""
        self._arrays.clear()
        self._call(self._instance.restore, state)

    def release(self, state: Any) -> None:
        """See `Slave.release`."""
        self._call(self._instance.release, state)

    def close(self) -> None:
        """See `Slave.close`."""
        if self._running is not None:
            self._running.free()
            self._running, self._begun = None, False

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

    def _place(self, name: str) -> tuple[Any, int]:
        try:
            return self._variables.places[name]
        except KeyError:
            raise self.unknown(name) from None

    def _resize(self, variable: Any, value: int) -> None:
        self._variables.resize(variable, value)
        self._getters.clear()
        self.inputs = {port.name: port for port in self._variables.ports("input")}
        self.outputs = {port.name: port for port in self._variables.ports("output")}

    def _configure(self) -> None:
        """Set structural parameters, in the mode that FMI 3.0 has for them."""
        structural = [name for name in self._starts if self._place(name)[0].causality == STRUCTURAL]
        if structural:
            self._call(self._instance.enter_configuration)
            for name in structural:
                self._write(name, self._starts[name])
            self._call(self._instance.exit_configuration)

    def _constant(self, size: float) -> float:
        """Return the length of a step that may not vary, not by rounding either."""
        if not math.isclose(size, self._step_size, rel_tol=1e-9):
            self._step_size = size
        return self._step_size

    def _write(self, name: str, value: Any) -> None:
        variable, index = self._place(name)
        values = [value]
        if variable.dimensions:
            values = self._whole(variable)
            values[index] = value
        try:
            self._call(self._instance.set, variable, values)
        except CosimError as error:
            raise CosimError(f"{error} It was to set {name!r} to {value!r}.") from error

    def _whole(self, variable: Any) -> list[Any]:
        """Return the elements of an array as they are; FMI allows no reading between setting and stepping."""
        if variable.name not in self._arrays:
            getter, arguments = self._instance.getter(variable, self._variables.size(variable))
            self._arrays[variable.name] = list(self._call(getter, *arguments))
        return self._arrays[variable.name]

    def _read_experiment(self, description: Any) -> None:
        given = description.defaultExperiment
        if given is not None:
            self.default_start_time = _seconds(given.startTime)
            self.default_stop_time = _seconds(given.stopTime)
            self.default_step = _seconds(given.stepSize)
        if self.default_step is None:
            self.default_step = _seconds(getattr(description.coSimulation, "fixedInternalStepSize", None))

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


def _seconds(text: str | None) -> float | None:
    """Return a time of the description, if it says a usable one."""
    try:
        value = math.nan if text is None else float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _interfaces(description: Any) -> str:
    offered = {
        "Co-Simulation": description.coSimulation,
        "Model Exchange": description.modelExchange,
        "Scheduled Execution": description.scheduledExecution,
    }
    return " and ".join(name for name, interface in offered.items() if interface is not None) or "no interface"


def _are_one(t: float, other: float) -> bool:
    return abs(t - other) <= ROUNDINGS * math.ulp(max(abs(t), abs(other)))


def _unload(fmu: Any, folder: Path) -> None:
    fmu.freeLibrary()
    shutil.rmtree(folder, ignore_errors=True)

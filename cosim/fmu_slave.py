"""A Co-Simulation FMU of FMI 2.0 or 3.0 behind the slave interface."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.errors import CosimError, MisfitError
from cosim.instances.access import FmuAccess
from cosim.instances.calls import FmuCalls
from cosim.instances.fmu_file import STOP_AT_EVENTS, FmuFile
from cosim.instances.variables import STRUCTURAL, FmuVariables
from cosim.slave import Slave
from fmu.importer.instance import Advance, FmuInstance
from fmu.importer.values import UnfitError, Value, exact, parsed, require_within
from hybrid_model.declare.calls import explained
from hybrid_model.scales import ROUNDINGS
from hybrid_model.schedule.blocks import Step, Update

ANY_FLOAT = ("Real", "Float64")
"""Types that hold any finite number."""
MAX_PARTS = 10_000
"""Most early returns without an event within one step."""


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

    kind = "CoSimulation"
    """The interface of the FMU that is used."""
    calls: FmuCalls
    """What calls its functions."""

    @explained(CosimError)
    def __init__(self, name: str, path: str | Path, *, validate: bool = True) -> None:
        self._file = FmuFile(name, path, validate=validate, kind=self.kind)
        description, interface = self._file.description, self._file.interface
        self._variables = FmuVariables(description)
        self._clock_references = {
            variable.name: variable.valueReference
            for variable in description.modelVariables
            if variable.type == "Clock" and variable.causality == "output"
        }
        inputs, outputs = self._variables.ports("input"), self._variables.ports("output")
        super().__init__(name, inputs, outputs, list(self._clock_references), self._variables.tunable)
        self.has_event_mode = bool(getattr(interface, "hasEventMode", False))
        self.can_restore = bool(interface.canGetAndSetFMUstate)
        self.variable_step = bool(getattr(interface, "canHandleVariableCommunicationStepSize", True))
        self.direct = self._variables.direct(description.outputs or ())
        # FMI asks FMUs to name their time events. Ours name the first of all, unless an input may move those on states.
        self.foresees = self._file.ours and all(port.discrete for port in inputs)
        self.stops_after_events = self._file.stops_after_events
        self.default_start_time, self.default_stop_time = self._file.start_time, self._file.stop_time
        self.default_step, self.internal_step = self._file.step, self._file.internal_step
        follows = bool(getattr(interface, "canInterpolateInputs", False))
        self.interpolating = self._variables.flowing("input") if follows else ()
        derives = int(getattr(interface, "maxOutputDerivativeOrder", 0) or 0) > 0
        self.sloped = self._variables.smooth_outputs(description.outputs or ()) if derives else ()
        self._lines: dict[str, tuple[float, float]] = {}
        self._led: list[str] = []
        self._give_slopes: Callable[[list[float]], None] | None = None
        self.calls = FmuCalls(name)
        self._access: FmuAccess | None = None
        self._do_step: Callable[[float, float], Advance | None] = self._first_step
        self._begun = False
        self._starts: dict[str, Any] = {}
        self._events = self._early = self._idle = False
        self._step_size = math.nan

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return list(self._variables.places)

    def set(self, name: str, value: Value) -> None:
        """See `Slave.set`."""
        variable, full_name = self._variable(name), f"{self.name}.{name}"
        if self._access is not None and variable.causality == STRUCTURAL:
            raise MisfitError(f"{full_name} is a structural parameter: set it before the run.")
        if self._begun and variable.causality == "parameter" and name not in self.tunable:
            raise MisfitError(f"{full_name} is a parameter that is not tunable: set it before the run.")
        if self._access is None and (variable.initial == "calculated" or variable.variability == "constant"):
            what = "constant" if variable.variability == "constant" else "computed by the FMU (initial: calculated)"
            raise MisfitError(f"{full_name} is {what}: set parameters, inputs and start values of states instead.")
        try:
            held = exact(variable, value, full_name)
            if self._access is None or (variable.causality == "parameter" and name in self.tunable):
                require_within(variable, held, full_name)
        except UnfitError as error:
            raise MisfitError(str(error)) from error
        if self._access is not None:
            self._access.write(name, held)
            return
        self._starts[name] = held
        if variable.causality == STRUCTURAL:
            self._variables.resize(variable, held)
            self.inputs = {port.name: port for port in self._variables.ports("input")}
            self.outputs = {port.name: port for port in self._variables.ports("output")}
            self._tell_of_sizes()

    def parse(self, name: str, text: str) -> Value:
        """See `Slave.parse`."""
        try:
            return parsed(self._variable(name), text, f"{self.name}.{name}")
        except UnfitError as error:
            raise MisfitError(str(error)) from error

    def get(self, name: str) -> Any:
        """See `Slave.get`; whole numbers are int, Booleans bool."""
        self._variable(name)
        return self._running.read(name)

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """See `Slave.reader`."""
        for name in names:
            self._variable(name)
        return self._running.reader(names)

    def writer(self, name: str) -> Callable[[Any], None]:
        """See `Block.writer`.

        Raises
        ------
        MisfitError
            Later, if a value is none of the variable's type.
        """
        variable, full_name, put = self._variable(name), f"{self.name}.{name}", self._running.writer(name)
        any_float = variable.type in ANY_FLOAT

        def write(value: Any) -> None:
            if not (any_float and type(value) is float and math.isfinite(value)):
                try:
                    value = exact(variable, value, full_name)
                except UnfitError as error:
                    raise MisfitError(str(error)) from error
            put(value)

        return write

    def load(self) -> FmuInstance:
        """Load the FMU's binary, once for all runs; `start` does it if nobody has."""
        return self._file.load(self.calls.hear)

    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """See `Slave.start`."""
        if events and not self.has_event_mode:
            raise CosimError(f"{self.name} has no event mode: use the fixed-step master.")
        instance = self.load()
        self._file.claim()
        self._events, self._early, self.failed_at_end, self.calls.failed = events, early, "", False
        try:
            self.calls(instance.instantiate, events, early)
        except Exception as error:
            self._file.yield_claim()
            other = ". The fixed-step master (--master fixed-step) leaves its event mode off." if events else ""
            raise CosimError(f"{self.name} refuses to be instantiated: {self.calls.said.rstrip('.')}{other}") from error
        self._access = FmuAccess(instance, self._variables, self.calls)
        bound, modes = self.calls.bound, ("EnterEventMode", "EnterStepMode")
        self._enter_event, self._enter_step = (bound(instance.caller(mode)) for mode in modes)
        self._iterate = bound(instance.updater())
        if self.clocks:
            self._active = bound(instance.ticker(list(self._clock_references.values())))
        self._access.start(
            {STOP_AT_EVENTS: True, **self._starts} if early and self.stops_after_events else self._starts
        )
        self.calls(instance.enter_initialization, t_start, t_stop)

    def begin(self) -> None:
        """See `Slave.begin`."""
        self.calls(self._instance.call, "ExitInitializationMode")
        self._begun = True

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""
        self._enter_event()

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""
        self._enter_step()

    def update(self) -> Update:
        """See `Slave.update`."""
        ticks = self._ticks() if self.clocks else ()
        again, terminate, time = self._iterate()
        return Update(again, ticks, time, self.calls.termination() if terminate else None, self._idle)

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`."""
        size = t_next - t if self.variable_step else self._size(t_next - t)
        lines, self._lines = self._lines, {}
        told = self._do_step(t, size)
        # Ours say at the end of a step that they have an event there; what they announce may be as far as they look.
        self._idle = self.foresees and (told is None or not told.event)
        return Step(t_next, False) if told is None else self._carry_on(t, t_next, told, lines)

    @property
    def steps_by_one_call(self) -> bool:
        """Whether a step is a call of DoStep from one time to the next, as they are."""
        return self.variable_step and self.kind == FmuSlave.kind

    def answered(self, t: float, t_next: float, status: int, told: Advance) -> Step:
        """Return what a step gave that somebody else called DoStep for, and carry it on."""
        return self._carry_on(t, t_next, self.calls.answer(self._instance.answered, t, status, told))

    def slopes(self, names: Sequence[str]) -> Callable[[], list[float]]:
        """See `Slave.slopes`."""
        references = [self._variable(name).valueReference for name in names]
        return self.calls.bound(self._instance.output_slopes(references))

    def lead(self, lines: Mapping[str, tuple[float, float]]) -> None:
        """See `Slave.lead`."""
        for name, (value, _) in lines.items():
            self.set(name, value)
        if self._give_slopes is None or self._led != [*lines]:
            references = [self._variable(name).valueReference for name in lines]
            self._led, self._give_slopes = [*lines], self.calls.bound(self._instance.input_slopes(references))
        self._give_slopes([slope for _, slope in lines.values()])
        self._lines = dict(lines)

    def _carry_on(
        self, t: float, t_next: float, told: Advance | None, lines: Mapping[str, tuple[float, float]] | None = None
    ) -> Step:
        """Return what a step gave that the FMU has said something of, carried on where it stopped for nothing."""
        start = t
        for _ in range(MAX_PARTS):
            if told is None:
                return Step(t_next, False)
            # The last successful time is where an FMU is only if it returned early (FMI 3.0.2 section 4.2).
            early = (told.early or told.terminate) and not _are_one(told.reached, t_next)
            reached = told.reached if early else t_next
            stopped = early and self._early and reached > t
            if (told.event and self._events) or stopped or told.terminate or reached >= t_next:
                ended = self.calls.termination() if told.terminate else None
                return Step(reached, told.event or stopped, ended)
            if not reached > t:
                raise CosimError(
                    f"{self.name} returns from a step at {t:.17g} s and gets no further: {self.calls.said}"
                )
            t = reached
            if lines:
                self.lead({name: (value + slope * (t - start), slope) for name, (value, slope) in lines.items()})
            told = self._do_step(t, t_next - t if self.variable_step else self._size(t_next - t))
        raise CosimError(f"{self.name} returned early from one step {MAX_PARTS} times, the last time at {t:.17g} s.")

    def save(self) -> Any:
        """See `Block.save`; CosimError if the FMU cannot save its state."""
        if not self.can_restore:
            raise CosimError(f"{self.name} cannot save its state: its canGetAndSetFMUState is false.")
        return self.calls(self._instance.save), self._running.held(), self._idle

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self.calls(self._instance.restore, state[0])
        self._running.recall(state[1])
        self._idle = state[2]

    def release(self, state: Any) -> None:
        """See `Block.release`."""
        self.calls(self._instance.release, state[0])

    def close(self) -> None:
        """See `Slave.close`; an FMU whose run began is terminated first, unless a call of it failed."""
        if self._access is not None:
            if self._begun and not self.calls.failed:
                try:
                    self.calls(self._instance.call, "Terminate")
                except CosimError as error:
                    self.failed_at_end = str(error)
            if not self.calls.fatal:
                self._access.instance.free()
            self._access, self._do_step, self._begun, self._give_slopes = None, self._first_step, False, None
            self._file.yield_claim()

    @property
    def _running(self) -> FmuAccess:
        if self._access is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._access

    @property
    def _instance(self) -> FmuInstance:
        return self._running.instance

    def _first_step(self, t: float, size: float) -> Advance | None:
        self._do_step = self.calls.bound(self._instance.stepper())
        told: Advance | None = self._do_step(t, size)
        return told

    def _variable(self, name: str) -> Any:
        try:
            return self._variables.places[name][0]
        except KeyError:
            raise self.unknown(name) from None

    def _ticks(self) -> tuple[str, ...]:
        active = self._active()
        if True not in active:
            return ()
        return tuple(clock for clock, ticked in zip(self.clocks, active, strict=True) if ticked)

    def _size(self, size: float) -> float:
        """Return the length of a step that may not vary: it does not by rounding either."""
        if not math.isclose(size, self._step_size, rel_tol=1e-9):
            self._step_size = size
        return self._step_size


def _are_one(t: float, other: float) -> bool:
    return abs(t - other) <= ROUNDINGS * math.ulp(max(abs(t), abs(other)))

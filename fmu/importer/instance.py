"""One instance of anybody's FMU in this process, over fmpy: one set of methods for both versions of the standard."""

from __future__ import annotations

import ctypes as c
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fmpy.fmi1 import FMICallException, fmi1Warning
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2Discard, fmi2LastSuccessfulTime, fmi2Terminated
from fmpy.fmi3 import FMU3Model, FMU3Slave

from fmu.importer.callbacks import Callbacks
from fmu.importer.loading import load_binary, major_of
from fmu.standard.functions import spelled
from fmu.standard.value_types import C_TYPES, FLOATS, INTEGERS, accessor

Getter = tuple[Callable[..., list[Any]], tuple[Any, ...]]
"""A function of fmpy, and the arguments with which it returns all elements of one variable."""
_CLASSES = {
    (2, "CoSimulation"): FMU2Slave,
    (2, "ModelExchange"): FMU2Model,
    (3, "CoSimulation"): FMU3Slave,
    (3, "ModelExchange"): FMU3Model,
}

_PLAIN: dict[str, Callable[[Any], Any]] = {"Boolean": bool, "String": lambda text: text.decode("utf-8")}


class VersionError(ValueError):
    """An FMU is asked for a function that its version of the standard does not have."""


class BoundCall(NamedTuple):
    """A function of the FMU that reads numbers, and its arguments.

    Attributes
    ----------
    name : str
        Of the function.
    make : callable
        Calls it, and returns its status.
    references, values : array of ctypes
        Which variables it reads, and into what.
    """

    name: str
    make: Callable[[], int]
    references: Any
    values: Any


class Advance(NamedTuple):
    """What one call of DoStep gave.

    Attributes
    ----------
    reached : float
        Time in s that the FMU is at.
    event : bool
        Whether it asks for event mode.
    terminate : bool
        Whether it ends the run.
    early : bool
        Whether it returned before the end of the step.
    """

    reached: float
    event: bool
    terminate: bool
    early: bool


class FmuInstance:
    """An FMU whose binary is loaded; at most one instance of it at a time.

    Methods raise fmpy's ``FMICallException`` when the FMU answers with an error, `VersionError` for what FMI 2.0 does
    not have, or whatever fmpy raises when it cannot be loaded or instantiated.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
        Of an FMU of FMI 2.0 or 3.0.
    folder : Path
        The FMU, unpacked.
    name : str
        Of the instance.
    log : callable
        Told the status and the text of each message of the FMU.
    kind : {"CoSimulation", "ModelExchange"}
        Interface type, one that the FMU has.

    Attributes
    ----------
    fmu : object of fmpy
    """

    def __init__(
        self, description: Any, folder: Path, name: str, log: Callable[[int, str], None], kind: str = "CoSimulation"
    ) -> None:
        self.name, self._log, self._kind = name, log, kind
        self.major = major_of(description) or 0
        interface = description.coSimulation if kind == "CoSimulation" else description.modelExchange
        self.fmu = load_binary(
            _CLASSES[self.major, kind],
            folder,
            self.major,
            guid=description.guid if self.major == 2 else description.instantiationToken,
            modelIdentifier=interface.modelIdentifier,
            instanceName=name,
        )
        self._callbacks: Callbacks | None = None

    def function(self, name: str) -> Callable[..., Any]:
        """Return what calls a function, which goes by its name of FMI 3.0 without prefix."""
        plain = spelled(self.major, name).removeprefix(f"fmi{self.major}")
        found: Callable[..., Any] | None = getattr(self.fmu, plain[0].lower() + plain[1:], None)
        if found is None:
            raise VersionError(f"{self.name} is an FMU of FMI {self.major}.0 for {self._kind}, which has no {name}.")
        return found

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function."""
        return self.function(name)(*arguments)

    def instantiate(self, events: bool = False, early: bool = False) -> None:
        """Make the instance; whether the master handles events, and whether steps may end early, as FMI 3.0 has it."""
        if self.major == 3:
            cosimulates = self._kind == "CoSimulation"
            modes = {"eventModeUsed": events, "earlyReturnAllowed": events or early} if cosimulates else {}
            self.fmu.instantiate(logMessage=self._heard, **modes)
            return
        self._callbacks = Callbacks(self._log, self.name)
        try:
            self.fmu.instantiate(callbacks=self._callbacks.functions)
        except Exception:
            self._callbacks.release()
            raise

    def _heard(self, environment: Any, status: int, category: Any, message: bytes | None) -> None:
        self._log(status, (message or b"").decode("utf-8", "replace"))

    def enter_initialization(self, t_start: float, t_stop: float | None = None) -> None:
        """Enter initialization mode; times in s."""
        if self.major == 2:
            self.fmu.setupExperiment(startTime=t_start, stopTime=t_stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=t_start, stopTime=t_stop)

    def getter(self, variable: Any, size: int) -> Getter:
        """Return what reads a variable of `size` elements."""
        found = self.function(f"Get{accessor(variable.type, self.major)}")
        if self.major == 2 and variable.type in _PLAIN:
            # Of these fmpy returns what they are in C.
            found = _converted(found, _PLAIN[variable.type])
        return found, ([variable.valueReference], *(() if self.major == 2 else (size,)))

    def numbers(self, variables: Sequence[Any], sizes: Sequence[int]) -> BoundCall:
        """Return the call that reads all elements of variables whose types `in_one_call` names alike.

        Masters read the same outputs at each of many steps: what the call needs is made once, for as long as the
        instance lives.
        """
        kind = variables[0].type
        name = f"fmi{self.major}Get{accessor(kind, self.major)}"
        references = (c.c_uint32 * len(variables))(*(variable.valueReference for variable in variables))
        values = (C_TYPES[self.major][kind] * sum(sizes))()
        return BoundCall(name, self._on_values(name, references, values), references, values)

    @staticmethod
    def call_all(calls: Sequence[BoundCall]) -> None:
        """Make calls that are bound, one after the other."""
        for name, make, _, _ in calls:
            status = make()
            if status > fmi1Warning:
                raise FMICallException(function=name, status=status)

    def writer(self, variable: Any, size: int) -> Callable[[Sequence[Any]], None]:
        """Return what writes all elements of a variable, one that `in_one_call` names in a call that is made once."""
        if self.in_one_call(variable) is None:
            return functools.partial(self.set, variable)
        name = f"fmi{self.major}Set{accessor(variable.type, self.major)}"
        buffer = (C_TYPES[self.major][variable.type] * size)()
        call = self._on_values(name, (c.c_uint32 * 1)(variable.valueReference), buffer)

        def write(values: Sequence[Any]) -> None:
            buffer[:] = values
            if (status := call()) > fmi1Warning:
                raise FMICallException(function=name, status=status)

        return write

    def _on_values(self, name: str, references: Any, values: Any) -> Callable[[], int]:
        length = () if self.major == 2 else (c.c_size_t(len(values)),)
        return self._bound(name, c.byref(references), c.c_size_t(len(references)), c.byref(values), *length)

    def caller(self, name: str) -> Callable[[], Any]:
        """Return what calls a function that takes nothing but the instance, for as long as that lives."""
        if self.major == 2:
            return functools.partial(self.call, name)
        full_name = f"fmi3{name}"
        call = self._bound(full_name)

        def run() -> None:
            if (status := call()) > fmi1Warning:
                raise FMICallException(function=full_name, status=status)

        return run

    def _bound(self, name: str, *arguments: Any) -> Callable[[], int]:
        """Return what calls a function with arguments that are C data already.

        A function that is not told the types of its arguments takes them as they are, in a third of the time that
        fmpy's takes to convert them.
        """
        return functools.partial(self.fmu.dll[name], c.c_void_p(self.fmu.component), *arguments)

    def in_one_call(self, variable: Any) -> str | None:
        """Return the name of the function that `numbers` reads a variable with; None if it holds no number."""
        return accessor(variable.type, self.major) if variable.type in (*FLOATS, *INTEGERS) else None

    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """Write all elements of a variable."""
        self.call(f"Set{accessor(variable.type, self.major)}", [variable.valueReference], values)

    def stepper(self) -> Callable[[float, float], Advance | None]:
        """Return what steps from `t` on by `size`, for as long as the instance lives.

        It gives None if the FMU came to the end of the step and tells nothing more. An FMU of FMI 2.0 may end a step
        early, with fmi2Discard.
        """
        time, length = c.c_double(), c.c_double()
        if self.major == 2:
            do_step = self._bound("fmi2DoStep", time, length, c.c_int(1))

            def step_of_fmi2(t: float, size: float) -> Advance | None:
                time.value, length.value = t, size
                status = do_step()
                return self._discarded(t, status) if status else None

            return step_of_fmi2
        flags, reached = (c.c_bool * 3)(), c.c_double()
        call = self._bound("fmi3DoStep", time, length, c.c_bool(True), *_places(flags), c.byref(reached))

        def step(t: float, size: float) -> Advance | None:
            time.value, length.value = t, size
            if (status := call()) > fmi1Warning or True in flags:
                return self.answered(t, status, Advance(reached.value, *flags))
            return None

        return step

    def answered(self, t: float, status: int, told: Advance) -> Advance | None:
        """Return what DoStep's answer to a step from `t` on says, as `stepper` does."""
        if self.major == 2:
            return self._discarded(t, status) if status else None
        if status > fmi1Warning:
            raise FMICallException(function="fmi3DoStep", status=status)
        return told

    def address(self, name: str) -> int:
        """Return where a function of the FMU is, by its whole name."""
        return int(c.cast(self.fmu.dll[name], c.c_void_p).value or 0)

    def _discarded(self, t: float, status: int) -> Advance | None:
        if status != fmi2Discard:
            if status > fmi1Warning:
                raise FMICallException(function="fmi2DoStep", status=status)
            return None
        ended = self._status(self.fmu.getBooleanStatus, fmi2Terminated, False)
        return Advance(self._status(self.fmu.getRealStatus, fmi2LastSuccessfulTime, t), False, ended, True)

    @staticmethod
    def _status(ask: Callable[[int], Any], kind: int, otherwise: Any) -> Any:
        """Return what an FMU says of a discarded step; many have no answer."""
        try:
            return ask(kind)
        except FMICallException:
            return otherwise

    def updater(self) -> Callable[[], tuple[bool, bool, float | None]]:
        """Return what does one event iteration, for as long as the instance lives.

        It gives whether it needs one more, whether it ends the run, and the next event's time.
        """
        if self.major == 2:
            return self._update_of_fmi2
        flags, time = (c.c_bool * 5)(), c.c_double()
        call = self._bound("fmi3UpdateDiscreteStates", *_places(flags), c.byref(time))

        def update() -> tuple[bool, bool, float | None]:
            if (status := call()) > fmi1Warning:
                raise FMICallException(function="fmi3UpdateDiscreteStates", status=status)
            again, terminate, _, _, defined = flags
            return again, terminate, time.value if defined else None

        return update

    def _update_of_fmi2(self) -> tuple[bool, bool, float | None]:
        again, terminate, _, _, defined, time = self.call("UpdateDiscreteStates")
        return again, terminate, time if defined else None

    def ticker(self, references: Sequence[int]) -> Callable[[], list[bool]]:
        """Return what gives which clocks tick, for as long as the instance lives."""
        count = len(references)
        active = (c.c_bool * count)()
        call = self._bound("fmi3GetClock", (c.c_uint32 * count)(*references), c.c_size_t(count), active)

        def ticks() -> list[bool]:
            if (status := call()) > fmi1Warning:
                raise FMICallException(function="fmi3GetClock", status=status)
            return active[:]

        return ticks

    def slopes(self, unknowns: Sequence[int], known: int, seed: Sequence[float], size: int) -> list[float]:
        """Return the directional derivatives, `size` in all, of variables by one variable along a seed."""
        more = () if self.major == 2 else (size,)
        return list(self.fmu.getDirectionalDerivative(unknowns, [known], seed, *more))

    def output_slopes(self, references: Sequence[int]) -> Callable[[], list[float]]:
        """Return what gives the derivatives by time of outputs, for as long as the instance lives."""
        name, count = spelled(self.major, "GetOutputDerivatives"), len(references)
        values = (c.c_double * count)()
        arguments = [(c.c_uint32 * count)(*references), c.c_size_t(count), (c.c_int32 * count)(*[1] * count), values]
        call = self._bound(name, *arguments, *(() if self.major == 2 else (c.c_size_t(count),)))

        def slopes() -> list[float]:
            if (status := call()) > fmi1Warning:
                raise FMICallException(function=name, status=status)
            return values[:]

        return slopes

    def input_slopes(self, references: Sequence[int]) -> Callable[[Sequence[float]], None]:
        """Return what gives inputs derivatives by time, for as long as the instance lives; of FMI 2.0 alone."""
        name, count = "fmi2SetRealInputDerivatives", len(references)
        values = (c.c_double * count)()
        arguments = [(c.c_uint32 * count)(*references), c.c_size_t(count), (c.c_int32 * count)(*[1] * count), values]
        call = self._bound(name, *arguments)

        def give(slopes: Sequence[float]) -> None:
            values[:] = list(slopes)
            if (status := call()) > fmi1Warning:
                raise FMICallException(function=name, status=status)

        return give

    def save(self) -> Any:
        """Return the state."""
        return self.call("GetFMUState")

    def restore(self, state: Any) -> None:
        """Return to a state."""
        self.call("SetFMUState", state)

    def release(self, state: Any) -> None:
        """Free a state."""
        self.call("FreeFMUState", state)

    def free(self) -> None:
        """Free the instance; the binary stays loaded."""
        getattr(self.fmu, spelled(self.major, "FreeInstance"))(self.fmu.component)
        if self._callbacks is not None:
            self._callbacks.release()


def _places(flags: c.Array[c.c_bool]) -> list[Any]:
    return [c.byref(flags, k) for k in range(len(flags))]


def _converted(function: Callable[..., list[Any]], convert: Callable[[Any], Any]) -> Callable[..., list[Any]]:
    return lambda *arguments: [convert(value) for value in function(*arguments)]

"""FMI 2.0 as the experiments use it: what it does otherwise than FMI 3.0."""

from __future__ import annotations

import ctypes as c
import platform
import sys
from typing import Any

from fmu.importer.memory import ALLOCATE, FREE, memory_functions
from fmu.validate.child.calls import DISCARD, OK, Recorder, Step, Update, Variable
from fmu.validate.child.instance import Instance, array, references

# The logger is variadic.  Where variable arguments are passed as fixed ones are, the first of them can be read here.
_LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p, c.c_void_p)
_READS_ARGUMENTS = not (sys.platform == "darwin" and platform.machine() == "arm64")
_FINISHED = c.CFUNCTYPE(None, c.c_void_p, c.c_int)
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3


class _Callbacks(c.Structure):
    _fields_ = [
        ("logger", _LOGGER),
        ("allocate", ALLOCATE),
        ("free", FREE),
        ("finished", _FINISHED),
        ("environment", c.c_void_p),
    ]


class _EventInfo(c.Structure):
    _fields_ = [
        ("again", c.c_int),
        ("terminate", c.c_int),
        ("nominals_changed", c.c_int),
        ("values_changed", c.c_int),
        ("defined", c.c_int),
        ("time", c.c_double),
    ]


class Fmi2(Instance):
    """One instance of an FMI 2.0 FMU."""

    major = 2

    def __init__(self, plan: dict[str, Any], recorder: Recorder) -> None:
        super().__init__(plan, recorder)
        allocate, free = memory_functions()
        self._callbacks = _Callbacks(
            _LOGGER(lambda environment, name, status, category, message, first: self.logged(_filled(message, first))),
            allocate,
            free,
            _FINISHED(0),
            None,
        )

    def instantiate(self, token: str) -> bool:
        """See `Instance.instantiate`."""
        kind = 1 if self.plan["kind"] == "CoSimulation" else 0
        location = self.plan["resources"].encode()
        return self.make("Instantiate", b"checked", kind, token.encode(), location, c.byref(self._callbacks), 0, 0)

    def enter_initialization(self) -> None:
        """See `Instance.enter_initialization`."""
        self.do("SetupExperiment", *self.experiment())
        self.do("EnterInitializationMode")

    def update(self) -> Update:
        """See `Instance.update`."""
        info = _EventInfo()
        self.do("UpdateDiscreteStates", c.byref(info))
        return Update(bool(info.again), bool(info.terminate), info.time if info.defined else None)

    def step(self, t: float, h: float) -> Step:
        """See `Instance.step`."""
        status = self.call("DoStep", c.c_double(t), c.c_double(h), 1, shown=f"{t!r}, {h!r}")
        if status != DISCARD:
            return Step(status, False, False, False, t + h)
        time, terminated = c.c_double(t), c.c_int()
        if self.call("GetRealStatus", _LAST_SUCCESSFUL_TIME, c.byref(time)) != OK:
            time = c.c_double(t)
        if self.call("GetBooleanStatus", _TERMINATED, c.byref(terminated)) != OK:
            terminated = c.c_int(0)
        return Step(status, False, bool(terminated.value), True, time.value)

    def counts(self) -> tuple[int, int]:
        """See `Instance.counts`; FMI 2 has no functions for them."""
        return self.plan["states"], self.plan["indicators"]

    def input_derivative(self, given: Variable) -> int:
        """Set the first time derivative of an input to zero, and return the status: a capability claims it."""
        values = (*references(given.reference), array(c.c_int, [1]), array(c.c_double, [0.0]))
        return self.call("SetRealInputDerivatives", *values, shown=given.name)


def _filled(message: bytes | None, first: int | None) -> bytes | None:
    """Return a message; the format "%s", which careful FMUs use, is filled with its argument."""
    return c.string_at(first) if message == b"%s" and first and _READS_ARGUMENTS else message

"""FMI 2.0 as the experiments use it."""

from __future__ import annotations

import ctypes as c
import platform
import sys
from typing import Any

from fmu.importer.memory import ALLOCATE, FREE, memory_functions
from fmu.validate.child.calls import DISCARD, OK, Library, Recorder, Step, Update, Variable

TYPES: dict[str, tuple[str, Any]] = {
    "Real": ("Real", c.c_double),
    "Integer": ("Integer", c.c_int),
    "Enumeration": ("Integer", c.c_int),
    "Boolean": ("Boolean", c.c_int),
    "String": ("String", c.c_char_p),
}
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


class Fmi2(Library):
    """One instance of an FMI 2.0 FMU."""

    prefix = "fmi2"
    events = False

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
        """Make an instance; tell whether there is one."""
        self.recorder.at("fmi2Instantiate")
        function = self.function("Instantiate")
        function.restype = c.c_void_p  # type: ignore[attr-defined]
        kind = 1 if self.plan["kind"] == "CoSimulation" else 0
        location = self.plan["resources"].encode()
        found = function(b"checked", kind, token.encode(), location, c.byref(self._callbacks), 0, 0)
        self.handle = c.c_void_p(found) if found else None
        return bool(found)

    def free(self) -> None:
        """Free the instance."""
        self.recorder.at("fmi2FreeInstance")
        function = self.function("FreeInstance")
        function.restype = None  # type: ignore[attr-defined]
        function(self.handle)
        self.handle = None

    def enter_initialization(self) -> None:
        """Set up the planned experiment and enter its initialisation."""
        start, stop = c.c_double(self.plan["start"]), c.c_double(self.plan["stop"])
        self.do("SetupExperiment", 0, c.c_double(0.0), start, 1, stop)
        self.do("EnterInitializationMode")

    def set(self, variable: Variable) -> None:
        """Set a variable to its start value."""
        kind, made = TYPES[variable.type]
        [text] = variable.start or [""]
        value: Any = text.encode() if kind == "String" else int(text in ("true", "1")) if kind == "Boolean" else text
        if kind == "Real":
            value = float(text.replace("INF", "inf"))
        elif kind == "Integer":
            value = int(text)
        references = (c.c_uint * 1)(variable.reference)
        self.do(f"Set{kind}", references, c.c_size_t(1), (made * 1)(value), shown=variable.name)

    def put(self, variable: Variable, values: list[float]) -> None:
        """Set a floating point variable."""
        self.do(
            "SetReal", (c.c_uint * 1)(variable.reference), c.c_size_t(1), (c.c_double * 1)(*values), shown=variable.name
        )

    def get(self, variable: Variable) -> tuple[list[Any], bytes]:
        """Return a variable's values, and their bits."""
        kind, made = TYPES[variable.type]
        array = (made * 1)()
        self.do(f"Get{kind}", (c.c_uint * 1)(variable.reference), c.c_size_t(1), array, shown=variable.name)
        if kind == "String":
            if array[0] is None:
                raise self.recorder.stop("run.string", f"fmi2GetString({variable.name}) gives a NULL pointer.")
            return [], array[0]
        return list(array), bytes(array)

    def update(self) -> Update:
        """Update discrete states once."""
        info = _EventInfo()
        self.do("NewDiscreteStates", c.byref(info))
        return Update(bool(info.again), bool(info.terminate), info.time if info.defined else None)

    def step(self, t: float, h: float) -> Step:
        """Do a step; the statuses Error and Fatal are returned as such."""
        status = self.call("DoStep", c.c_double(t), c.c_double(h), 1, shown=f"{t!r}, {h!r}")
        if status != DISCARD:
            return Step(status, False, False, False, t + h)
        time, terminated = c.c_double(t), c.c_int()
        if self.call("GetRealStatus", _LAST_SUCCESSFUL_TIME, c.byref(time)) != OK:
            time = c.c_double(t)
        if self.call("GetBooleanStatus", _TERMINATED, c.byref(terminated)) != OK:
            terminated = c.c_int(0)
        return Step(status, False, bool(terminated.value), True, time.value)

    # Model Exchange.

    def counts(self) -> tuple[int, int]:
        """Return the numbers of continuous states and event indicators; FMI 2 has no functions for them."""
        return self.plan["states"], self.plan["indicators"]

    def vector(self, name: str, size: int) -> list[float]:
        """Call a function that fills an array: `derivatives`, `states`, `indicators`, `nominals`."""
        array = (c.c_double * max(size, 1))()
        if size:
            self.do(_VECTORS[name], array, c.c_size_t(size))
        return list(array)[:size]

    def set_states(self, t: float, x: list[float]) -> None:
        """Set time and continuous states."""
        self.do("SetTime", c.c_double(t), shown=repr(t))
        if x:
            self.do("SetContinuousStates", (c.c_double * len(x))(*x), c.c_size_t(len(x)))

    def completed_step(self) -> tuple[bool, bool]:
        """Tell the FMU of a completed step; return whether it wants an event, and an end."""
        event, terminate = c.c_int(), c.c_int()
        self.do("CompletedIntegratorStep", 1, c.byref(event), c.byref(terminate))
        return bool(event.value), bool(terminate.value)

    # State.

    def save(self) -> c.c_void_p:
        """Get the FMU state."""
        state = c.c_void_p()
        self.do("GetFMUstate", c.byref(state))
        return state

    def restore(self, state: c.c_void_p) -> None:
        """Set the FMU state."""
        self.do("SetFMUstate", state)

    def release(self, state: c.c_void_p) -> None:
        """Free the FMU state."""
        self.do("FreeFMUstate", c.byref(state))

    def serialize(self, state: c.c_void_p) -> bytes:
        """Return the bytes of an FMU state."""
        size = c.c_size_t()
        self.do("SerializedFMUstateSize", state, c.byref(size))
        content = (c.c_char * max(size.value, 1))()
        self.do("SerializeFMUstate", state, content, size)
        return bytes(content)[: size.value]

    def deserialize(self, content: bytes) -> c.c_void_p:
        """Return the FMU state of bytes."""
        state = c.c_void_p()
        array = (c.c_char * max(len(content), 1)).from_buffer_copy(content or b"\0")
        self.do("DeSerializeFMUstate", array, c.c_size_t(len(content)), c.byref(state))
        return state

    def directional(
        self, unknowns: list[int], knowns: list[int], seed: list[float], *, adjoint: bool = False
    ) -> list[float]:
        """Return the product of the Jacobian of scalars and a seed; FMI 2 has no adjoint one."""
        rows, columns = (c.c_uint * len(unknowns))(*unknowns), (c.c_uint * len(knowns))(*knowns)
        given, found = (c.c_double * len(seed))(*seed), (c.c_double * len(unknowns))()
        sizes = c.c_size_t(len(unknowns)), c.c_size_t(len(knowns))
        self.do("GetDirectionalDerivative", rows, sizes[0], columns, sizes[1], given, found, may_discard=True)
        return list(found)

    def output_derivatives(self, references: list[int]) -> list[float]:
        """Return the first time derivatives of outputs."""
        array, found = (c.c_uint * len(references))(*references), (c.c_double * len(references))()
        orders = (c.c_int * len(references))(*[1] * len(references))
        self.do("GetRealOutputDerivatives", array, c.c_size_t(len(references)), orders, found, may_discard=True)
        return list(found)

    # Calls that capability flags claim; each returns its status.

    def output_derivative(self, output: Variable, order: int) -> int:
        """Ask for one time derivative of an output."""
        reference, orders, found = (c.c_uint * 1)(output.reference), (c.c_int * 1)(order), (c.c_double * 1)()
        shown = f"{output.name}, order {order}"
        return self.call("GetRealOutputDerivatives", reference, c.c_size_t(1), orders, found, shown=shown)

    def input_derivative(self, given: Variable) -> int:
        """Set the first time derivative of an input to zero."""
        reference, orders, value = (c.c_uint * 1)(given.reference), (c.c_int * 1)(1), (c.c_double * 1)(0.0)
        return self.call("SetRealInputDerivatives", reference, c.c_size_t(1), orders, value, shown=given.name)


def _filled(message: bytes | None, first: int | None) -> bytes | None:
    """Return a message; the format "%s", which careful FMUs use, is filled with its argument."""
    return c.string_at(first) if message == b"%s" and first and _READS_ARGUMENTS else message


_VECTORS = {
    "derivatives": "GetDerivatives",
    "states": "GetContinuousStates",
    "indicators": "GetEventIndicators",
    "nominals": "GetNominalsOfContinuousStates",
}

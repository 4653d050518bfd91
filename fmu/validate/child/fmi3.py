"""FMI 3.0 as the experiments use it."""

from __future__ import annotations

import ctypes as c
from typing import Any

from fmu.validate.child.calls import DISCARD, OK, WARNING, Library, Recorder, Step, Update, Variable

TYPES: dict[str, Any] = {
    "Float64": c.c_double,
    "Float32": c.c_float,
    "Int8": c.c_int8,
    "UInt8": c.c_uint8,
    "Int16": c.c_int16,
    "UInt16": c.c_uint16,
    "Int32": c.c_int32,
    "UInt32": c.c_uint32,
    "Int64": c.c_int64,
    "UInt64": c.c_uint64,
    "Enumeration": c.c_int64,
    "Boolean": c.c_bool,
    "String": c.c_char_p,
}
_LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
_INTERMEDIATE = c.CFUNCTYPE(None, c.c_void_p, c.c_double, *([c.c_bool] * 5), c.POINTER(c.c_bool), c.POINTER(c.c_double))
_PLAIN = c.CFUNCTYPE(None)
_CLOCK_UPDATE = c.CFUNCTYPE(None, c.c_void_p)


class Fmi3(Library):
    """One instance of an FMI 3.0 FMU."""

    prefix = "fmi3"

    def __init__(self, plan: dict[str, Any], recorder: Recorder) -> None:
        super().__init__(plan, recorder)
        self.events = bool(plan["event_mode"])
        self._log = _LOGGER(lambda environment, status, category, message: self.logged(message))
        self._intermediate = _INTERMEDIATE(_go_on)
        self._clock_update = _CLOCK_UPDATE(lambda environment: None)
        self._lock = _PLAIN(lambda: None)

    def instantiate(self, token: str) -> bool:
        """Make an instance; tell whether there is one."""
        kind = self.plan["kind"]
        self.recorder.at(f"fmi3Instantiate{kind}")
        function = self.function(f"Instantiate{kind}")
        function.restype = c.c_void_p  # type: ignore[attr-defined]
        arguments = [
            b"checked",
            token.encode(),
            self.plan["resources"].encode(),
            c.c_bool(False),
            c.c_bool(False),
        ]
        if kind == "CoSimulation":
            arguments += [
                c.c_bool(self.events),
                c.c_bool(self.events),
                None,
                c.c_size_t(0),
                None,
                self._log,
                self._intermediate,
            ]
        elif kind == "ModelExchange":
            arguments += [None, self._log]
        else:
            arguments += [None, self._log, self._clock_update, self._lock, self._lock]
        found = function(*arguments)
        self.handle = c.c_void_p(found) if found else None
        return bool(found)

    def free(self) -> None:
        """Free the instance."""
        self.recorder.at("fmi3FreeInstance")
        self.function("FreeInstance")(self.handle)
        self.handle = None

    def enter_initialization(self) -> None:
        """Enter initialisation over the planned experiment."""
        start, stop = c.c_double(self.plan["start"]), c.c_double(self.plan["stop"])
        self.do("EnterInitializationMode", c.c_bool(False), c.c_double(0.0), start, c.c_bool(True), stop)

    def set(self, variable: Variable) -> None:
        """Set a variable to its start value."""
        made = TYPES[variable.type]
        values = [_value(variable.type, text) for text in variable.start or []]
        values = values * variable.size if len(values) == 1 else values
        kind = "Int64" if variable.type == "Enumeration" else variable.type
        array = (made * max(len(values), 1))(*values)
        references = (c.c_uint32 * 1)(variable.reference)
        self.do(f"Set{kind}", references, c.c_size_t(1), array, c.c_size_t(len(values)), shown=variable.name)

    def put(self, variable: Variable, values: list[float]) -> None:
        """Set a floating point variable."""
        array, size = (TYPES[variable.type] * len(values))(*values), c.c_size_t(len(values))
        self.do(
            f"Set{variable.type}", (c.c_uint32 * 1)(variable.reference), c.c_size_t(1), array, size, shown=variable.name
        )

    def get(self, variable: Variable) -> tuple[list[Any], bytes]:
        """Return a variable's values, and their bits."""
        references = (c.c_uint32 * 1)(variable.reference)
        one, size = c.c_size_t(1), max(variable.size, 1)
        if variable.type == "Clock":
            ticks = (c.c_bool * 1)()
            self.do("GetClock", references, one, ticks, shown=variable.name)
            return list(ticks), bytes(ticks)
        if variable.type == "Binary":
            sizes, places = (c.c_size_t * size)(), (c.c_void_p * size)()
            self.do("GetBinary", references, one, sizes, places, c.c_size_t(variable.size), shown=variable.name)
            found = [
                c.string_at(place, length) if place and length else b""
                for place, length in zip(places, sizes, strict=True)
            ]
            return [], b"\0".join(found)
        kind = "Int64" if variable.type == "Enumeration" else variable.type
        array = (TYPES[variable.type] * size)()
        self.do(f"Get{kind}", references, one, array, c.c_size_t(variable.size), shown=variable.name)
        if variable.type == "String":
            if any(text is None for text in array):
                raise self.recorder.stop("run.string", f"fmi3GetString({variable.name}) gives a NULL pointer.")
            return [], b"\0".join(array)
        return list(array), bytes(array)

    def update(self) -> Update:
        """Update discrete states once."""
        flags, time = [c.c_bool() for _ in range(5)], c.c_double()
        self.do("UpdateDiscreteStates", *map(c.byref, flags), c.byref(time))
        again, terminate, _, _, defined = (flag.value for flag in flags)
        return Update(again, terminate, time.value if defined else None)

    def step(self, t: float, h: float) -> Step:
        """Do a step; the statuses Error and Fatal are returned as such."""
        event, terminate, early, time = c.c_bool(), c.c_bool(), c.c_bool(), c.c_double(t)
        pointers = (c.byref(event), c.byref(terminate), c.byref(early), c.byref(time))
        status = self.call("DoStep", c.c_double(t), c.c_double(h), c.c_bool(False), *pointers, shown=f"{t!r}, {h!r}")
        return Step(
            status, event.value, terminate.value, early.value, time.value if status in (OK, WARNING, DISCARD) else t
        )

    # Model Exchange.

    def counts(self) -> tuple[int, int]:
        """Return the numbers of continuous states and event indicators."""
        states, indicators = c.c_size_t(), c.c_size_t()
        self.do("GetNumberOfContinuousStates", c.byref(states))
        self.do("GetNumberOfEventIndicators", c.byref(indicators))
        return states.value, indicators.value

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
        event, terminate = c.c_bool(), c.c_bool()
        self.do("CompletedIntegratorStep", c.c_bool(True), c.byref(event), c.byref(terminate))
        return event.value, terminate.value

    # State.

    def save(self) -> c.c_void_p:
        """Get the FMU state."""
        state = c.c_void_p()
        self.do("GetFMUState", c.byref(state))
        return state

    def restore(self, state: c.c_void_p) -> None:
        """Set the FMU state."""
        self.do("SetFMUState", state)

    def release(self, state: c.c_void_p) -> None:
        """Free the FMU state."""
        self.do("FreeFMUState", c.byref(state))

    def serialize(self, state: c.c_void_p) -> bytes:
        """Return the bytes of an FMU state."""
        size = c.c_size_t()
        self.do("SerializedFMUStateSize", state, c.byref(size))
        content = (c.c_uint8 * max(size.value, 1))()
        self.do("SerializeFMUState", state, content, size)
        return bytes(content)[: size.value]

    def deserialize(self, content: bytes) -> c.c_void_p:
        """Return the FMU state of bytes."""
        state = c.c_void_p()
        array = (c.c_uint8 * max(len(content), 1)).from_buffer_copy(content or b"\0")
        self.do("DeserializeFMUState", array, c.c_size_t(len(content)), c.byref(state))
        return state

    def directional(
        self, unknowns: list[int], knowns: list[int], seed: list[float], *, adjoint: bool = False
    ) -> list[float]:
        """Return the product of the Jacobian of scalars, or of its transpose, and a seed."""
        rows, columns = (c.c_uint32 * len(unknowns))(*unknowns), (c.c_uint32 * len(knowns))(*knowns)
        given = (c.c_double * len(seed))(*seed)
        found = (c.c_double * (len(knowns) if adjoint else len(unknowns)))()
        sizes = c.c_size_t(len(unknowns)), c.c_size_t(len(knowns)), c.c_size_t(len(given)), c.c_size_t(len(found))
        name = "GetAdjointDerivative" if adjoint else "GetDirectionalDerivative"
        self.do(name, rows, sizes[0], columns, sizes[1], given, sizes[2], found, sizes[3], may_discard=True)
        return list(found)

    def output_derivatives(self, references: list[int]) -> list[float]:
        """Return the first time derivatives of outputs."""
        size = c.c_size_t(len(references))
        array, found = (c.c_uint32 * len(references))(*references), (c.c_double * len(references))()
        orders = (c.c_int32 * len(references))(*[1] * len(references))
        self.do("GetOutputDerivatives", array, size, orders, found, size, may_discard=True)
        return list(found)

    # Calls that capability flags claim; each returns its status.

    def output_derivative(self, output: Variable, order: int) -> int:
        """Ask for one time derivative of an output."""
        reference, orders, found = (c.c_uint32 * 1)(output.reference), (c.c_int32 * 1)(order), (c.c_double * 1)()
        one, shown = c.c_size_t(1), f"{output.name}, order {order}"
        return self.call("GetOutputDerivatives", reference, one, orders, found, one, shown=shown)

    def evaluate(self) -> int:
        """Evaluate the discrete states."""
        return self.call("EvaluateDiscreteStates")

    def number_of_dependencies(self, unknown: Variable) -> tuple[int, int]:
        """Return the status, and how many dependencies an unknown has."""
        size = c.c_size_t()
        status = self.call(
            "GetNumberOfVariableDependencies", c.c_uint32(unknown.reference), c.byref(size), shown=unknown.name
        )
        return status, size.value

    def dependencies(self, unknown: Variable, size: int) -> int:
        """Ask for the dependencies of an unknown."""
        elements, others = (c.c_size_t * max(size, 1))(), (c.c_size_t * max(size, 1))()
        references, kinds = (c.c_uint32 * max(size, 1))(), (c.c_int * max(size, 1))()
        given = (c.c_uint32(unknown.reference), elements, references, others, kinds, c.c_size_t(size))
        return self.call("GetVariableDependencies", *given, shown=unknown.name)

    def activate(self, clock: Variable, t: float) -> None:
        """Activate the model partition of a clock."""
        self.do("ActivateModelPartition", c.c_uint32(clock.reference), c.c_double(t), shown=clock.name)


_VECTORS = {
    "derivatives": "GetContinuousStateDerivatives",
    "states": "GetContinuousStates",
    "indicators": "GetEventIndicators",
    "nominals": "GetNominalsOfContinuousStates",
}


def _go_on(environment: Any, t: float, *flags: Any) -> None:
    early_return_requested = flags[-2]
    if early_return_requested:
        early_return_requested[0] = False


def _value(kind: str, text: str) -> Any:
    if kind == "String":
        return text.encode()
    if kind == "Boolean":
        return text in ("true", "1")
    if kind.startswith("Float"):
        return float(text.replace("INF", "inf"))
    return int(text)

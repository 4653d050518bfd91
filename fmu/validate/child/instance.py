"""One instance of an FMU as the experiments use it: what both versions of the standard do alike."""

from __future__ import annotations

import ctypes as c
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from fmu.standard.value_types import C_TYPES, accessor, start_value
from fmu.validate.child.calls import DISCARD, Library, Step, Update, Variable

_VECTORS = {
    "derivatives": "GetContinuousStateDerivatives",
    "states": "GetContinuousStates",
    "indicators": "GetEventIndicators",
    "nominals": "GetNominalsOfContinuousStates",
}


def array(made: Any, values: Sequence[Any]) -> Any:
    """Return an array in C, of one element at least, that holds some values."""
    return (made * max(len(values), 1))(*values)


def references(*values: int) -> tuple[Any, c.c_size_t]:
    """Return value references as two arguments: the array, and how many there are."""
    return array(c.c_uint32, values), c.c_size_t(len(values))


class Instance(Library):
    """An instance; functions go by their names of FMI 3.0.

    Attributes
    ----------
    events : bool
        Whether Event Mode is used in Co-Simulation.
    """

    events = False

    @abstractmethod
    def instantiate(self, token: str) -> bool:
        """Make an instance; tell whether there is one."""

    @abstractmethod
    def enter_initialization(self) -> None:
        """Enter initialisation over the planned experiment."""

    @abstractmethod
    def update(self) -> Update:
        """Update discrete states once."""

    @abstractmethod
    def step(self, t: float, h: float) -> Step:
        """Do a step; the statuses Error and Fatal are returned as such."""

    @abstractmethod
    def counts(self) -> tuple[int, int]:
        """Return the numbers of continuous states and event indicators."""

    def make(self, name: str, *arguments: Any) -> bool:
        """Call a function that makes an instance."""
        self.recorder.at(self.spelled(name))
        function = self.function(name)
        function.restype = c.c_void_p  # type: ignore[attr-defined]
        found = function(*arguments)
        self.handle = c.c_void_p(found) if found else None
        return bool(found)

    def free(self) -> None:
        """Free the instance."""
        self.recorder.at(self.spelled("FreeInstance"))
        function = self.function("FreeInstance")
        function.restype = None  # type: ignore[attr-defined]
        function(self.handle)
        self.handle = None

    @property
    def boolean(self) -> Any:
        """The type of truth values in C."""
        return C_TYPES[self.major]["Boolean"]

    def experiment(self) -> tuple[Any, ...]:
        """Return the planned experiment as arguments: no tolerance, start, stop."""
        start, stop = c.c_double(self.plan["start"]), c.c_double(self.plan["stop"])
        return self.boolean(0), c.c_double(0.0), start, self.boolean(1), stop

    def _counted(self, values: Any, size: int) -> tuple[Any, ...]:
        """Return an array of values as arguments; FMI 3.0 is told their number as well."""
        return (values,) if self.major == 2 else (values, c.c_size_t(size))

    def set(self, variable: Variable) -> None:
        """Set a variable to its start value."""
        values = [start_value(variable.type, text) for text in variable.start or []]
        self.put(variable, values * variable.size if len(values) == 1 else values)

    def put(self, variable: Variable, values: list[Any]) -> None:
        """Set a variable."""
        made = array(C_TYPES[self.major][variable.type], values)
        name, given = f"Set{accessor(variable.type, self.major)}", self._counted(made, len(values))
        self.do(name, *references(variable.reference), *given, shown=variable.name)

    def get(self, variable: Variable) -> tuple[list[Any], bytes]:
        """Return a variable's values, and their bits."""
        found = (C_TYPES[self.major][variable.type] * max(variable.size, 1))()
        name, given = f"Get{accessor(variable.type, self.major)}", self._counted(found, variable.size)
        self.do(name, *references(variable.reference), *given, shown=variable.name)
        if variable.type == "String":
            if any(text is None for text in found):
                text = f"{self.spelled(name)}({variable.name}) gives a NULL pointer."
                raise self.recorder.stop("run.string", text)
            return [], b"\0".join(found)
        return list(found), bytes(found)

    # Model Exchange.

    def vector(self, name: str, size: int) -> list[float]:
        """Call a function that fills an array: `derivatives`, `states`, `indicators`, `nominals`."""
        found = (c.c_double * max(size, 1))()
        if size:
            self.do(_VECTORS[name], found, c.c_size_t(size))
        return list(found)[:size]

    def trial_derivatives(self, size: int) -> list[float] | None:
        """Return the state derivatives at a point that an integrator tries; None where the FMU discards it."""
        found = (c.c_double * max(size, 1))()
        if size:
            status = self.call(_VECTORS["derivatives"], found, c.c_size_t(size))
            if status == DISCARD:
                return None
            self.require(_VECTORS["derivatives"], status)
        return list(found)[:size]

    def set_states(self, t: float, x: list[float]) -> None:
        """Set time and continuous states."""
        self.do("SetTime", c.c_double(t), shown=repr(t))
        if x:
            self.do("SetContinuousStates", array(c.c_double, x), c.c_size_t(len(x)))

    def completed_step(self) -> tuple[bool, bool]:
        """Tell the FMU of a completed step; return whether it wants an event, and an end."""
        event, terminate = self.boolean(), self.boolean()
        self.do("CompletedIntegratorStep", self.boolean(1), c.byref(event), c.byref(terminate))
        return bool(event.value), bool(terminate.value)

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
        self.do("DeserializeFMUState", array(c.c_uint8, content), c.c_size_t(len(content)), c.byref(state))
        return state

    # Derivatives.

    def directional(
        self, unknowns: list[int], knowns: list[int], seed: list[float], *, adjoint: bool = False
    ) -> list[float]:
        """Return the product of the Jacobian of scalars, or of its transpose (FMI 3.0), and a seed."""
        found = (c.c_double * (len(knowns) if adjoint else len(unknowns)))()
        given = (*self._counted(array(c.c_double, seed), len(seed)), *self._counted(found, len(found)))
        name = "GetAdjointDerivative" if adjoint else "GetDirectionalDerivative"
        self.do(name, *references(*unknowns), *references(*knowns), *given, may_discard=True)
        return list(found)

    def output_derivatives(self, outputs: list[int]) -> list[float]:
        """Return the first time derivatives of outputs."""
        found = (c.c_double * len(outputs))()
        orders = array(c.c_int32, [1] * len(outputs))
        given = (*references(*outputs), orders, *self._counted(found, len(found)))
        self.do("GetOutputDerivatives", *given, may_discard=True)
        return list(found)

    def output_derivative(self, output: Variable, order: int) -> int:
        """Ask for one time derivative of an output, and return the status: a capability claims that there is one."""
        given = (*references(output.reference), array(c.c_int32, [order]), *self._counted((c.c_double * 1)(), 1))
        return self.call("GetOutputDerivatives", *given, shown=f"{output.name}, order {order}")

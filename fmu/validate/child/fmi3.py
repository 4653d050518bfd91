"""FMI 3.0 as the experiments use it: what it does otherwise than FMI 2.0, or alone."""

from __future__ import annotations

import ctypes as c
from typing import Any

from fmu.validate.child.calls import DISCARD, OK, WARNING, Recorder, Step, Update, Variable
from fmu.validate.child.instance import Instance, references

_LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
_INTERMEDIATE = c.CFUNCTYPE(None, c.c_void_p, c.c_double, *([c.c_bool] * 5), c.POINTER(c.c_bool), c.POINTER(c.c_double))
_PLAIN = c.CFUNCTYPE(None)
_CLOCK_UPDATE = c.CFUNCTYPE(None, c.c_void_p)


class Fmi3(Instance):
    """One instance of an FMI 3.0 FMU."""

    major = 3

    def __init__(self, plan: dict[str, Any], recorder: Recorder) -> None:
        super().__init__(plan, recorder)
        self.events = bool(plan["event_mode"])
        self._log = _LOGGER(lambda environment, status, category, message: self.logged(message))
        self._intermediate = _INTERMEDIATE(_go_on)
        self._clock_update = _CLOCK_UPDATE(lambda environment: None)
        self._lock = _PLAIN(lambda: None)

    def instantiate(self, token: str) -> bool:
        """See `Instance.instantiate`."""
        no, events = c.c_bool(False), c.c_bool(self.events)
        own: dict[str, list[Any]] = {
            "CoSimulation": [events, events, None, c.c_size_t(0), None, self._log, self._intermediate],
            "ModelExchange": [None, self._log],
            "ScheduledExecution": [None, self._log, self._clock_update, self._lock, self._lock],
        }
        kind, resources = self.plan["kind"], self.plan["resources"].encode()
        return self.make(f"Instantiate{kind}", b"checked", token.encode(), resources, no, no, *own[kind])

    def enter_initialization(self) -> None:
        """See `Instance.enter_initialization`."""
        self.do("EnterInitializationMode", *self.experiment())

    def get(self, variable: Variable) -> tuple[list[Any], bytes]:
        """Return a variable's values, and their bits."""
        if variable.type == "Clock":
            ticks = (c.c_bool * 1)()
            self.do("GetClock", *references(variable.reference), ticks, shown=variable.name)
            return list(ticks), bytes(ticks)
        if variable.type == "Binary":
            size = max(variable.size, 1)
            sizes, places = (c.c_size_t * size)(), (c.c_void_p * size)()
            given = (*references(variable.reference), sizes, places, c.c_size_t(variable.size))
            self.do("GetBinary", *given, shown=variable.name)
            found = zip(places, sizes, strict=True)
            return [], b"\0".join(c.string_at(place, n) if place and n else b"" for place, n in found)
        return super().get(variable)

    def update(self) -> Update:
        """See `Instance.update`."""
        flags, time = [c.c_bool() for _ in range(5)], c.c_double()
        self.do("UpdateDiscreteStates", *map(c.byref, flags), c.byref(time))
        again, terminate, _, _, defined = (flag.value for flag in flags)
        return Update(again, terminate, time.value if defined else None)

    def step(self, t: float, h: float) -> Step:
        """See `Instance.step`."""
        event, terminate, early, time = c.c_bool(), c.c_bool(), c.c_bool(), c.c_double(t)
        pointers = (c.byref(event), c.byref(terminate), c.byref(early), c.byref(time))
        status = self.call("DoStep", c.c_double(t), c.c_double(h), c.c_bool(False), *pointers, shown=f"{t!r}, {h!r}")
        return Step(
            status, event.value, terminate.value, early.value, time.value if status in (OK, WARNING, DISCARD) else t
        )

    def counts(self) -> tuple[int, int]:
        """See `Instance.counts`."""
        states, indicators = c.c_size_t(), c.c_size_t()
        self.do("GetNumberOfContinuousStates", c.byref(states))
        self.do("GetNumberOfEventIndicators", c.byref(indicators))
        return states.value, indicators.value

    # Of FMI 3.0 only; where a capability claims a call, its status is returned.

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


def _go_on(environment: Any, t: float, *flags: Any) -> None:
    early_return_requested = flags[-2]
    if early_return_requested:
        early_return_requested[0] = False

"""One instance of an FMU: every status and every log line is kept, nothing is corrected or hidden."""

import ctypes as c
import math
from typing import NamedTuple

from fmi_driver.binary import DISCARD, INTERMEDIATE, LOGGERS, OK, Callbacks, EventInfo, doubles, references


class Line(NamedTuple):
    """A line of the log."""

    status: int
    category: str
    text: str


class Update(NamedTuple):
    """What an update of the discrete states says."""

    status: int
    again: bool
    terminate: bool
    states_changed: bool
    next_time: float | None


class Step(NamedTuple):
    """What a step says; in FMI 2.0 by fmi2Discard and the status functions."""

    status: int
    event: bool
    terminate: bool
    early: bool
    time: float


class Component:
    """One instance: `call` returns a status, `do` insists on OK."""

    def __init__(
        self,
        binary,
        kind="cs",
        *,
        events=False,
        early=False,
        name=b"block",
        token=None,
        logger=True,
        logging=False,
        intermediate=None,
        required=(),
    ):
        self.binary, self.kind, self.events, self.early = binary, kind, events, early
        self.log = []
        self.last_format = None
        token = binary.token if token is None else token
        if binary.version == 2:
            self.listen = LOGGERS[2](self._listen2) if logger else LOGGERS[2]()
            self.callbacks = Callbacks(self.listen, None, None, None, None)
            self.handle = binary.functions.fmi2Instantiate(
                name, 1 if kind == "cs" else 0, token, None, c.byref(self.callbacks), 0, int(logging)
            )
            return
        self.listen = LOGGERS[3](self._listen3) if logger else None
        self.intermediate = INTERMEDIATE(intermediate) if intermediate else None
        if kind == "me":
            self.handle = binary.functions.fmi3InstantiateModelExchange(
                name, token, None, c.c_bool(False), c.c_bool(logging), None, self.listen
            )
            return
        self.handle = binary.functions.fmi3InstantiateCoSimulation(
            name, token, None, c.c_bool(False), c.c_bool(logging), c.c_bool(events), c.c_bool(early),
            references(required), c.c_size_t(len(required)), None, self.listen, self.intermediate,
        )  # fmt: skip

    def _listen2(self, environment, name, status, category, form, text):
        self.last_format = form
        self.log.append(Line(status, category.decode(), text.decode()))

    def _listen3(self, environment, status, category, text):
        self.log.append(Line(status, category.decode(), text.decode()))

    @property
    def errors(self):
        return [line.text for line in self.log if line.category == "logStatusError"]

    @property
    def jumps(self):
        """The jumps that were logged: (name, time)."""
        found = []
        for line in self.log:
            if line.category == "logEvents":
                head, _, time = line.text.rstrip(".").rpartition(" jumps at t = ")
                found.append((head.split("'")[1], float(time)))
        return found

    def call(self, name, *arguments):
        return getattr(self.binary.functions, self.binary.function(name))(c.c_void_p(self.handle), *arguments)

    def do(self, name, *arguments):
        status = self.call(name, *arguments)
        assert status == OK, (name, status, self.log[-3:])

    def free(self):
        function = getattr(self.binary.functions, self.binary.function("FreeInstance"))
        function.restype = None
        function(c.c_void_p(self.handle))
        self.handle = None

    # Life cycle.

    def enter_initialization(self, t_start=0.0, t_stop=None, tolerance=None):
        """Return the status of the last call that is needed."""
        boolean = self.binary.boolean
        experiment = (
            boolean(tolerance is not None), c.c_double(tolerance or 0.0), c.c_double(t_start),
            boolean(t_stop is not None), c.c_double(0.0 if t_stop is None else t_stop),
        )  # fmt: skip
        if self.binary.version == 3:
            return self.call("EnterInitializationMode", *experiment)
        status = self.call("SetupExperiment", *experiment)
        return status or self.call("EnterInitializationMode")

    def initialize(self, t_start=0.0, t_stop=None, **start):
        """To the end of initialisation; starts are set in Initialization Mode."""
        assert self.enter_initialization(t_start, t_stop) == OK, self.log
        for name, value in start.items():
            self.set(name, value)
        self.do("ExitInitializationMode")

    def begin(self, t_start=0.0, t_stop=None, **start):
        """From Instantiated to where time goes on; returns the last update, if there was one."""
        self.initialize(t_start, t_stop, **start)
        return self.settle() if self.starts_in_event_mode else None

    @property
    def starts_in_event_mode(self):
        return self.kind == "me" or self.events

    # Values.

    def access(self, function, kind, numbers, values, n_values=None):
        """A getter or setter with plain arrays: its status and the array."""
        array = (self.binary.c_type(kind) * max(len(values), 1))(*values)
        more = () if self.binary.version == 2 or kind == "Clock" else (
            c.c_size_t(len(values) if n_values is None else n_values),
        )  # fmt: skip
        status = self.call(f"{function}{kind}", references(numbers), c.c_size_t(len(numbers)), array, *more)
        return status, list(array)

    def whole(self, function, name, values=None):
        variable = self.binary.variables[name]
        values = [0] * math.prod(variable.shape or ()) if values is None else values
        return self.access(function, variable.type, [variable.valueReference], values)

    def get(self, name):
        whole, index = self.binary.elements[name]
        status, values = self.whole("Get", whole)
        assert status == OK, (name, self.log[-3:])
        return values[index]

    def try_set(self, name, value):
        """Set a variable, or an element of an array; returns the status."""
        whole, index = self.binary.elements[name]
        if self.binary.variables[whole].type in ("Integer", "Int32"):
            value = round(value)
        values = [value]
        if self.binary.variables[whole].shape:
            values = self.whole("Get", whole)[1]
            values[index] = value
        return self.whole("Set", whole, values)[0]

    def set(self, name, value):
        assert self.try_set(name, value) == OK, (name, value, self.log[-3:])

    def values(self):
        """All values but the clocks', by name."""
        return {
            name: self.get(name)
            for name, (whole, _) in self.binary.elements.items()
            if self.binary.variables[whole].type != "Clock"
        }

    def ticks(self):
        return tuple(name for name in self.binary.clocks if self.get(name))

    # Events and steps.

    def update(self):
        if self.binary.version == 2:
            info = EventInfo()
            status = self.call("UpdateDiscreteStates", c.byref(info))
            next_time = info.time if info.defined else None
            return Update(status, bool(info.again), bool(info.terminate), bool(info.states), next_time)
        flags, time = [c.c_bool() for _ in range(5)], c.c_double()
        status = self.call("UpdateDiscreteStates", *map(c.byref, flags), c.byref(time))
        again, terminate, _, changed, defined = (flag.value for flag in flags)
        return Update(status, again, terminate, changed, time.value if defined else None)

    def iterate(self):
        """Event Mode to its end.

        Returns the clocks of each iteration that had some, and the last update, with `states_changed` if any of them
        said so.
        """
        found, changed = [], False
        for _ in range(2000):
            ticks = self.ticks()
            update = self.update()
            assert update.status == OK, self.log[-3:]
            changed = changed or update.states_changed
            if ticks:
                found.append(ticks)
            if update.terminate or not update.again:
                return found, update._replace(states_changed=changed)
        raise AssertionError("2000 event iterations")

    def settle(self):
        """Event Mode to its end, and on to Step Mode or Continuous-Time Mode; returns the last update."""
        _, update = self.iterate()
        if not update.terminate:
            self.do("EnterStepMode" if self.kind == "cs" else "EnterContinuousTimeMode")
        return update

    def handle_event(self):
        """Into Event Mode and through it, as `settle`."""
        self.do("EnterEventMode")
        return self.settle()

    def step(self, t, h):
        point, size = c.c_double(t), c.c_double(h)
        if self.binary.version == 3:
            flags, time = [c.c_bool() for _ in range(3)], c.c_double()
            status = self.call("DoStep", point, size, c.c_bool(True), *map(c.byref, flags), c.byref(time))
            return Step(status, *(flag.value for flag in flags), time.value)
        status = self.call("DoStep", point, size, 1)
        if status != DISCARD:
            return Step(status, False, False, False, t + h if status == OK else t)
        return Step(status, not self.is_over(), self.is_over(), True, self.last_time())

    def last_time(self):
        """FMI 2.0: the time that the last step came to."""
        time = c.c_double()
        self.do("GetRealStatus", 2, c.byref(time))
        return time.value

    def is_over(self):
        """FMI 2.0: whether the FMU wants to end the run."""
        over = c.c_int()
        self.do("GetBooleanStatus", 3, c.byref(over))
        return bool(over.value)

    # States.

    def save(self, pointer=None):
        pointer = c.c_void_p() if pointer is None else pointer
        self.do("GetFMUState", c.byref(pointer))
        return pointer

    def load(self, pointer):
        self.do("SetFMUState", pointer)

    def forget(self, pointer):
        self.do("FreeFMUState", c.byref(pointer))

    def serialize(self, pointer):
        size = c.c_size_t()
        self.do("SerializedFMUStateSize", pointer, c.byref(size))
        data = (c.c_ubyte * size.value)()
        self.do("SerializeFMUState", pointer, data, size)
        return bytes(data)

    def bytes(self):
        """All of the present state."""
        pointer = self.save()
        data = self.serialize(pointer)
        self.forget(pointer)
        return data

    def deserialize(self, data):
        """Return the status and the state."""
        pointer = c.c_void_p()
        array = (c.c_ubyte * len(data)).from_buffer_copy(data) if data else (c.c_ubyte * 1)()
        status = self.call("DeserializeFMUState", array, c.c_size_t(len(data)), c.byref(pointer))
        return status, pointer

    # Derivatives.

    def derivative(self, function, unknowns, knowns, seed):
        """Directional or adjoint derivatives: the status and the result."""
        forward = function == "GetDirectionalDerivative"
        size = sum(math.prod(self.binary.variables[n].shape or ()) for n in (unknowns if forward else knowns))
        result = doubles([math.pi] * size)
        lists = [x for names in (unknowns, knowns) for x in self._list(names)]
        if self.binary.version == 2:
            return self.call(function, *lists, doubles(seed), result), list(result)[:size]
        sizes = c.c_size_t(len(seed)), c.c_size_t(size)
        status = self.call(function, *lists, doubles(seed), sizes[0], result, sizes[1])
        return status, list(result)[:size]

    def rates(self, names, order=1):
        """Derivatives of outputs with respect to time: the status and the values."""
        result = doubles([math.pi] * len(names))
        orders = (c.c_int32 * max(len(names), 1))(*[order] * len(names))
        more = () if self.binary.version == 2 else (c.c_size_t(len(names)),)
        return self.call("GetOutputDerivatives", *self._list(names), orders, result, *more), list(result)

    def _list(self, names):
        return references([self.binary.reference(name) for name in names]), c.c_size_t(len(names))

    # Model Exchange.

    def be_at(self, t, x):
        self.do("SetTime", c.c_double(t))
        self.do("SetContinuousStates", doubles(x), c.c_size_t(len(x)))

    def vector(self, function, n):
        """A getter of a vector: the status and the values."""
        array = doubles([math.pi] * n)
        return self.call(function, array, c.c_size_t(n)), list(array)[:n]

    def completed(self):
        """Return (status, enter event mode, terminate)."""
        event, terminate = self.binary.boolean(), self.binary.boolean()
        status = self.call("CompletedIntegratorStep", self.binary.boolean(True), c.byref(event), c.byref(terminate))
        return status, bool(event.value), bool(terminate.value)

"""An FMI 3.0 Co-Simulation FMU driven by its plain C functions: no wrapper of anybody else's in between.

`Library` loads an FMU, `Instance` is one instance of it with every status and log line kept, and the functions at the
end are the ways in which importers run an FMU.
"""

import ctypes as c
import itertools
import math
import os
import random
import shutil
from pathlib import Path
from typing import NamedTuple

import fmpy

OK, ERROR = 0, 3
TYPES = {"Float64": c.c_double, "Int32": c.c_int32, "UInt64": c.c_uint64, "Boolean": c.c_bool, "Clock": c.c_bool}
LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)


class Update(NamedTuple):
    """What fmi3UpdateDiscreteStates says."""

    status: int
    again: bool
    terminate: bool
    values_changed: bool
    next_time: float | None


class Step(NamedTuple):
    """What fmi3DoStep says."""

    status: int
    event: bool
    terminate: bool
    early: bool
    time: float


class Library:
    """An FMU's binary and what its description says of the variables."""

    def __init__(self, path):
        self.description = fmpy.read_model_description(str(path))
        self.folder = unpacked(Path(path))
        self.token = self.description.instantiationToken.encode()
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.clocks = [n for n, v in self.variables.items() if v.type == "Clock" and v.causality == "output"]
        self.elements = {name: place for v in self.description.modelVariables for name, place in elements(v)}
        self.outputs = [
            name for name, v in self.variables.items() if v.causality == "output" and v.type in ("Float64", "Int32")
        ]
        self.scalars = [name for name, (whole, _) in self.elements.items() if self.variables[whole].type != "Clock"]
        [binary] = (self.folder / "binaries").rglob(f"*{fmpy.sharedLibraryExtension}")
        self.functions = c.CDLL(str(binary))
        self.functions.fmi3InstantiateCoSimulation.restype = c.c_void_p
        self.functions.fmi3GetVersion.restype = c.c_char_p

    def reference(self, name):
        return self.variables[name].valueReference


def unpacked(path):
    """The folder beside an FMU with its content; made once, whatever the number of test processes."""
    folder, own = path.with_suffix(".unzipped"), path.with_suffix(f".{os.getpid()}")
    if not folder.exists():  # a binary that is loaded must not be written again
        fmpy.extract(str(path), str(own))
        try:
            own.rename(folder)
        except OSError:  # another process was faster
            shutil.rmtree(own)
    return folder


def elements(variable):
    """The names of a variable's scalars, counted from 1 row by row, with its own name and their places in it."""
    if not variable.dimensions:
        return [(variable.name, (variable.name, 0))]
    indices = itertools.product(*(range(1, n + 1) for n in variable.shape))
    return [(f"{variable.name}[{','.join(map(str, i))}]", (variable.name, k)) for k, i in enumerate(indices)]


class Instance:
    """One instance: `call` returns a status, `do` insists on OK."""

    def __init__(self, library, *, events=True, early=True, name=b"block", token=None, logger=True):
        self.library = library
        self.events, self.early = events, early
        self.messages = []
        self.keep = LOGGER(lambda environment, status, category, text: self.messages.append(text.decode()))
        self.handle = library.functions.fmi3InstantiateCoSimulation(
            name,
            library.token if token is None else token,
            None,
            c.c_bool(False),
            c.c_bool(False),
            c.c_bool(events),
            c.c_bool(early),
            None,
            c.c_size_t(0),
            None,
            self.keep if logger else None,
            None,
        )

    def call(self, function, *arguments):
        return getattr(self.library.functions, f"fmi3{function}")(c.c_void_p(self.handle), *arguments)

    def do(self, function, *arguments):
        status = self.call(function, *arguments)
        assert status == OK, (function, status, self.messages)

    # Life cycle.

    def initialize(self, t_start=0.0, t_stop=None, **start):
        """From Instantiated to the end of initialisation; starts are set in Initialization Mode."""
        self.enter_initialization(t_start, t_stop)
        for name, value in start.items():
            self.set(name, value)
        self.do("ExitInitializationMode")

    def enter_initialization(self, t_start=0.0, t_stop=None):
        self.do(
            "EnterInitializationMode",
            c.c_bool(False),
            c.c_double(0.0),
            c.c_double(t_start),
            c.c_bool(t_stop is not None),
            c.c_double(t_stop or 0.0),
        )

    def free(self):
        self.library.functions.fmi3FreeInstance(c.c_void_p(self.handle))
        self.handle = None

    # Values.

    def access(self, function, kind, references, values, n_values=None):
        """Call a getter or setter with plain arrays; return its status and the array."""
        array = (TYPES[kind] * max(len(values), 1))(*values)
        pointers = (c.c_uint32 * max(len(references), 1))(*references)
        more = () if kind == "Clock" else (c.c_size_t(len(values) if n_values is None else n_values),)
        status = self.call(f"{function}{kind}", pointers, c.c_size_t(len(references)), array, *more)
        return status, list(array)

    def get(self, name):
        whole, index = self.library.elements[name]
        status, values = self.whole("Get", whole)
        assert status == OK, (name, self.messages)
        return values[index]

    def set(self, name, value):
        whole, index = self.library.elements[name]
        values = [value] if "[" not in name or whole == name else self.whole("Get", whole)[1]
        values[index] = round(value) if self.library.variables[whole].type == "Int32" else value
        status, _ = self.whole("Set", whole, values)
        assert status == OK, (name, value, self.messages)

    def whole(self, function, name, values=None):
        """Get or set a variable with all its elements."""
        variable = self.library.variables[name]
        values = [0] * math.prod(variable.shape or ()) if values is None else values
        return self.access(function, variable.type, [variable.valueReference], values)

    def values(self):
        """All values but the clocks', by name."""
        return {name: self.get(name) for name in self.library.scalars}

    def ticks(self):
        return tuple(name for name in self.library.clocks if self.get(name))

    # Events and steps.

    def update(self):
        flags = [c.c_bool() for _ in range(5)]
        time = c.c_double()
        status = self.call("UpdateDiscreteStates", *map(c.byref, flags), c.byref(time))
        again, terminate, _, changed, defined = (flag.value for flag in flags)
        return Update(status, again, terminate, changed, time.value if defined else None)

    def iterate(self):
        """Event Mode to its end: the clocks of each iteration that had some, and the last update."""
        found = []
        for _ in range(2000):
            ticks = self.ticks()
            update = self.update()
            assert update.status == OK, self.messages
            if ticks:
                found.append(ticks)
            if update.terminate or not update.again:
                return found, update
        raise AssertionError("2000 event iterations")

    def step(self, t, h):
        flags = [c.c_bool() for _ in range(3)]
        time = c.c_double()
        status = self.call("DoStep", c.c_double(t), c.c_double(h), c.c_bool(True), *map(c.byref, flags), c.byref(time))
        return Step(status, *(flag.value for flag in flags), time.value)

    # States.

    def save(self, pointer=None):
        pointer = c.c_void_p() if pointer is None else pointer
        self.do("GetFMUState", c.byref(pointer))
        return pointer

    def load(self, pointer):
        self.do("SetFMUState", pointer)


class Record(NamedTuple):
    """A run: outputs at the communication points, (time, clocks) of each event iteration, and how it ended."""

    samples: list
    ticks: list
    terminated: bool
    n_steps: int


def advance(instance, points, *, obey=False, changes=()):
    """Run an instance that has been initialised through increasing communication points.

    Parameters
    ----------
    instance : Instance
        In Event Mode, or in Step Mode if it has no events: just initialised.
    points : sequence of float
        The first is the present time.
    obey : bool
        Make no step beyond the next event time that the FMU has announced.
    changes : sequence of (float, str, float)
        Inputs to be set at points.
    """
    t, ticks, samples, n_steps, update = points[0], [], [], 0, None
    if instance.events:
        found, update = instance.iterate()
        ticks += [(t, clocks) for clocks in found]
        if update.terminate:
            return Record(samples, ticks, True, n_steps)
        samples.append((t, tuple(map(instance.get, instance.library.outputs))))
        instance.do("EnterStepMode")
    else:
        samples.append((t, tuple(map(instance.get, instance.library.outputs))))
    for point in points[1:]:
        while t < point:
            announced = update.next_time if obey and update is not None else None
            target = point if announced is None else min(point, max(announced, t))
            result = instance.step(t, target - t)
            n_steps += 1
            assert result.status == OK, (t, target, instance.messages)
            arrival = t + (target - t)  # what the FMU can know of the target: differences of floats round
            assert result.time <= arrival if result.early or result.terminate else result.time == arrival
            assert result.time >= t
            t = result.time if result.early or result.terminate else target
            if result.terminate:
                return Record(samples, ticks, True, n_steps)
            assert instance.events or not result.event
            here = [(name, value) for at, name, value in changes if at == t]
            if result.event or (instance.events and (here or t == announced)):
                instance.do("EnterEventMode")
                for name, value in here:
                    instance.set(name, value)
                found, update = instance.iterate()
                ticks += [(t, clocks) for clocks in found]
                if update.terminate:
                    return Record(samples, ticks, True, n_steps)
                instance.do("EnterStepMode")
            elif not instance.events:
                for name, value in here:
                    instance.set(name, value)
        samples.append((t, tuple(map(instance.get, instance.library.outputs))))
    return Record(samples, ticks, False, n_steps)


class Walk:
    """An importer that can stop between any two calls: it goes on from where the instance is.

    What it does next is decided by what the instance is in, by `rng`, and by nothing else.
    """

    def __init__(self, instance, *, inputs=()):
        self.instance = instance
        self.inputs = inputs
        self.mode, self.t, self.over = "event" if instance.events else "step", instance.get("time"), False

    def copy_place(self):
        return self.mode, self.t, self.over

    def return_to(self, place):
        self.mode, self.t, self.over = place

    def call(self, rng):
        """One call; everything that can be seen after it, as exact numbers."""
        instance = self.instance
        if self.over:
            return ("over", instance.step(self.t, 0.1) if self.mode == "step" else None)
        if self.mode == "event":
            if self.inputs and rng.random() < 0.3:
                instance.set(rng.choice(self.inputs), rng.uniform(-0.1, 0.3))
            ticks = instance.ticks()
            seen = instance.update()
            self.over = seen.terminate
            if not seen.again and not seen.terminate:
                instance.do("EnterStepMode")
                self.mode = "step"
            return ticks, seen, instance.values()
        seen = instance.step(self.t, rng.choice([1e-3, 0.02, 0.11, 0.4]))
        assert seen.status == OK, instance.messages
        self.t, self.over = seen.time, seen.terminate
        if seen.event and instance.events:
            before = instance.values()
            instance.do("EnterEventMode")
            self.mode = "event"
            return seen, before, instance.values()
        return seen, instance.values()

    def run(self, seed, n):
        rng = random.Random(seed)
        return [self.call(rng) for _ in range(n)]

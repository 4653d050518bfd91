"""A loaded FMU: its C functions by one name for both versions, its types, and what its description says.

Functions are called by their FMI 3.0 names without the prefix; `Binary.function` gives the name in the version at
hand.
"""

import ctypes as c
import itertools
import os
import shutil
from pathlib import Path

import fmpy

OK, DISCARD, ERROR = 0, 2, 3
OLD_NAMES = {
    "GetFMUState": "GetFMUstate",
    "SetFMUState": "SetFMUstate",
    "FreeFMUState": "FreeFMUstate",
    "SerializedFMUStateSize": "SerializedFMUstateSize",
    "SerializeFMUState": "SerializeFMUstate",
    "DeserializeFMUState": "DeSerializeFMUstate",
    "UpdateDiscreteStates": "NewDiscreteStates",
    "GetContinuousStateDerivatives": "GetDerivatives",
    "GetOutputDerivatives": "GetRealOutputDerivatives",
}
C_TYPES = {
    "Real": c.c_double,
    "Integer": c.c_int32,
    "Float64": c.c_double,
    "Int32": c.c_int32,
    "UInt64": c.c_uint64,
    "Clock": c.c_bool,
}
NUMBERS = ("Real", "Integer", "Float64", "Int32")
LOGGERS = {
    # The version 2 logger is variadic; its text is the one argument of the format "%s".
    2: c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p, c.c_char_p),
    3: c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p),
}
INTERMEDIATE = c.CFUNCTYPE(
    None, c.c_void_p, c.c_double, *[c.c_bool] * 4, c.POINTER(c.c_bool), c.POINTER(c.c_double)
)  # environment, time, set requested, get allowed, step finished, may return early, early return asked, its time


class Callbacks(c.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [
        ("logger", LOGGERS[2]),
        ("allocate", c.c_void_p),
        ("free", c.c_void_p),
        ("finished", c.c_void_p),
        ("environment", c.c_void_p),
    ]


class EventInfo(c.Structure):
    """fmi2EventInfo."""

    _fields_ = [(name, c.c_int) for name in ("again", "terminate", "nominals", "states", "defined")] + [
        ("time", c.c_double)
    ]


class Binary:
    """A loaded FMU and what its description says of the variables."""

    def __init__(self, path):
        self.fmu = Path(path)
        self.description = fmpy.read_model_description(str(path), validate=False)
        self.version = int(self.description.fmiVersion[0])
        self.token = (self.description.guid if self.version == 2 else self.description.instantiationToken).encode()
        [self.library] = (unpacked(self.fmu) / "binaries").rglob(f"*{fmpy.sharedLibraryExtension}")
        self.functions = c.CDLL(str(self.library))
        for name in ("fmi2Instantiate", "fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"):
            if name.startswith(f"fmi{self.version}"):
                getattr(self.functions, name).restype = c.c_void_p
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.elements = {name: place for v in self.description.modelVariables for name, place in elements(v)}
        self.states = [v.derivative.name for v in self.description.modelVariables if v.derivative is not None]
        self.state_elements = [name for name, (whole, _) in self.elements.items() if whole in self.states]
        self.n_states = len(self.state_elements)
        self.clocks = [n for n, v in self.variables.items() if v.type == "Clock" and v.causality == "output"]
        self.outputs = [n for n, v in self.variables.items() if v.causality == "output" and v.type in NUMBERS]
        self.float_type = "Real" if self.version == 2 else "Float64"

    def function(self, name):
        """The C name of a function."""
        if self.version == 3:
            return f"fmi3{name}"
        name = OLD_NAMES.get(name, name)
        return "fmi2" + name.replace("Float64", "Real").replace("Int32", "Integer")

    def reference(self, name):
        return self.variables[name].valueReference

    def boolean(self, value=False):
        return (c.c_bool if self.version == 3 else c.c_int)(value)

    def c_type(self, kind):
        return (c.c_bool if self.version == 3 else c.c_int) if kind == "Boolean" else C_TYPES[kind]


def references(numbers):
    return (c.c_uint32 * max(len(numbers), 1))(*numbers)


def doubles(values):
    return (c.c_double * max(len(values), 1))(*values)


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

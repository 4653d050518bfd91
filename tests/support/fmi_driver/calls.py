"""Every function of both versions: arguments for it, and the modes in which the standards allow it to be called."""

import ctypes as c
import math
from typing import NamedTuple

from fmi_driver.binary import DISCARD, OK, EventInfo, doubles, references

SETTLED = {"event", "step", "continuous"}
RUNNING = SETTLED | {"initialization", "terminated"}
FLOATS = ("Real", "Float64")
ANY = RUNNING | {"instantiated", "configuration"}
BEFORE_THE_END = ANY - {"terminated"}


class Case(NamedTuple):
    """Arguments, as a function of the component, and the modes in which a call is allowed, for each kind of instance.

    `refused` is the status elsewhere, `status` that of allowed calls.
    """

    arguments: object
    cs: set
    me: set
    version: int = 0
    status: int = OK


def fixed(*arguments):
    return lambda o: arguments


def room(o, kind=c.c_double, n=1):
    return (kind * n)()


def of_nothing(o):
    return (None, c.c_size_t(0), None) + (() if o.binary.version == 2 else (c.c_size_t(0),))


def one_value(o):
    return (references([0]), c.c_size_t(1), room(o)) + (() if o.binary.version == 2 else (c.c_size_t(1),))


def direction(o):
    """Along the first state (or array of states), of its rate."""
    state = o.binary.states[0]
    n = math.prod(o.binary.variables[state].shape or ())
    known, unknown = ((references([o.binary.reference(name)]), c.c_size_t(1)) for name in (state, f"der({state})"))
    if o.binary.version == 2:
        return *unknown, *known, doubles([1.0]), room(o)
    return *unknown, *known, doubles([1.0] * n), c.c_size_t(n), room(o, n=n), c.c_size_t(n)


def output_rate(o):
    name = next(name for name, v in o.binary.variables.items() if v.causality == "output" and v.type in FLOATS
                and v.variability == "continuous")  # fmt: skip
    n = math.prod(o.binary.variables[name].shape or ())
    more = () if o.binary.version == 2 else (c.c_size_t(n),)
    return references([o.binary.reference(name)]), c.c_size_t(1), (c.c_int32 * 1)(1), room(o, n=n), *more


def discrete_states(o):
    if o.binary.version == 2:
        return (c.byref(EventInfo()),)
    return *[c.byref(c.c_bool()) for _ in range(5)], c.byref(c.c_double())


def step(o):
    if o.binary.version == 2:
        return c.c_double(0.0), c.c_double(0.1), c.c_int(1)
    flags = [c.byref(c.c_bool()) for _ in range(3)]
    return c.c_double(0.0), c.c_double(0.1), c.c_bool(True), *flags, c.byref(c.c_double())


def experiment(o):
    boolean = o.binary.boolean
    return boolean(), c.c_double(0.0), c.c_double(0.0), boolean(), c.c_double(0.0)


def initialization(o):
    return experiment(o) if o.binary.version == 3 else ()


def completed(o):
    return o.binary.boolean(True), c.byref(o.binary.boolean()), c.byref(o.binary.boolean())


def data(o):
    array = (c.c_ubyte * len(o.saved_bytes)).from_buffer_copy(o.saved_bytes)
    return array, c.c_size_t(len(array))


def clock(name, o):
    return references([o.binary.reference(name)]), c.c_size_t(1)


def vector(o):
    return doubles([0.5] * o.binary.n_states), c.c_size_t(o.binary.n_states)


def indicators(o):
    return doubles([0.0, 0.0]), c.c_size_t(2)


def status(kind, value_type):
    return lambda o: (c.c_int(kind), c.byref(value_type()))


LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3
AFTER_STEPS = {"step", "terminated"}
NONE = set()
TABLE = {
    # Life cycle.
    "SetupExperiment": Case(experiment, {"instantiated"}, {"instantiated"}, 2),
    "EnterInitializationMode": Case(initialization, {"instantiated"}, {"instantiated"}),
    "ExitInitializationMode": Case(fixed(), {"initialization"}, {"initialization"}),
    "EnterConfigurationMode": Case(fixed(), {"instantiated"}, {"instantiated"}, 3),
    "ExitConfigurationMode": Case(fixed(), {"configuration"}, {"configuration"}, 3),
    "Terminate": Case(fixed(), SETTLED, SETTLED),
    "Reset": Case(fixed(), ANY, ANY),
    "SetDebugLogging": Case(lambda o: (o.binary.boolean(), c.c_size_t(0), None), ANY, ANY),
    # Values. The standards let nothing be read before initialisation; here start values are: nothing is lost by it,
    # and importers that show them before a run exist.
    "GetFloat64": Case(one_value, ANY, ANY),
    "GetInt32": Case(of_nothing, ANY, ANY),
    "GetBoolean": Case(of_nothing, ANY, ANY),
    "GetString": Case(of_nothing, ANY, ANY),
    "SetFloat64": Case(of_nothing, BEFORE_THE_END, BEFORE_THE_END),
    "SetInt32": Case(of_nothing, BEFORE_THE_END, BEFORE_THE_END),
    "SetBoolean": Case(of_nothing, BEFORE_THE_END, BEFORE_THE_END),
    "SetString": Case(of_nothing, BEFORE_THE_END, BEFORE_THE_END),
    # Saved states.
    "GetFMUState": Case(lambda o: (c.byref(c.c_void_p()),), ANY, ANY),
    "SetFMUState": Case(lambda o: (o.saved,), ANY, ANY),
    "FreeFMUState": Case(lambda o: (c.byref(c.c_void_p()),), ANY, ANY),
    "SerializedFMUStateSize": Case(lambda o: (o.saved, c.byref(c.c_size_t())), ANY, ANY),
    "SerializeFMUState": Case(lambda o: (o.saved, *data(o)), ANY, ANY),
    "DeserializeFMUState": Case(lambda o: (*data(o), c.byref(c.c_void_p())), ANY, ANY),
    # Derivatives. FMI 2.0 has no entry for them in the mode between steps of its tables, and one for after a step.
    "GetDirectionalDerivative": Case(direction, RUNNING, RUNNING),
    "GetAdjointDerivative": Case(direction, RUNNING, RUNNING, 3),
    "GetOutputDerivatives": Case(output_rate, AFTER_STEPS, NONE),
    # Events and steps. FMI 2.0 lets Event Mode be entered anew from Event Mode.
    "EnterEventMode": Case(fixed(), {"step"}, {"continuous"}, 3),
    "EnterEventMode ": Case(fixed(), NONE, {"continuous", "event"}, 2),
    "UpdateDiscreteStates": Case(discrete_states, {"event"}, {"event"}),
    "EnterStepMode": Case(fixed(), {"event"}, NONE, 3),
    "EnterContinuousTimeMode": Case(fixed(), NONE, {"event"}),
    "DoStep": Case(step, {"step"}, NONE),
    "CancelStep": Case(fixed(), NONE, NONE, 2),
    "GetRealStatus": Case(status(LAST_SUCCESSFUL_TIME, c.c_double), AFTER_STEPS, NONE, 2),
    "GetBooleanStatus": Case(status(TERMINATED, c.c_int), AFTER_STEPS, NONE, 2),
    # Statuses of steps that are still under way; no step ever is.
    "GetStatus": Case(status(0, c.c_int), AFTER_STEPS, NONE, 2, DISCARD),
    "GetStringStatus": Case(status(1, c.c_char_p), AFTER_STEPS, NONE, 2, DISCARD),
    "GetIntegerStatus": Case(status(0, c.c_int), AFTER_STEPS, NONE, 2, DISCARD),
    # Model Exchange. Nominals are constants, and the numbers of states and indicators are too, so they can be asked
    # for at any time, the latter by anybody.
    "SetTime": Case(fixed(c.c_double(0.0)), NONE, {"event", "continuous"}),
    "SetContinuousStates": Case(vector, NONE, {"continuous"}),
    "GetContinuousStates": Case(vector, NONE, RUNNING),
    "GetContinuousStateDerivatives": Case(vector, NONE, RUNNING),
    "GetEventIndicators": Case(indicators, NONE, RUNNING),
    "GetNominalsOfContinuousStates": Case(vector, NONE, ANY),
    "CompletedIntegratorStep": Case(completed, NONE, {"continuous"}),
    "GetNumberOfContinuousStates": Case(lambda o: (c.byref(c.c_size_t()),), ANY, ANY, 3),
    "GetNumberOfEventIndicators": Case(lambda o: (c.byref(c.c_size_t()),), ANY, ANY, 3),
    # Clocks. Outside Event Mode no clock ticks, and that can be read.
    "GetClock": Case(lambda o: (*clock(o.binary.clocks[0], o), room(o, c.c_bool)), ANY, ANY, 3),
    "SetClock": Case(lambda o: (*clock("next_event", o), room(o, c.c_bool)), {"event"}, {"event"}, 3),
    "GetIntervalDecimal": Case(
        lambda o: (*clock("next_event", o), room(o), room(o, c.c_int)),
        {"initialization", "event"},
        {"initialization", "event"},
        3,
    ),
}
UNSUPPORTED = {
    # What the descriptions of these FMUs do not promise.
    2: {"SetRealInputDerivatives": output_rate},
    3: {
        "GetIntervalFraction": lambda o: (*clock("next_event", o), *[room(o, c.c_uint64)] * 2, room(o, c.c_int)),
        "GetShiftDecimal": lambda o: (*clock("next_event", o), room(o)),
        "GetShiftFraction": lambda o: (*clock("next_event", o), *[room(o, c.c_uint64)] * 2),
        "SetIntervalDecimal": lambda o: (*clock("next_event", o), room(o)),
        "SetIntervalFraction": lambda o: (*clock("next_event", o), *[room(o, c.c_uint64)] * 2),
        "SetShiftDecimal": lambda o: (*clock("next_event", o), room(o)),
        "SetShiftFraction": lambda o: (*clock("next_event", o), *[room(o, c.c_uint64)] * 2),
        "EvaluateDiscreteStates": fixed(),
        "ActivateModelPartition": fixed(c.c_uint32(0), c.c_double(0.0)),
        "GetNumberOfVariableDependencies": lambda o: (c.c_uint32(0), c.byref(c.c_size_t())),
        "GetVariableDependencies": fixed(c.c_uint32(0), None, None, None, None, c.c_size_t(0)),
    },
}
for version, functions in UNSUPPORTED.items():
    TABLE |= {name: Case(arguments, NONE, NONE, version) for name, arguments in functions.items()}

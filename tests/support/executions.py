"""The runs of a case of the catalogue in Python, with inputs that step, and what an FMU of it shows."""

import functools

import numpy as np
from catalogue import cases

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, element_names


@functools.cache
def reference(name):
    """The run of a case; one for all tests of a process, which only read it."""
    return python_run(cases()[name])


def python_run(case):
    return hm.simulate(case.automaton, case.t_end, inputs=step_inputs(case), engine="python")


def step_inputs(case):
    """The inputs of a case as signals with breakpoints."""
    inputs = {}
    for variable in case.automaton.of_kind(Kind.INPUT):
        elements = element_names(variable)
        if any(name in case.steps for name in elements):
            breakpoints = sorted({t for name in elements for t, _ in case.steps.get(name, ())})
            inputs[variable.name] = hm.Signal(lambda t, v=variable: step_values(case, v, t), breakpoints)
    return inputs


def step_values(case, variable, t):
    start = starts(case.automaton)
    values = []
    for name in element_names(variable):
        values.append([start[name], *(value for time, value in case.steps.get(name, ()) if time <= t)][-1])
    return np.reshape(values, variable.shape)


def starts(automaton):
    return {
        name: float(value)
        for variable in automaton.variables
        for name, value in zip(element_names(variable), variable.start.ravel(), strict=True)
    }


def values_of(arc, name, times):
    """The values of a scalar at times up to the end of a run, by the name that it has in an FMU."""
    base, _, index = name.partition("[")
    values = arc.at(base, np.minimum(times, arc.t[-1]))
    return values[(..., *(int(i) - 1 for i in index.rstrip("]").split(",")))] if index else values


def shown(automaton):
    """The scalars that an FMU shows of states, discrete states and outputs."""
    kinds = (Kind.STATE, Kind.DISCRETE, Kind.OUTPUT)
    kept = [variable for kind in kinds for variable in automaton.of_kind(kind) if not variable.internal]
    return [name for variable in kept for name in element_names(variable)]

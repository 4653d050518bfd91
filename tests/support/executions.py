"""The runs of a case of the catalogue in Python, with inputs that step, and what an FMU of it shows."""

import bisect
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
    inputs, start = {}, starts(case.automaton)
    for variable in case.automaton.of_kind(Kind.INPUT):
        steps = {name: case.steps.get(name, ()) for name in element_names(variable)}
        if any(steps.values()):
            times = sorted({t for of_element in steps.values() for t, _ in of_element})
            # Before the first time the start values hold.
            held = [
                np.reshape([_last(start[name], steps[name], time) for name in steps], variable.shape)
                for time in (-np.inf, *times)
            ]
            inputs[variable.name] = hm.Signal(_steps(times, held), times)
    return inputs


def _last(start, steps, time):
    """The value at a time of an element that begins with one value and takes others at given times."""
    return [start, *(value for t, value in steps if t <= time)][-1]


def _steps(times, held):
    return lambda t: held[bisect.bisect_right(times, t)]


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

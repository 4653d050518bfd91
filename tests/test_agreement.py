"""The heart of the project: one automaton in three executions, and all three agree.

The Python run integrates with DOP853 over SciPy, the FMU with its own Dormand-Prince code in C, the co-simulation
predicts event by event: what they share is the automaton and nothing of the numerics.
"""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from catalogue import cases

import hybrid_model as hm
import hybrid_model.models
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model import consensus
from hybrid_model.variables import Kind, element_names

# The limits: times of events, and states.
TIME_TOLERANCE = 1e-7
STATE_TOLERANCE = 1e-8
SAMPLES = 41


class StepSource(hm.HybridAutomaton):
    """A discrete signal that takes given values at given times: the inputs of a block under test."""

    count = hm.Dimension()
    times = hm.Parameter(0.0, shape="count")
    values = hm.Parameter(0.0, shape="count")
    k = hm.DiscreteState(0, integer=True)
    signal = hm.DiscreteState(0.0, output=True)

    def next_time(self, s):
        return np.min(np.where(np.arange(s.times.shape[0]) >= s.k, s.times, np.inf))

    def move_on(self, s):
        return {"signal": np.sum(np.where(np.arange(s.times.shape[0]) == s.k, s.values, 0.0)), "k": s.k + 1}

    transitions = (hm.TimeEvent("step", next_time, move_on),)


def starts(automaton):
    return {
        name: float(value)
        for variable in automaton.variables
        for name, value in zip(element_names(variable), variable.start.ravel(), strict=True)
    }


def step_inputs(case):
    """The inputs of a case as signals with breakpoints."""
    inputs = {}
    for variable in case.automaton.of_kind(Kind.INPUT):
        elements = element_names(variable)
        if any(name in case.steps for name in elements):
            breakpoints = sorted({t for name in elements for t, _ in case.steps.get(name, ())})
            inputs[variable.name] = hm.Signal(lambda t, v=variable: step_values(case, v, t), breakpoints)
    return inputs


def python_run(case):
    """The reference."""
    return hm.simulate(case.automaton, case.t_end, inputs=step_inputs(case))


def step_values(case, variable, t):
    start = starts(case.automaton)
    values = []
    for name in element_names(variable):
        values.append([start[name], *(value for time, value in case.steps.get(name, ()) if time <= t)][-1])
    return np.reshape(values, variable.shape)


def cosimulate(case, slave):
    sources, wires = [], {}
    for k, (name, steps) in enumerate(case.steps.items()):
        times, values = zip(*steps, strict=True)
        automaton = StepSource(times=times, values=values, signal=starts(case.automaton)[name])
        sources.append(AutomatonSlave(f"source{k}", automaton))
        wires[f"block.{name}"] = f"source{k}.signal"
    return run_event_exact(System([*sources, slave], wires), case.t_end, output_interval=case.t_end / (SAMPLES - 1))


def compare(case, arc, result):
    """Same ticks in the same order, at the same times; same outputs at all output times."""
    clocks = {clock.jump: clock.name for clock in case.automaton.clocks}
    expected = [(jump.t, clocks[jump.index]) for jump in arc.jumps if jump.index in clocks]
    ticks = [(tick.t, tick.clock) for tick in result.ticks if tick.slave == "block"]
    assert [clock for _, clock in ticks] == [clock for _, clock in expected]
    np.testing.assert_allclose([t for t, _ in ticks], [t for t, _ in expected], rtol=0, atol=TIME_TOLERANCE)
    assert len(result.times) == SAMPLES
    for name in [port.removeprefix("block.") for port in result.signals if port.startswith("block.")]:
        base, _, index = name.partition("[")
        values = arc.at(base, np.minimum(result.times, arc.t[-1]))
        if index:
            values = values[(slice(None), *(int(i) - 1 for i in index.rstrip("]").split(",")))]
        np.testing.assert_allclose(result.signals[f"block.{name}"], values, rtol=0, atol=STATE_TOLERANCE, err_msg=name)


@pytest.fixture(scope="module")
def references():
    runs = {}

    def reference(name, case):
        if name not in runs:
            runs[name] = python_run(case)
        return runs[name]

    return reference


@pytest.mark.parametrize("name", list(cases()))
def test_in_process_cosimulation_agrees_with_python_run(name, references):
    case = cases()[name]
    compare(case, references(name, case), cosimulate(case, AutomatonSlave("block", case.automaton)))


@pytest.mark.parametrize("name", list(cases()))
def test_fmu_cosimulation_agrees_with_python_run(name, references, exported):
    case = cases()[name]
    slave = FmuSlave("block", exported(case.automaton, name))
    compare(case, references(name, case), cosimulate(case, slave))


def test_catalogue_is_complete():
    """A model that is added to the repository is added to the agreement test."""
    parts = set()

    def collect(automaton):
        parts.add(type(automaton))
        for part in getattr(automaton, "parts", {}).values():
            collect(part)

    for case in cases().values():
        collect(case.automaton)
    models = {getattr(hm.models, name) for name in hm.models.__all__}
    for found in pkgutil.iter_modules(consensus.__path__, "hybrid_model.consensus."):
        own = [item for item in vars(importlib.import_module(found.name)).values() if isinstance(item, type)]
        models |= {item for item in own if issubclass(item, hm.HybridAutomaton) and item.__module__ == found.name}
    bases = {base for part in parts for base in part.__mro__[1:]}
    assert {model for model in models - parts - bases if not inspect.isabstract(model)} == set()

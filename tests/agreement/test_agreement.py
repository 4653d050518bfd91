"""The heart of the project: one automaton in all its executions, and all of them agree.

The Python run integrates with DOP853 over SciPy, the native run and the FMU of Co-Simulation with their own
Dormand-Prince code in C, the co-simulation predicts event by event; the FMU of Model Exchange leaves integration and
location of events to an importer. What they share is the automaton and nothing of the numerics.
"""

import importlib
import inspect
import pkgutil
from dataclasses import replace

import numpy as np
import pytest
from catalogue import cases
from executions import python_run, reference, shown, starts, step_inputs, values_of
from own_importer import exchange, step_through

import hybrid_model as hm
import hybrid_model.models
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model import consensus
from hybrid_model.declare.variables import Kind

# The limits: times of events, and states.
TIME_TOLERANCE = 1e-7
STATE_TOLERANCE = 1e-8
SAMPLES = 41

# Models of seconds: a tenth of their run is verified by default, the whole with the long tests.
SLOW_TO_VERIFY = ("paper", "agent", "control", "vehicle", "ring", "absolute", "moving_agents", "double_integrators")

# The FMUs of FMI 2.0 are made for this test alone: a model of each kind in the quick run, all in the long one.
QUICK = {
    "agent2_dynamic",
    "ball_on_moving_table",
    "boost_converter",
    "bouncing_ball",
    "finite_state_machine",
    "gated_sine",
    "newtons_cradle",
    "sampled_lti_loop",
    "thermostat",
}


def fmi2_cases():
    """The catalogue, most of it for the long run."""
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in cases()]


# Case by case, so that all tests of one share its run in Python, and those after the first its traced maps.
each_case = pytest.mark.parametrize("name", list(cases()), scope="module")


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
        values = values_of(arc, name, result.times)
        np.testing.assert_allclose(result.signals[f"block.{name}"], values, rtol=0, atol=STATE_TOLERANCE, err_msg=name)


@each_case
def test_fmu_cosimulation_agrees_with_python_run(name, exported):
    case = cases()[name]
    slave = FmuSlave("block", exported(case.automaton, name))
    compare(case, reference(name), cosimulate(case, slave))


@each_case
def test_in_process_cosimulation_agrees_with_python_run(name):
    case = cases()[name]
    compare(case, reference(name), cosimulate(case, AutomatonSlave("block", case.automaton)))


@each_case
def test_native_run_agrees_with_python_run(name):
    case = cases()[name]
    plain = reference(name)
    fast = hm.simulate(case.automaton, case.t_end, inputs=step_inputs(case), engine="native")
    assert [(jump.name, jump.j) for jump in fast.jumps] == [(jump.name, jump.j) for jump in plain.jumps]
    # Two solvers at a relative tolerance of 1e-13, and rounding, magnified by what lies between two jumps.
    close = 5e-9 if name == "stiff_thermostat" else 1e-9  # 20 degC, where the slowest margin moves by 1e-3 K/s
    np.testing.assert_allclose([jump.t for jump in fast.jumps], [jump.t for jump in plain.jumps], rtol=0, atol=close)
    assert fast.stop is plain.stop
    assert fast.event_tolerance == pytest.approx(plain.event_tolerance)
    times = np.linspace(0.0, min(fast.t[-1], plain.t[-1]), 101)
    between = times[[not np.isclose(t, [jump.t for jump in plain.jumps], rtol=0, atol=2e-9).any() for t in times]]
    for variable in case.automaton.of_kind(Kind.STATE, Kind.DISCRETE, Kind.OUTPUT):
        # Of values above one, of them: the thermostat's 20 degC, van der Pol's v, which changes by 50 in a second.
        expected = plain.at(variable.name, between)
        np.testing.assert_allclose(fast.at(variable.name, between), expected, rtol=1e-10, atol=1e-10)


@each_case
def test_python_run_is_a_hybrid_arc(name):
    case = cases()[name]
    slow = name.startswith(SLOW_TO_VERIFY)
    arc = python_run(replace(case, t_end=case.t_end / 10)) if slow else reference(name)
    report = hm.verify(case.automaton, arc)
    assert report.ok, str(report)
    assert report.samples > 1


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in cases() if name.startswith(SLOW_TO_VERIFY)])
def test_whole_runs_of_networks_are_hybrid_arcs(name):
    report = hm.verify(cases()[name].automaton, reference(name))
    assert report.ok, str(report)


# What importers of FMI 2.0 and of Model Exchange do: there are no clocks, so the log tells the jumps.


def points(case):
    """The output times."""
    return [*(k * (case.t_end / (SAMPLES - 1)) for k in range(SAMPLES - 1)), case.t_end]


def compare_run(case, arc, run, *, without=()):
    """Same jumps in the same order, at the same times; same states and outputs at all output times but `without`."""
    visible = [jump for jump in arc.jumps if not case.automaton.jumps[jump.index].internal]
    assert [name for _, name in run.jumps] == [jump.name for jump in visible]
    np.testing.assert_allclose([t for t, _ in run.jumps], [jump.t for jump in visible], rtol=0, atol=TIME_TOLERANCE)
    assert run.times == points(case)
    assert list(run.values) == shown(case.automaton)
    kept = [k for k, t in enumerate(run.times) if t not in without]
    for name, found in run.values.items():
        values = values_of(arc, name, [run.times[k] for k in kept])
        np.testing.assert_allclose(np.array(found)[kept], values, rtol=0, atol=STATE_TOLERANCE, err_msg=name)


@each_case
def test_model_exchange_agrees_with_python_run(name, exported):
    model_exchange(name, "3.0", exported)


@pytest.mark.parametrize("name", fmi2_cases(), scope="module")
def test_fmi2_model_exchange_agrees_with_python_run(name, exported):
    model_exchange(name, "2.0", exported)


def model_exchange(name, fmi, exported):
    case = cases()[name]
    path = exported(case.automaton, name, fmi)
    run = exchange(path, case.t_end, points(case), steps=case.steps, names=shown(case.automaton))
    compare_run(case, reference(name), run)


@pytest.mark.parametrize("name", fmi2_cases(), scope="module")
def test_fmi2_cosimulation_agrees_with_python_run(name, exported):
    """Inputs change at communication points, and what they bring about is seen after the next step."""
    case = cases()[name]
    path = exported(case.automaton, name, "2.0")
    run = step_through(path, case.t_end, points(case), steps=case.steps, names=shown(case.automaton))
    changed = {t for steps in case.steps.values() for t, _ in steps}
    compare_run(case, reference(name), run, without=changed)


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
    for found in pkgutil.walk_packages(consensus.__path__, "hybrid_model.consensus."):
        own = [item for item in vars(importlib.import_module(found.name)).values() if isinstance(item, type)]
        models |= {item for item in own if issubclass(item, hm.HybridAutomaton) and item.__module__ == found.name}
    bases = {base for part in parts for base in part.__mro__[1:]}
    assert {model for model in models - parts - bases if not inspect.isabstract(model)} == set()

"""Faulty FMUs of our own C under the masters: each fault is named with the slave and the time, and nothing leaks.

Each guard is also taken out once: then the run does something else, so it is the guard that the tests see.
"""

import ctypes
import inspect
import re
import sys
import types

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings
from strangers import BACKWARD, BEYOND, FAILS, ITERATES, PASTS, REPEATS, STALLS, THRICE, WELL

import cosim.masters.queues
import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.exchange_slave import ExchangeSlave
from cosim.fmu_slave import FmuSlave
from cosim.instances.calls import FmuCalls
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.system import System
from hybrid_model.models import BouncingBall

SCHEDULER, PARTS = "hybrid_model.schedule.scheduler", "cosim.fmu_slave"
FAULTS = [
    (ITERATES, "asks for more than 10000 event iterations at t = 0 s", SCHEDULER, "iterations[order] > ITERATIONS"),
    (PASTS, "says that its next event is at -1 s: that is not ahead", SCHEDULER, "foreseen <= place.t"),
    (BEYOND, "says that it is at 2 s: that is outside the step", SCHEDULER, "reached > t and reached > t"),
    (BACKWARD, "says that it is at 0.3 s: that is outside the step", SCHEDULER, "reached < place.t"),
    (REPEATS, "gets no further than t = 0 s: each of its last 10000 steps", SCHEDULER, "place.stalls > ITERATIONS"),
    (STALLS, "returns from a step at 0 s and gets no further", PARTS, "not reached > t"),
]
ENOUGH = 60_000


class Exhausted(Exception):
    """More calls than any guard lets through."""


def system_of(path, behaviour):
    slave = FmuSlave("stranger", path)
    slave.set("behaviour", behaviour)
    return System([slave], {})


@pytest.mark.parametrize(("behaviour", "sentence", "place", "guard"), FAULTS)
def test_a_fault_is_named_and_without_its_guard_it_is_not(behaviour, sentence, place, guard, stranger, monkeypatch):
    path, calls = stranger(), 0
    with pytest.raises(CosimError, match=f"stranger.*{re.escape(sentence)}"):
        run_event_exact(system_of(path, behaviour), 1.5, output_interval=0.5)

    def counted(self, function):
        call = bound(self, function)

        def count(*arguments):
            nonlocal calls
            calls += 1
            if calls > ENOUGH:
                raise Exhausted
            return call(*arguments)

        return count

    bound = FmuCalls.bound
    monkeypatch.setattr(FmuCalls, "bound", counted)
    module = without(guard, sys.modules[place], monkeypatch)
    if place == SCHEDULER:
        monkeypatch.setattr(cosim.masters.queues, "Scheduler", module.Scheduler)
    else:
        monkeypatch.setattr(FmuSlave, "_carry_on", module.FmuSlave._carry_on)
    try:
        run_event_exact(system_of(path, behaviour), 1.5, output_interval=0.5)
    except (Exhausted, CosimError) as error:
        assert sentence not in str(error)  # noqa: PT017 - any other end shows that the guard is gone


def without(guard, module, monkeypatch, instead=None):
    """Make a module anew whose condition never holds, or which has something else in its place."""
    source = inspect.getsource(module)
    assert source.count(guard) == 1
    made = types.ModuleType(f"{module.__name__}_without")
    monkeypatch.setitem(sys.modules, made.__name__, made)
    exec(compile(source.replace(guard, instead or f"False and {guard}"), module.__file__, "exec"), made.__dict__)
    return made


def test_a_clock_that_ticks_in_an_early_iteration_alone_is_not_lost(stranger):
    for master in (run_event_exact, run_error_controlled):
        result = master(system_of(stranger(pulse=True), THRICE), 2.5)
        assert [tick.clock for tick in result.ticks] == ["pulse", "pulse"]
        assert [tick.t for tick in result.ticks] == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("behaviour", [WELL, FAILS])
@pytest.mark.parametrize("events", [True, False])
def test_all_states_of_fmus_are_freed_whatever_happens(behaviour, events, stranger):
    """One of two sends to the other, so both are saved and brought back; one may fail in its first step."""
    path = stranger(events=events)
    slaves = [FmuSlave("a", path), FmuSlave("b", path)]
    slaves[0].set("rate", 2.0)
    slaves[1].set("behaviour", behaviour)
    held = [ctypes.c_int.in_dll(slave.load().fmu.dll, "stranger_held") for slave in slaves]
    system, masters = System(slaves, {"b.int32_in": "a.sent"}), [run_error_controlled]
    for master in [*masters, run_event_exact] if events else masters:
        if behaviour == FAILS:
            with pytest.raises(CosimError, match="b: fmi3DoStep failed: no solution at 0"):
                master(system, 1.2)
        else:
            assert len(master(system, 1.2).event_times("a")) == 2
        assert [count.value for count in held] == [0, 0]


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def ball(request, exported):
    return FmuSlave("ball", exported(BouncingBall(), "ball", request.param))


@settings(max_examples=20)
@given(steps=st.lists(st.tuples(st.floats(0.01, 0.2), st.none() | st.floats(0.01, 0.9)), min_size=1, max_size=8))
def test_excursions_that_are_taken_back_leave_no_trace(ball, steps):
    """Bit for bit: to go elsewhere and return is not to have gone."""

    def run(excursions):
        slave, t, seen = ball, 0.0, []
        slave.start(0.0, 3.0, events=False)
        slave.begin()
        for size, further in steps:
            if excursions and further is not None:
                state = slave.save()
                slave.step(t, t + further)
                slave.restore(state)
                slave.release(state)
            slave.step(t, t + size)
            t += size
            seen.append((slave.get("h"), slave.get("v")))
        slave.close()
        return seen

    assert run(True) == run(False)


class Passes(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(1.0, output=True)

    def flow_map(self, s):
        return {"x": s.u - s.x}


@settings(max_examples=20)
@given(st.permutations("abcd"), st.permutations("abcd"))
def test_jacobi_steps_do_not_depend_on_the_order_of_slaves_or_wires(slaves, wires):
    into = {"a": "b", "b": "c", "c": "d", "d": "a"}

    def final(slaves, wires):
        made = [AutomatonSlave(name, Passes(x=float(ord(name) - 96))) for name in slaves]
        return run_fixed_step(System(made, {f"{n}.u": f"{into[n]}.x" for n in wires}), 0.5, 0.1).final

    assert final(slaves, wires) == final("abcd", "abcd")


def test_indicators_of_model_exchange_are_as_far_from_zero_as_the_state(exported):
    """The ball's is its height: it goes through zero with a slope, and is no sign."""
    slave = ExchangeSlave("ball", exported(BouncingBall(), "ball"))
    slave.start(0.0, 1.0, events=True)
    slave.begin()
    while slave.update().again:
        pass
    slave.enter_step_mode()
    part, x = slave._part, slave._part.at()
    index = int(x.argmax())  # h = 1, v = 0

    def at(height):
        x[index] = height
        return part.margins(0.0, x)

    row = max(range(part.indicators), key=lambda k: abs(at(0.1)[k] - at(-0.1)[k]))
    values = [at(height)[row] for height in (-1e-2, -1e-4, 0.0, 1e-4, 1e-2)]
    slave.close()
    assert values[2] == 0.0
    assert values[4] / values[3] == pytest.approx(100.0)
    assert values[0] == -values[4]

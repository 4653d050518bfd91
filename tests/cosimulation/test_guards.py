"""What the tests of faulty FMUs see: each guard taken out, the same runs come to something else."""

import ctypes

import numpy as np
import pytest
from strangers import THRICE
from test_faulty_strangers import Passes, system_of, without

import cosim.masters.error_controlled
import cosim.masters.event_exact
import cosim.masters.event_iteration
import cosim.masters.queues
import hybrid_model.schedule.scheduler
from cosim.automaton_slave import AutomatonSlave
from cosim.exchange_slave import ExchangeSlave
from cosim.fmu_slave import FmuSlave
from cosim.instances.continuous_part import ContinuousPart
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.system import System
from fmu.importer.instance import FmuInstance
from hybrid_model.models import BouncingBall


def test_clocks_of_the_last_iteration_alone_lose_ticks(stranger, monkeypatch):
    """The clock ticks in the second of three iterations."""
    path, ticks = stranger(pulse=True), []
    for guarded in (True, False):
        if not guarded:
            module = without("if ticks:", hybrid_model.schedule.scheduler, monkeypatch, "if not again and ticks:")
            monkeypatch.setattr(cosim.masters.queues, "Scheduler", module.Scheduler)
            told = "for clock in update.ticks"
            last = f"{told} if not update.again"
            module = without(told, cosim.masters.event_iteration, monkeypatch, last)
            monkeypatch.setattr(cosim.masters.error_controlled, "iterate_events", module.iterate_events)
        ticks.append([len(run(system_of(path, THRICE), 2.5).ticks) for run in (run_event_exact, run_error_controlled)])
    assert ticks == [[2, 2], [0, 0]]


def test_indicators_that_are_signs_are_slow_to_locate(exported, monkeypatch):
    """The ball's impact is located on its height in a few steps, on the sign of that by halving alone."""
    located = []
    margins = ContinuousPart.margins
    for measure in (lambda z: z, np.sign):
        calls = [0]

        def counted(part, t, x, measure=measure, calls=calls):
            calls[0] += 1
            return measure(margins(part, t, x))

        monkeypatch.setattr(ContinuousPart, "margins", counted)
        result = run_event_exact(System([ExchangeSlave("ball", exported(BouncingBall()))], {}), 0.6)
        located.append((calls[0], result.event_times("ball")))
    (few, times), (many, others) = located
    assert times == pytest.approx([np.sqrt(2.0 / 9.81)], abs=1e-12)
    assert others == pytest.approx(times, abs=1e-12)
    assert many > 10 * few


@pytest.mark.parametrize("taken", ["restore", "release"])
def test_states_that_are_not_returned_to_or_not_freed_are_seen(taken, stranger, monkeypatch):
    path = stranger()
    found = []
    for guarded in (True, False):
        if not guarded:
            monkeypatch.setattr(FmuInstance, taken, lambda instance, state: None)
        slaves = [FmuSlave("a", path), FmuSlave("b", path)]
        slaves[0].set("rate", 2.0)
        slaves[1].set("rate", 3.0)
        held = ctypes.c_int.in_dll(slaves[0].load().fmu.dll, "stranger_held")
        try:
            result = run_event_exact(System(slaves, {"b.int32_in": "a.sent"}), 1.2)
            times = [*result.event_times("a"), *result.event_times("b")]
        except RuntimeError as error:
            times = [str(error)]
        found.append((times, held.value))
    assert found[0][1] == 0
    assert found[1][taken == "release"] != found[0][taken == "release"]


def test_an_order_that_hands_on_within_a_step_is_seen_by_permutations():
    finals = []
    for names in ("abcd", "dcba"):
        slaves = [AutomatonSlave(name, Passes(x=float(ord(name) - 96))) for name in names]
        wires = {"a.u": "b.x", "b.u": "c.x", "c.u": "d.x", "d.u": "a.x"}
        finals.append(run_fixed_step(System(slaves, wires), 0.5, 0.1, order="gauss-seidel").final)
    assert finals[0] != finals[1]

"""Closed loops that are used again: the run is bit by bit that of a closed loop made for the scenario."""

from dataclasses import replace

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus import ConstantWeight, FunctionWeight, closed_loop, load_scenario, read_scenario
from hybrid_model.consensus.laws.loop_reuse import LoopReuse
from hybrid_model.consensus.scenario.files import scenario_entries
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.sweeps.keys import with_values

END = 6.0


def run(scenario, reuse):
    loop, starts = reuse.loop(scenario)
    return loop, hm.simulate(loop, END, starts=starts), hm.simulate(closed_loop(scenario), END)


def same(arc, other):
    names = [variable.name for variable in arc.automaton.variables]
    return all(np.array_equal(arc[name], other[name]) for name in names) and np.array_equal(arc.t, other.t)


def test_scenarios_that_differ_in_numbers_share_a_closed_loop():
    entries, folder = scenario_entries("paper-a")
    reuse = LoopReuse()
    loops = []
    for values in (
        {},
        {"trigger.threshold": 0.2, "trigger.decay": 0.01},
        {"network.initial": [1.0, -1.0, 0.25, 3.0], "network.gain": 2.0},
        {"weights.duty_percent[2]": 60.0, "weights.phase": 0.4, "switching.dwell": 1.5},
        {"switching.active": [[1, 4], [2, 3]]},
    ):
        loop, arc, other = run(read_scenario(with_values(entries, values), folder), reuse)
        assert same(arc, other)
        loops.append(loop)
    assert all(loop is loops[0] for loop in loops)


def test_another_structure_has_another_closed_loop():
    scenario, reuse = load_scenario("paper-a"), LoopReuse()
    first, _ = reuse.loop(scenario)
    for other in (
        replace(scenario, trigger=Trigger(TriggerKind.STATIC, 0.5)),
        replace(scenario, network=replace(scenario.network, edges=((1, 2), (2, 3), (3, 4), (1, 3)))),
    ):
        loop, starts = reuse.loop(other)
        assert loop is not first
        assert starts == {}
    assert reuse.loop(scenario)[0] is first


def test_functions_of_time_are_told_apart():
    scenario = load_scenario("paper-a")
    slow, fast = (
        replace(scenario.weights, waveforms=tuple(FunctionWeight(lambda t, k=k: k + 0 * t) for _ in range(4)))
        for k in (1.0, 2.0)
    )
    constant = replace(scenario.weights, waveforms=(ConstantWeight(2.0),) * 4)
    reuse = LoopReuse()
    for weights in (slow, fast, constant):
        _, arc, other = run(replace(scenario, weights=weights), reuse)
        assert arc["agent1.x"][-1] == pytest.approx(other["agent1.x"][-1], abs=0)

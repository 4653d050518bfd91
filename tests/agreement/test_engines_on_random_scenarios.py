"""A thousand random scenarios, each as one automaton, on both engines: the same jumps, times and states.

Every trigger comes in turn. The engines have solvers of their own at a relative tolerance of 1e-13; what they share is
how events are located, not where.
"""

import numpy as np
import pytest
from random_scenarios import TRIGGERS, random_scenario

import hybrid_model as hm
from hybrid_model import consensus
from hybrid_model.declare.variables import Kind

TIME = 1e-9
STATE = 1e-10
KINDS = sorted(TRIGGERS)
MANY = 1000
T_END = 1.5
"""In s: some ten jumps of agents and weights, and the Python engine takes most of a second for them."""


def assert_alike(automaton, t_end):
    native, plain = (hm.simulate(automaton, t_end, engine=engine) for engine in ("native", "python"))
    assert native.stop is plain.stop
    assert [jump.name for jump in native.jumps] == [jump.name for jump in plain.jumps]
    times = np.array([jump.t for jump in plain.jumps])
    np.testing.assert_allclose([jump.t for jump in native.jumps], times, rtol=0.0, atol=TIME)
    grid = np.linspace(0.0, min(native.t[-1], plain.t[-1]), 41)
    apart = grid if not len(times) else grid[np.abs(grid[:, None] - times).min(axis=1) > 2 * TIME]
    for variable in automaton.of_kind(Kind.STATE, Kind.DISCRETE):
        name = variable.name
        np.testing.assert_allclose(native.at(name, apart), plain.at(name, apart), rtol=0.0, atol=STATE, err_msg=name)
    return len(times)


def check(seeds):
    jumps = 0
    for seed in seeds:
        scenario = random_scenario(seed, KINDS[seed % len(KINDS)], stop_time=T_END)
        jumps += assert_alike(consensus.closed_loop(scenario), T_END)
    return jumps


def test_a_few_run_alike():
    assert check(range(2)) > 5


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, MANY, 50))
def test_a_thousand_run_alike(first):
    assert check(range(first, first + 50)) > 250

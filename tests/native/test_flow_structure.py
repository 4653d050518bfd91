"""In how many quadratures a flow is found, from what its rates depend on."""

import numpy as np
import pytest
from scipy import sparse

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.models import BouncingBall, ParticleInBox, Thermostat, TwoTank
from hybrid_model.native.flow_structure import MOST_LEVELS, levels_of_quadratures
from hybrid_model.native.networks.network import network_trace
from hybrid_model.native.trace import trace


def levels(automaton):
    return levels_of_quadratures(trace(automaton).pattern("flow", "x"))


def flowing(flow_map, states):
    members = {name: hm.State(1.0) for name in states}
    return type("Block", (hm.HybridAutomaton,), {**members, "flow_map": lambda self, s: flow_map(s)})()


@pytest.mark.parametrize(
    ("automaton", "expected"),
    [(TwoTank(), 1), (BouncingBall(), 2), (ParticleInBox(), 2), (Thermostat(), 0)],
    ids=["constant rates", "ball", "particle", "rates that depend on their own state"],
)
def test_models_of_the_library(automaton, expected):
    assert levels(automaton) == expected


def test_agents_of_the_paper_alone_and_in_a_network():
    loop = closed_loop(load_scenario("paper-a"))
    assert levels(loop) == 1
    assert levels_of_quadratures(network_trace(loop).pattern("flow", "x")) == 1


def test_chains_count_by_their_longest_way_whatever_the_order():
    chain = {"d": "c", "a": None, "c": "b", "b": "a"}

    def flow(s):
        return {name: 1.0 if of is None else getattr(s, of) for name, of in chain.items()}

    assert levels(flowing(flow, chain)) == 4


def test_circles_are_no_quadratures():
    assert levels(flowing(lambda s: {"a": s.b, "b": s.a}, "ab")) == 0
    assert levels(flowing(lambda s: {"a": 1.0, "b": s.a + s.c, "c": s.b}, "abc")) == 0


@pytest.mark.parametrize(
    "rate",
    [
        lambda s: np.where(s.b > 1.0, 1.0, 0.0),
        lambda s: np.sign(s.b),
        lambda s: np.floor(s.b),
        lambda s: 1.0 * (s.b >= 1.0),
    ],
    ids=["where", "sign", "floor", "comparison"],
)
def test_what_has_no_slope_depends_all_the_same(rate):
    """A derivative that is zero almost everywhere does not hide that the rate changes with the state."""
    assert levels(flowing(lambda s: {"a": rate(s), "b": 1.0}, "ab")) == 2
    assert levels(flowing(lambda s: {"a": rate(s), "b": s.a}, "ab")) == 0


def test_long_chains_and_flows_without_states_count_as_none():
    chain = sparse.csr_array(np.eye(MOST_LEVELS, k=-1, dtype=bool))
    assert levels_of_quadratures(chain) == MOST_LEVELS
    assert levels_of_quadratures(sparse.csr_array(np.eye(MOST_LEVELS + 1, k=-1, dtype=bool))) == 0
    assert levels_of_quadratures(sparse.csr_array((0, 0), dtype=bool)) == 0


@pytest.mark.parametrize("seed", range(20))
def test_levels_are_the_power_that_vanishes(seed):
    """Of a strictly triangular pattern in any order: the least power of it that is zero."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    lower = np.tril(rng.random((n, n)) < 0.4, k=-1)
    order = rng.permutation(n)
    pattern = lower[np.ix_(order, order)]
    power, expected = np.eye(n), 0
    while power.any():
        power, expected = power @ pattern, expected + 1
    assert levels_of_quadratures(sparse.csr_array(pattern)) == expected

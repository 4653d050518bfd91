"""Networks that scenario files name by a family of graphs, and start values by a formula or a draw."""

import numpy as np
import pytest

from hybrid_model.consensus import ScenarioError, ring_graph, small_world_graph
from hybrid_model.consensus.scenario.files import read_scenario


def network_of(**entries):
    return read_scenario(
        {
            "name": "drawn",
            "stop_time": 1.0,
            "network": {"agents": 6, **entries},
            "weights": {"kind": "constant", "value": 1.0},
            "trigger": {"kind": "static", "threshold": 0.1},
        }
    ).network


def test_graphs_by_name_are_those_of_the_generators():
    ring = network_of(graph="ring", initial="i / n")
    assert ring.edges == ring_graph(6).edges
    assert ring.initial == tuple(k / 6.0 for k in range(1, 7))
    world = network_of(agents=20, graph="small-world", degree=4, seed=3, rewiring=0.2, initial="0")
    assert world.edges == small_world_graph(20, 4, 0.2, 3).edges


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("cos(2*pi*i/n)", lambda i: np.cos(2 * np.pi * i / 6)),
        ("-(i % 2) + 2**-i", lambda i: -(i % 2) + 2.0**-i),
        ("abs(sign(i - 3)) * sqrt(i)", lambda i: np.abs(np.sign(i - 3)) * np.sqrt(i)),
        ("1.5", lambda i: np.full(6, 1.5)),
    ],
)
def test_formulas_of_the_agents_number(formula, value):
    assert network_of(graph="ring", initial=formula).initial == pytest.approx(value(np.arange(1.0, 7.0)), rel=1e-15)


def test_drawn_start_values_are_those_of_their_seed():
    drawn = network_of(graph="ring", initial={"draw": "uniform", "low": -1.0, "high": 2.0, "seed": 5}).initial
    assert drawn == tuple(np.random.default_rng(5).uniform(-1.0, 2.0, 6))
    normal = network_of(graph="ring", initial={"draw": "normal", "mean": 3.0, "deviation": 0.5}).initial
    assert normal == tuple(np.random.default_rng(0).normal(3.0, 0.5, 6))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"graph": "torus", "initial": "1"}, r"graph is 'torus'; it must be one of 'path', 'ring'"),
        ({"graph": "ring", "edges": [[1, 2]], "initial": "1"}, "both edges and a graph"),
        ({"edges": [[1, 2]], "degree": 2, "initial": "1"}, "degree belongs to a graph that is drawn"),
        ({"graph": "regular", "agents": 5, "degree": 3, "initial": "1"}, r"\[network\] graph: there is no graph of 5"),
        ({"graph": "ring", "initial": "1/(i - 3)"}, "its value for i = 3 is not finite"),
        ({"graph": "ring", "initial": "__import__('os')"}, "is not understood: a formula has numbers"),
        ({"graph": "ring", "initial": "i.real"}, "is not understood"),
        ({"graph": "ring", "initial": "2 +"}, "it is no formula"),
        ({"graph": "ring", "initial": "9**9**9**9"}, "is not finite"),
        ({"graph": "ring", "initial": {"draw": "poisson"}}, "draw is 'poisson'"),
        (
            {"graph": "ring", "initial": {"draw": "uniform", "low": 1.0, "high": 0.0}},
            "high is 0; it must be at least",
        ),
        ({"graph": "ring", "initial": {"draw": "uniform", "low": 1.0}}, "has no 'high'"),
        ({"graph": "ring"}, "has no 'initial'"),
    ],
)
def test_what_does_not_fit_is_told(entries, message):
    with pytest.raises(ScenarioError, match=message):
        network_of(**entries)

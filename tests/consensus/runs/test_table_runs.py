"""Closed loops over tabulated weights and listed switching against exact runs by quadratic equations."""

import numpy as np
import pytest
from catalogue_weights import SWITCHING, WEIGHTS, ring
from drawing import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.table_runs import table_run

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.definition import replace_trigger
from hybrid_model.consensus.scenario.files import read_scenario

# The limits for times of events and for states.
TIME_TOLERANCE = 1e-7
STATE_TOLERANCE = 1e-8


def compare(scenario, automaton):
    report = run_report(scenario, hm.simulate(automaton, scenario.stop_time))
    events, x_end = table_run(scenario)
    assert report.events_per_agent == [len(times) for times in events]
    for times, expected in zip(report.event_times, events, strict=True):
        np.testing.assert_allclose(times, expected, rtol=0, atol=TIME_TOLERANCE)
    np.testing.assert_allclose(report.x_end, x_end, rtol=0, atol=STATE_TOLERANCE)
    assert report.mean_drift < 1e-12
    return sum(report.events_per_agent)


@pytest.mark.parametrize("kind", ["square", "piecewise", "sampled"])
def test_weights(kind):
    scenario = replace_trigger(ring(weights=WEIGHTS[kind]), "static")
    assert compare(scenario, closed_loop(scenario)) > 3


@pytest.mark.parametrize("kind", list(SWITCHING))
def test_switching(kind):
    scenario = replace_trigger(ring(weights=WEIGHTS["piecewise"], switching=SWITCHING[kind]), "static")
    assert compare(scenario, closed_loop(scenario)) > 3


@st.composite
def scenarios(draw):
    """Random graphs, tables and sequences; thresholds that do not divide the initial differences avoid grazing."""
    agents = draw(st.integers(2, 4))
    pairs = [[i, j] for i in range(1, agents + 1) for j in range(i + 1, agents + 1)]
    edges = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=5, unique_by=tuple))
    number = st.integers(0, 40).map(lambda k: k / 16)
    values = draw(st.lists(number, min_size=3, max_size=3))
    starts = [0.0, draw(st.sampled_from([0.4, 0.7])), draw(st.sampled_from([1.1, 1.9]))]
    weights = draw(
        st.sampled_from(
            [
                {"kind": "piecewise", "starts": starts, "values": values, "cycle": 2.3},
                {"kind": "sampled", "times": starts, "values": values, "repeat": True},
                {"kind": "square", "high": 1.1, "low": values[0], "gate_rate": 2.0, "duty_percent": 35.0, "phase": 0.3},
            ]
        )
    )
    graphs = draw(st.lists(st.lists(st.integers(1, len(edges)), unique=True), min_size=2, max_size=4))
    dwells = draw(st.lists(st.integers(3, 20).map(lambda k: k / 9), min_size=len(graphs), max_size=len(graphs)))
    return read_scenario(
        {
            "name": "random",
            "stop_time": 6.3,
            "network": {
                "agents": agents,
                "edges": edges,
                "initial": draw(st.lists(st.integers(-50, 50).map(lambda k: k / 13), min_size=agents, max_size=agents)),
                "gain": 0.7,
            },
            "weights": weights,
            "switching": {"kind": "sequence", "dwell": dwells, "active": graphs, "repeat": True},
            "trigger": {"kind": "static", "threshold": 0.2718281828},
        }
    )


@examples(3, 15)
@given(scenario=scenarios())
def test_random_tables_run_like_the_exact_solution(scenario):
    compare(scenario, closed_loop(scenario))


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(scenario=scenarios())
def test_many_random_tables_run_like_the_exact_solution(scenario):
    compare(scenario, closed_loop(scenario))

"""Runs of the closed loop against the exact event-driven solution, in Python and event by event over the network."""

import numpy as np
import pytest
from drawing import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.exact_consensus import exact_run

import hybrid_model as hm
from cosim.consensus import fmu_system, in_process_system, network_report
from cosim.masters import run_event_exact
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario

# The limits. Events amplify errors where thresholds have decayed, so random scenarios stay short.
TIME_TOLERANCE = 1e-8
STATE_TOLERANCE = 1e-9

PUBLISHED = {
    "paper-a-static": ([2, 6, 13, 4], 0.106236, [0.817749136204, 0.809163584777, 1.078555901778, 0.994531377241]),
    "paper-a": ([4, 10, 13, 8], 0.103836, [0.927800406772, 0.932060314225, 0.915459109314, 0.924680169689]),
}
"""Reference values of scenario A: events per agent, shortest gap in s, x(50)."""


def compare(scenario, report, exact):
    assert report.events_per_agent == exact.counts
    for times, expected in zip(report.event_times, exact.event_times, strict=True):
        assert np.all(np.abs(times - expected) <= [time_tolerance(scenario, t) for t in expected])
    np.testing.assert_allclose(report.x_end, exact.x_end, rtol=0, atol=STATE_TOLERANCE)


@pytest.mark.parametrize("preset", PUBLISHED)
def test_paper_example_has_the_published_events_and_end(preset):
    scenario = load_scenario(preset)
    report = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    events, gap, x_end = PUBLISHED[preset]
    assert report.events_per_agent == events
    assert report.min_gap == pytest.approx(gap, abs=5e-7)
    np.testing.assert_allclose(report.x_end, x_end, rtol=0, atol=STATE_TOLERANCE)
    assert report.mean_drift < 1e-12
    compare(scenario, report, exact_run(scenario))


def time_tolerance(scenario, t):
    """The limit, and more where all weights are nearly zero: a state error of 1e-13 moves an event by 1e-13/speed."""
    weight = float(np.max(scenario.edge_weights.value(t)))
    return TIME_TOLERANCE + (1e-13 / max(weight, 1e-8) if weight > 0.0 else 0.0)


def two_agents(**weights):
    return read_scenario(
        {
            "name": "two",
            "stop_time": 30.0,
            "network": {"agents": 2, "edges": [[1, 2]], "initial": [0.0, 0.05]},
            "weights": weights,
            "trigger": {"kind": "static", "threshold": 0.5},
        }
    )


@pytest.mark.parametrize("run", ["one automaton", "network", "FMUs"])
def test_symmetric_agents_broadcast_together(run, exported):
    """Both errors reach the threshold at 10 s up to rounding; the gap is then 0.5/0.95 s (audit, section 6).

    If rounding let one of them fire first, the other's error would turn back and the next event come at 11.1 s.
    """
    scenario = two_agents(kind="constant", value=1.0)
    if run == "network":
        report = network_report(scenario, run_event_exact(in_process_system(scenario), scenario.stop_time))
    elif run == "FMUs":
        fmus = {name: exported(agent, f"two_{name}") for name, agent in scenario_agents(scenario).items()}
        report = network_report(scenario, run_event_exact(fmu_system(scenario, fmus), scenario.stop_time))
    else:
        report = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    expected = np.array([10.0, 10.0 + 0.5 / 0.95, 20.0 + 0.5 / 0.95, 20.0 + 1.0 / 0.95])
    for times in report.event_times:
        np.testing.assert_allclose(times[:4], expected, rtol=0, atol=TIME_TOLERANCE)


@st.composite
def scenarios(draw):
    agents = draw(st.integers(2, 4))
    pairs = [[i, j] for i in range(1, agents + 1) for j in range(i + 1, agents + 1)]
    edges = draw(st.lists(st.sampled_from(pairs), min_size=1, unique_by=tuple))
    entries = {
        "name": "drawn",
        "stop_time": 6.0,
        "network": {
            "agents": agents,
            "edges": edges,
            # Halves make symmetric agents likely, whose errors meet their thresholds together.
            "initial": [k / 2 for k in draw(st.lists(st.integers(-4, 4), min_size=agents, max_size=agents))],
            "gain": draw(st.sampled_from([0.5, 1.0, 2.0])),
        },
        "weights": draw(weights(len(edges))),
        "trigger": draw(
            st.sampled_from(
                [
                    # No multiples of what a half wave of |sin| moves an error by: an error that came to its threshold
                    # just as the weight is zero would have no event time that two computations could agree on.
                    {"kind": "static", "threshold": 0.2573},
                    {"kind": "static", "threshold": 0.4831},
                    {"kind": "dynamic", "threshold": 0.4831, "decay": 0.2},
                ]
            )
        ),
    }
    if draw(st.booleans()):
        subsets = st.lists(st.integers(1, len(edges)), unique=True)
        dwell = draw(st.sampled_from([0.7, 1.0, float(np.pi)]))
        entries["switching"] = {"dwell": dwell, "active": draw(st.lists(subsets, min_size=1, max_size=3))}
    return read_scenario(entries)


def weights(edges):
    each = st.lists(st.sampled_from([0.0, 0.5, 1.0, 2.0]), min_size=edges, max_size=edges)
    duties = st.lists(st.sampled_from([0.0, 20.0, 55.0, 100.0]), min_size=edges, max_size=edges)
    gated = st.fixed_dictionaries(
        {
            "kind": st.just("gated-sine"),
            "map": st.sampled_from(["square", "abs"]),
            "gate_rate": st.sampled_from([1.0, 4.0, 3.3]),
            "sine_rate": st.sampled_from([1.0, 5.0]),
            "duty_percent": duties,
            "phase": st.sampled_from([0.0, 1.0, -2.0]),
        }
    )
    return st.one_of(st.fixed_dictionaries({"kind": st.just("constant"), "value": each}), gated)


@examples(5, 25)
@given(scenario=scenarios())
def test_any_scenario_runs_like_the_exact_solution(scenario):
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    compare(scenario, run_report(scenario, arc), exact_run(scenario))


@examples(3, 15)
@given(scenario=scenarios())
def test_any_scenario_runs_event_by_event_like_the_exact_solution(scenario):
    result = run_event_exact(in_process_system(scenario), scenario.stop_time)
    compare(scenario, network_report(scenario, result), exact_run(scenario))


@pytest.mark.long
@settings(max_examples=1000, deadline=None)
@given(scenario=scenarios())
def test_many_scenarios_run_like_the_exact_solution(scenario):
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    compare(scenario, run_report(scenario, arc), exact_run(scenario))

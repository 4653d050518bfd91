"""Self-triggered broadcasting: the run is the event-triggered one, and the times are known in advance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from catalogue_triggers import RING
from drawing import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from law_runs import compare, reported, reported_by_agents, run
from oracles.exact_consensus import exact_run
from random_scenarios import random_scenario
from scipy.optimize import brentq

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import scenario_agents
from hybrid_model.consensus.laws.forecast import Forecast
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.scenario.trigger import Threshold, Trigger, TriggerKind
from hybrid_model.consensus.weights.gated_sine import SineCarrier, WeightMap
from hybrid_model.consensus.weights.sine import RippleCarrier

SEEDS = st.integers(0, 2**32 - 1)


def with_kind(scenario, kind):
    return replace(scenario, trigger=replace(scenario.trigger, kind=kind))


def check(scenario, report, exact):
    # Where all weights are nearly zero, a state error of 1e-13 moves an event by its quotient with the weight.
    weights = [np.array([scenario.edge_weights.value(t).max() for t in times]) for times in exact.event_times]
    compare(report, exact, [np.where(w > 0, 1e-13 / np.maximum(w, 1e-8), 0.0) for w in weights])


@examples(2, 12)
@given(seed=SEEDS)
def test_the_run_is_the_exact_event_triggered_one(seed):
    scenario = random_scenario(seed, "self-triggered")
    check(scenario, reported(scenario), exact_run(with_kind(scenario, TriggerKind.DYNAMIC)))


@examples(2, 4)
@given(seed=SEEDS)
def test_agents_that_meet_at_events_only_run_the_same(seed):
    scenario = random_scenario(seed, "self-triggered", stop_time=2.0)
    check(scenario, reported_by_agents(scenario), exact_run(scenario))


@pytest.mark.long
@settings(max_examples=1000, deadline=None)
@given(seed=SEEDS)
def test_the_run_is_the_exact_event_triggered_one_in_many_cases(seed):
    scenario = random_scenario(seed, "self-triggered")
    check(scenario, reported(scenario), exact_run(with_kind(scenario, TriggerKind.DYNAMIC)))


@pytest.mark.parametrize("trigger", [Trigger(TriggerKind.STATIC, 0.5), Trigger(TriggerKind.DYNAMIC, 0.5, 0.06)])
def test_the_paper_s_example_is_broadcast_for_broadcast_the_same(trigger):
    scenario = replace(load_scenario("paper-a"), trigger=trigger)
    ahead = replace(scenario, trigger=replace(trigger, kind=TriggerKind.SELF_TRIGGERED))
    check(scenario, reported(ahead), reported_as_exact(scenario))


def reported_as_exact(scenario):
    """The event-triggered run in the place of the exact one."""
    report = reported(scenario)
    return SimpleNamespace(counts=report.events_per_agent, event_times=report.event_times, x_end=report.x_end)


def test_over_sine_weights_too():
    entries = {
        **RING,
        "weights": {
            "kind": "sine",
            "mean": [1.0, 0.6, 0.3],
            "depth": [1.0, 0.5, 0.9],
            "rate": 3.0,
            "phase": [0.0, 1.0, 2.0],
        },
        "trigger": {"kind": "dynamic", "threshold": 0.1, "decay": 0.1},
    }
    scenario = read_scenario(entries)
    ahead = with_kind(scenario, TriggerKind.SELF_TRIGGERED)
    report = reported(ahead)
    assert sum(report.events_per_agent) > 5
    check(scenario, report, reported_as_exact(scenario))


def test_a_broadcast_comes_at_the_time_that_was_computed_and_with_the_error_that_was_predicted():
    scenario = replace(load_scenario("paper-a"), trigger=Trigger(TriggerKind.SELF_TRIGGERED, 0.5, 0.06))
    arc = run(scenario)
    checked = 0
    for jump in arc.jumps:
        agent, _, name = jump.name.partition(".trigger.")
        if name == "broadcast":
            s = arc.before(jump)
            assert s[f"{agent}.trigger.due"] == pytest.approx(jump.t, abs=1e-12)
            error = abs(s[f"{agent}.broadcast"] - s[f"{agent}.x"])
            # The solver's relative tolerance of 1e-10 over some hundred steps.
            assert error == pytest.approx(float(scenario.trigger.level(jump.t)), abs=1e-8)
            checked += 1
    assert checked == 35


def test_an_agent_without_neighbours_and_agents_at_consensus_stay_silent():
    entries = {
        "name": "lonely",
        "stop_time": 400.0,
        "network": {"agents": 3, "edges": [[1, 2]], "initial": [1.0, 1.0, 5.0]},
        "weights": {"kind": "constant", "value": 1.0},
        # By 400 s the threshold has fallen to 1e-18, below the rounding of the states.
        "trigger": {"kind": "self-triggered", "threshold": 0.5, "decay": 0.1},
    }
    scenario = read_scenario(entries)
    arc = run(scenario)
    assert arc.stop is hm.Stop.HORIZON
    assert run_report(scenario, arc).events_per_agent == [0, 0, 0]


def test_weights_whose_future_is_not_known_in_closed_form_are_refused():
    entries = {
        "name": "tables",
        "stop_time": 4.0,
        "network": {"agents": 2, "edges": [[1, 2]], "initial": [0.0, 1.0]},
        "weights": {"kind": "piecewise", "starts": [0.0, 1.0], "values": [[1.0, 2.0]]},
        "trigger": {"kind": "self-triggered", "threshold": 0.1},
    }
    scenario = read_scenario(entries)
    with pytest.raises(ScenarioError, match="can compute ahead over weights PiecewiseWeight"):
        scenario_agents(scenario)


@examples(25, 60)
@given(
    seed=SEEDS,
    make=st.sampled_from(
        [
            RippleCarrier,
            lambda depth, rate, phase: SineCarrier(rate, WeightMap.SQUARE),
            lambda depth, rate, phase: SineCarrier(rate, WeightMap.ABS),
        ]
    ),
)
def test_the_forecast_finds_the_first_meeting(seed, make):
    """Against a fine table and bracketing; a search that is still open is taken up again from where it got to."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    mean, angle = rng.uniform(0.5, 2.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    carrier = make(rng.uniform(0.0, 1.0, count), rng.uniform(0.5, 8.0, count), angle)
    pull, threshold = mean * rng.uniform(-1.0, 1.0, count), Threshold(0.5, rng.uniform(0.0, 1.0))
    since, end = 1.3, 1.3 + rng.uniform(0.5, 5.0)
    error = rng.uniform(-0.9, 0.9) * threshold.at(since)
    found = Forecast(carrier, pull, error, since, threshold, 1.0)
    meeting, reached = found.first_meeting(end), since
    while meeting.open:
        assert meeting.t > reached
        reached = meeting.t
        meeting = Forecast(carrier, pull, found.error(reached), reached, threshold, 1.0).first_meeting(end)

    def margin(t):
        return abs(found.error(t)) - threshold.at(t)

    times = np.linspace(since, end, 2000)
    risen = np.flatnonzero(np.array([margin(t) for t in times]) >= 0)
    if risen.size == 0:
        assert not meeting.met
        assert meeting.t == end
    else:
        assert meeting.met
        expected = brentq(margin, times[risen[0] - 1], times[risen[0]], xtol=1e-15)
        # A root between two points of the table that the table does not show comes earlier still.
        assert meeting.t <= expected + 1e-9
        assert margin(meeting.t) == pytest.approx(0.0, abs=1e-12)

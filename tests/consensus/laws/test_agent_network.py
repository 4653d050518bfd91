"""Agents as a network of arrays: the same events as the agents composed one by one."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenarios import KNOWN_AHEAD, random_scenario
from random_scenarios import TRIGGERS as TRIGGER_TABLES

import hybrid_model as hm
from hybrid_model import consensus
from hybrid_model.consensus.laws.agent_network import agent_network
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import report_of_network, run_report
from hybrid_model.consensus.scenario.definition import Weights
from hybrid_model.consensus.scenario.files import read_scenario

WEIGHTS = {
    "constant": {"value": [0.3, 0.9, 0.6, 1.1]},
    "gated-sine": {
        "gate_rate": 4.0,
        "sine_rate": 5.0,
        "duty_percent": [30.0, 40.0, 50.0, 60.0],
        "phase": [0.0, 0.4, 0.8, 1.2],
    },
    "sine": {"mean": 0.6, "depth": [0.1, 0.2, 0.3, 0.4], "rate": 3.0},
    "piecewise": {
        "starts": [0.0, 0.4, 0.9],
        "values": [[0.3, 0.0, 1.1], [0.9, 0.2, 0.5], [0.6, 1.0, 0.1], [1.1, 0.4, 0.8]],
        "cycle": 1.3,
    },
    "sampled": {
        "times": [0.0, 0.8, 3.9],
        "values": [[0.3, 0.0, 1.1], [0.9, 0.2, 0.5], [0.6, 1.0, 0.1], [1.1, 0.4, 0.8]],
    },
}
TRIGGERS = {
    "dynamic": {"threshold": 0.1, "decay": 0.2},
    "relative": {"sigma": 0.4, "floor": 1e-3},
    "self-triggered": {"threshold": 0.1, "decay": 0.2},
}


def scenario_with(weights="constant", trigger="dynamic", **others):
    """Five agents, one of them with three neighbours, one with none."""
    return read_scenario(
        {
            "name": "five",
            "stop_time": 3.0,
            "network": {"agents": 5, "edges": [[1, 2], [4, 2], [2, 3], [3, 4]], "initial": [1.0, -0.5, 0.7, -1.0, 0.2]},
            "weights": {"kind": weights, **WEIGHTS[weights]},
            "trigger": {"kind": trigger, **TRIGGERS[trigger]},
            **others,
        }
    )


CYCLE = {"switching": {"dwell": 0.7, "active": [[1, 2], [3, 4], [2]]}}
SEQUENCE = {"switching": {"kind": "sequence", "dwell": [0.5, 1.0, 2.0], "active": [[1, 2, 3], [4], [2, 3]]}}
CHANNEL = {"channel": {"delay": 0.05, "loss": 0.3, "slots": 3, "seed": 4}}


def require_the_closed_loops_run(scenario, limit=1e-9):
    """Times within 1e-8 and states within 1e-9 are what the two must agree to."""
    run = hm.simulate_network(agent_network(scenario), scenario.stop_time, engine="native")
    found = report_of_network(scenario, run)
    wanted = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    assert found.events_per_agent == wanted.events_per_agent
    for times, others in zip(found.event_times, wanted.event_times, strict=True):
        np.testing.assert_allclose(times, others, rtol=0.0, atol=limit)
    np.testing.assert_allclose(found.x_end, wanted.x_end, rtol=0.0, atol=limit)
    return found, wanted


@pytest.mark.parametrize(
    ("weights", "trigger", "others"),
    [
        ("constant", "relative", {}),
        ("gated-sine", "dynamic", CYCLE),
        ("sine", "dynamic", SEQUENCE | CHANNEL),
        # Their forecasts are the longest maps that there are; a thousand of them run quickly, below.
        pytest.param("gated-sine", "self-triggered", CYCLE, marks=pytest.mark.long),
        pytest.param("sine", "self-triggered", {}, marks=pytest.mark.long),
        ("piecewise", "dynamic", CHANNEL),
        ("sampled", "dynamic", SEQUENCE),
    ],
)
def test_copies_of_few_agents_run_as_the_closed_loop_does(weights, trigger, others):
    scenario = scenario_with(weights, trigger, **others)
    network = agent_network(scenario)
    assert isinstance(network, hm.Network)
    assert len(network.templates) == 4
    found, wanted = require_the_closed_loops_run(scenario)
    assert sum(found.events_per_agent) > 10
    assert found.edge_norm_end == pytest.approx(wanted.edge_norm_end, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(40))
def test_random_scenarios_run_as_the_closed_loop_does(seed):
    """Graphs, weights, switching, triggers and channels as they are drawn."""
    rng = np.random.default_rng(1000 + seed)
    trigger = str(rng.choice(sorted(TRIGGER_TABLES.keys() - {"continuous"})))
    channel = {"delay": rng.uniform(0.01, 0.2), "loss": rng.uniform(0.0, 0.5), "slots": 12, "seed": seed}
    ideal = seed % 2 == 0 or trigger == "self-triggered"
    kinds = KNOWN_AHEAD if trigger == "self-triggered" else (*KNOWN_AHEAD, "square", "piecewise", "sampled")
    weights = str(rng.choice(kinds))
    scenario = random_scenario(2000 + seed, trigger, weights=weights, channel=None if ideal else channel)
    assert isinstance(agent_network(scenario), hm.Network)
    require_the_closed_loops_run(scenario)


def test_one_function_of_time_and_a_law_of_ones_own_make_copies_too():
    class Rounds(consensus.EventGenerator):
        """Broadcasts when the state has moved by a step that shrinks with each."""

        transitions = (
            hm.Jump(
                "broadcast",
                lambda self, s: abs(s.broadcast - s.x) - 0.2 / (1.0 + s.events),
                consensus.EventGenerator.send,
            ),
        )

    weight = consensus.FunctionWeight(lambda t: 0.5 + 0.4 * np.cos(2.0 * t), period=np.pi)
    scenario = replace(
        scenario_with(), weights=Weights((weight,) * 4), trigger=consensus.OwnTrigger(law=Rounds), stop_time=2.0
    )
    assert isinstance(agent_network(scenario), hm.Network)
    found, _ = require_the_closed_loops_run(scenario)
    assert sum(found.events_per_agent) > 10


def test_tables_whose_rows_begin_apart_are_composed_one_by_one():
    waves = [consensus.PiecewiseWeight((0.0, 0.5 + 0.1 * k), (1.0, 0.2)) for k in range(4)]
    scenario = replace(scenario_with(), weights=Weights(tuple(waves)), stop_time=2.0)
    assert isinstance(agent_network(scenario), hm.Composition)
    require_the_closed_loops_run(scenario)


def test_a_thousand_self_triggered_agents_broadcast_as_the_dynamic_law_has_them():
    """The alarm is set for the very times at which the dynamic trigger fires (audit, section 11.6)."""
    initial = {"draw": "uniform", "low": -1.0, "high": 1.0, "seed": 3}
    runs = []
    for trigger in ("self-triggered", "dynamic"):
        entries = {
            "name": "ring",
            "stop_time": 3.0,
            "network": {
                "agents": 1000,
                "graph": "ring",
                "initial": initial,
            },
            "weights": {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": 5.0, "duty_percent": 50.0, "phase": 0.0},
            "trigger": {"kind": trigger, "threshold": 0.1, "decay": 0.1},
        }
        scenario = read_scenario(entries)
        network = agent_network(scenario)
        assert isinstance(network, hm.Network)
        runs.append(report_of_network(scenario, hm.simulate_network(network, 3.0, engine="native")))
    assert runs[0].events_per_agent == runs[1].events_per_agent
    ours, theirs = (np.concatenate(run.event_times) for run in runs)
    # Where a weight is near zero a threshold is met with a slope of the order of 1e-3 a second.
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-8)


def test_agents_that_see_each_other_all_the_time_are_refused():
    scenario = consensus.replace_trigger(scenario_with(), "static")
    continuous = {"kind": "continuous"}
    entries = {**_entries(), "trigger": continuous}
    assert isinstance(agent_network(scenario), hm.Network)
    with pytest.raises(consensus.ScenarioError, match="see each other's states all the time"):
        agent_network(read_scenario(entries))


def _entries():
    return {
        "name": "two",
        "stop_time": 1.0,
        "network": {"agents": 2, "edges": [[1, 2]], "initial": [1.0, -1.0]},
        "weights": {"kind": "constant", "value": 1.0},
    }


@pytest.mark.parametrize("agents", [4, 8, 60])
def test_agents_that_start_at_what_rounding_leaves_of_zero_run_on(agents):
    """Between neighbours on both sides of zero their rates are rounding too, which must not be taken for their size."""
    scenario = read_scenario(
        {
            "name": "cosine",
            "stop_time": 8.0,
            "network": {"agents": agents, "graph": "ring", "initial": "cos(2*pi*i/n)"},
            "weights": {"kind": "sine", "mean": 1.0, "depth": 0.5, "rate": 2.0},
            "trigger": {"kind": "dynamic", "threshold": 0.2, "decay": 0.2},
        }
    )
    assert 0.0 < min(map(abs, scenario.network.initial)) < 1e-15
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    run = hm.simulate_network(agent_network(scenario), scenario.stop_time)
    assert run.stop is arc.stop is hm.Stop.HORIZON
    times = np.sort(np.concatenate(run_report(scenario, arc).event_times))
    assert len(times) > 20
    # Agents that are mirror images broadcast together, in an order that rounding decides.
    np.testing.assert_allclose(np.sort(run.events.t), times, rtol=0, atol=1e-8)

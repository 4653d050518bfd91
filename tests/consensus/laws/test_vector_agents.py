"""Agents in R^d: one event for the whole vector, at exact times."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue_triggers import RING
from oracles.exact_consensus import exact_run

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model.consensus.graphs.undirected import weighted_laplacian
from hybrid_model.consensus.laws.vector_agents import vector_agents, vector_loop, vector_wires
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.channel import Channel
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

STARTS = np.array([[1.0, 0.2, -0.3], [-0.4, 0.5, 0.9], [0.3, -0.7, 0.1]])


def run(scenario, initial):
    return hm.simulate(vector_loop(scenario, initial), scenario.stop_time)


def exact_events(scenario, initial):
    """Constant weights and threshold: errors are straight lines, and ``|e + r s| = c`` is a quadratic equation."""
    network, c = scenario.network, scenario.trigger.threshold
    laplacian = weighted_laplacian(network.agents, network.edges, [wave.level for wave in scenario.weights.waveforms])
    t, x = 0.0, np.array(initial, dtype=float)
    sent, events = x.copy(), [[] for _ in x]
    while True:
        rate = network.gain * laplacian @ sent
        error = sent - x
        a, b, rest = np.sum(rate**2, axis=1), np.sum(rate * error, axis=1), c**2 - np.sum(error**2, axis=1)
        steps = (-b + np.sqrt(b**2 + a * rest)) / a
        step = min(steps.min(), scenario.stop_time - t)
        x, t = x - rate * step, t + step
        if t >= scenario.stop_time:
            return events, x
        agent = int(steps.argmin())
        sent[agent] = x[agent]
        events[agent].append(t)


def test_events_are_at_the_roots_of_the_quadratic_equations():
    scenario = read_scenario(RING)
    arc, (events, x_end) = run(scenario, STARTS), exact_events(read_scenario(RING), STARTS)
    assert sum(map(len, events)) > 10
    for i, expected in enumerate(events, start=1):
        # Straight lines are integrated to rounding; margins have slopes of order c.
        np.testing.assert_allclose(arc.event_times(f"agent{i}.trigger.broadcast"), expected, rtol=0, atol=1e-11)
        np.testing.assert_allclose(arc[f"agent{i}.x"][-1], x_end[i - 1], rtol=0, atol=1e-12)


def test_in_one_dimension_they_are_the_single_integrators():
    scenario = load_scenario("paper-a")
    arc, exact = run(scenario, np.reshape(scenario.network.initial, (-1, 1))), exact_run(scenario)
    for i, expected in enumerate(exact.event_times, start=1):
        np.testing.assert_allclose(arc.event_times(f"agent{i}.trigger.broadcast"), expected, rtol=0, atol=1e-8)
        np.testing.assert_allclose(arc[f"agent{i}.x"][-1, 0], exact.x_end[i - 1], rtol=0, atol=1e-9)


def test_a_rotated_start_gives_a_rotated_run():
    # The norm and the protocol do not see a rotation of R^d.
    rotation, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    scenario = read_scenario(RING)
    plain, rotated = run(scenario, STARTS), run(scenario, STARTS @ rotation.T)
    for i in range(1, 4):
        name = f"agent{i}.trigger.broadcast"
        np.testing.assert_allclose(rotated.event_times(name), plain.event_times(name), rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotated[f"agent{i}.x"][-1], rotation @ plain[f"agent{i}.x"][-1], atol=1e-9)


def test_the_mean_stays_and_the_error_stays_below_the_threshold():
    trigger = Trigger(TriggerKind.MIXED, 0.4, 0.06, offset=0.1)
    scenario = replace(load_scenario("paper-a"), trigger=trigger)
    arc = run(scenario, np.vstack([STARTS, [0.0, 1.0, -1.0]]))
    mean = np.mean([arc[f"agent{i}.x"] for i in range(1, 5)], axis=0)
    np.testing.assert_allclose(mean, np.broadcast_to(mean[0], mean.shape), atol=1e-12)
    for i in range(1, 5):
        error = np.linalg.norm(arc[f"agent{i}.broadcast"] - arc[f"agent{i}.x"], axis=1)
        assert np.all(error <= trigger.level(arc.t) + 1e-8)


def test_agents_that_meet_at_events_only_run_the_same():
    scenario = read_scenario(RING)
    slaves = [AutomatonSlave(name, agent) for name, agent in vector_agents(scenario, STARTS).items()]
    result = run_event_exact(System(slaves, vector_wires(scenario, dimension=3)), scenario.stop_time)
    events, x_end = exact_events(scenario, STARTS)
    for i, expected in enumerate(events, start=1):
        np.testing.assert_allclose(result.tick_times(f"agent{i}", "broadcast_clock"), expected, rtol=0, atol=1e-11)
        final = [result.final[f"agent{i}.x[{k}]"] for k in (1, 2, 3)]
        np.testing.assert_allclose(final, x_end[i - 1], rtol=0, atol=1e-12)


def test_an_agent_without_neighbours_stays():
    entries = {**RING, "network": {**RING["network"], "edges": [[1, 2]]}, "weights": {"kind": "constant", "value": 1.0}}
    arc = run(read_scenario(entries), STARTS)
    np.testing.assert_array_equal(arc["agent3.x"][-1], STARTS[2])


@pytest.mark.parametrize(
    ("changes", "initial", "message"),
    [
        ({}, [1.0, 2.0, 3.0], r"shape \(3,\) for 3 agents; give an array of one row"),
        ({}, STARTS[:2], r"shape \(2, 3\) for 3 agents"),
        ({}, [[1.0, 2.0], [3.0], [4.0, 5.0]], "the initial states have rows of different lengths; give one row of num"),
        ({}, [[1.0, 2.0], 3.0, [4.0, 5.0]], "the initial states have rows of different lengths"),
        (
            {},
            [[1.0, 2.0], [3.0, np.nan], [4.0, 5.0]],
            r"initial states of agent 2 hold \[3.0, nan\]; they must be finite",
        ),
        ({}, [[np.inf], [0], [1]], r"initial states of agent 1 hold \[inf\]"),
        ({}, [["a"], ["b"], ["c"]], "the initial states are not all real numbers"),
        ({}, [[1j], [0], [1]], "the initial states are not all real numbers"),
        ({}, [[True], [False], [True]], "the initial states are not all real numbers"),
        ({}, [[10**400], [0], [1]], "the initial states are not all real numbers"),
        ({}, None, "the initial states are not all real numbers"),
        ({}, [[], [], []], r"shape \(3, 0\) for 3 agents; .* at least one number"),
        ({}, [], r"shape \(0,\) for 3 agents"),
        (
            {"trigger": Trigger(TriggerKind.PERIODIC, period=1.0)},
            STARTS,
            "kind is 'periodic'; for agents in R.d it must",
        ),
        ({"channel": Channel(delay=0.1)}, STARTS, r"\[channel\] delays or loses broadcasts"),
    ],
)
def test_refusals(changes, initial, message):
    with pytest.raises(ScenarioError, match=message):
        vector_agents(replace(read_scenario(RING), **changes), initial)

"""Double integrators with model-based broadcasts: exact event times, invariants, consensus."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue_triggers import RING, VELOCITIES
from numpy.polynomial import Polynomial

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model.consensus.graphs.undirected import weighted_laplacian
from hybrid_model.consensus.laws.double_integrators import (
    double_integrator_agents,
    double_integrator_loop,
    double_integrator_wires,
)
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.channel import Channel
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

DAMPING = 1.5


def run(scenario, velocities, damping=DAMPING):
    return hm.simulate(double_integrator_loop(scenario, velocities, damping), scenario.stop_time)


def exact_events(scenario, velocities, damping):
    """Constant weights and threshold: between events positions are cubic, and ``|error|^2 = c^2`` has degree six."""
    network, c = scenario.network, scenario.trigger.threshold
    n = network.agents
    laplacian = weighted_laplacian(network.agents, network.edges, [wave.level for wave in scenario.weights.waveforms])
    t, x, v = 0.0, np.array(network.initial, dtype=float), np.array(velocities, dtype=float)
    # Extrapolations, as values at the present time and slopes.
    model_x, model_v = x.copy(), v.copy()
    events = [[] for _ in x]
    while True:
        constant = -network.gain * laplacian @ (model_x + damping * model_v)
        linear = -network.gain * laplacian @ model_v
        speed = [Polynomial([v[i], constant[i], linear[i] / 2]) for i in range(n)]
        place = [Polynomial([x[i], v[i], constant[i] / 2, linear[i] / 6]) for i in range(n)]
        roots = []
        for i in range(n):
            errors = Polynomial([model_x[i], model_v[i]]) - place[i], damping * (model_v[i] - speed[i])
            found = (errors[0] ** 2 + errors[1] ** 2 - c**2).roots()
            real = found.real[(np.abs(found.imag) < 1e-9) & (found.real > 1e-12)]
            roots.append(real.min() if real.size else np.inf)
        step = min(min(roots), scenario.stop_time - t)
        x, v = (np.array([p(step) for p in polynomials]) for polynomials in (place, speed))
        model_x, t = model_x + step * model_v, t + step
        if t >= scenario.stop_time:
            return events, x, v
        agent = int(np.argmin(roots))
        model_x[agent], model_v[agent] = x[agent], v[agent]
        events[agent].append(t)


def test_events_are_at_the_roots_of_the_polynomials():
    scenario = replace(read_scenario(RING), stop_time=8.0)
    arc = run(scenario, VELOCITIES)
    events, x, v = exact_events(scenario, VELOCITIES, DAMPING)
    assert sum(map(len, events)) > 15
    for i, expected in enumerate(events, start=1):
        # Roots of degree six are good to about 1e-12 here; margins have slopes of order c^2 = 0.01.
        np.testing.assert_allclose(arc.event_times(f"agent{i}.trigger.broadcast"), expected, rtol=0, atol=1e-8)
        np.testing.assert_allclose(arc[f"agent{i}.x"][-1], x[i - 1], rtol=0, atol=1e-9)
        np.testing.assert_allclose(arc[f"agent{i}.v"][-1], v[i - 1], rtol=0, atol=1e-9)


def test_agents_that_meet_at_events_only_run_the_same():
    scenario = read_scenario(RING)
    agents = double_integrator_agents(scenario, VELOCITIES, DAMPING)
    system = System([AutomatonSlave(*item) for item in agents.items()], double_integrator_wires(scenario))
    result = run_event_exact(system, scenario.stop_time)
    events, x, _ = exact_events(scenario, VELOCITIES, DAMPING)
    for i, expected in enumerate(events, start=1):
        np.testing.assert_allclose(result.tick_times(f"agent{i}", "broadcast_clock"), expected, rtol=0, atol=1e-8)
        assert result.final[f"agent{i}.x"] == pytest.approx(x[i - 1], abs=1e-9)


def test_the_mean_velocity_stays_and_the_mean_position_moves_evenly():
    scenario = replace(load_scenario("paper-a"), stop_time=30.0)
    velocities = [0.0, 0.1, -0.3, 0.4]
    arc = run(scenario, velocities)
    v = np.mean([arc[f"agent{i}.v"] for i in range(1, 5)], axis=0)
    x = np.mean([arc[f"agent{i}.x"] for i in range(1, 5)], axis=0)
    # 1^T D = 0, whatever is broadcast; the solver keeps linear invariants to rounding.
    np.testing.assert_allclose(v, 0.05, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x, 0.925 + 0.05 * arc.t, rtol=0, atol=1e-11)


def test_positions_and_velocities_agree_in_the_end_under_the_paper_s_weights():
    scenario = replace(load_scenario("paper-a"), trigger=Trigger(TriggerKind.DYNAMIC, 0.5, 0.1), stop_time=60.0)
    arc = run(scenario, [0.0, 0.1, -0.3, 0.4], damping=2.0)
    spread = {item: np.ptp([arc[f"agent{i}.{item}"] for i in range(1, 5)], axis=0) for item in ("x", "v")}
    # The threshold at 60 s is .5 exp(-6) = .0012; errors enter with a gain of order ten.
    assert spread["x"][0] > 1.5
    assert spread["x"][-1] < 0.03
    assert spread["v"][-1] < 0.03


def test_the_error_stays_below_the_threshold():
    trigger = Trigger(TriggerKind.MIXED, 0.4, 0.06, offset=0.1)
    arc = run(replace(load_scenario("paper-a"), trigger=trigger, stop_time=20.0), [*VELOCITIES, 0.0])
    for i in range(1, 5):
        own = {item: arc[f"agent{i}.broadcast_{item}"] for item in ("position", "velocity", "time")}
        position = own["position"] + (arc.t - own["time"]) * own["velocity"] - arc[f"agent{i}.x"]
        velocity = DAMPING * (own["velocity"] - arc[f"agent{i}.v"])
        assert np.all(np.hypot(position, velocity) <= trigger.level(arc.t) + 1e-8)


@pytest.mark.parametrize(
    ("changes", "velocities", "damping", "message"),
    [
        ({}, [1.0], 1.0, r"the velocities have the shape \(1,\) for 3 agents"),
        ({}, [1.0, np.nan, 0.0], 1.0, "the velocities of agent 2 hold nan; they must be finite"),
        (
            {},
            [1.0, [2.0, 3.0], 0.0],
            1.0,
            "the velocities have rows of different lengths; give one number for each agent",
        ),
        ({}, ["a", "b", "c"], 1.0, "the velocities are not all real numbers"),
        ({}, VELOCITIES, "2", "the damping mu is 2; it must be a positive"),
        ({}, VELOCITIES, np.nan, "the damping mu is nan; it must be a positive"),
        ({}, VELOCITIES, 0.0, "the damping mu is 0.0; it must be a positive"),
        ({"trigger": Trigger(TriggerKind.CONTINUOUS)}, VELOCITIES, 1.0, "kind is 'continuous'; for double integrators"),
        (
            {"channel": Channel(loss=0.1)},
            VELOCITIES,
            1.0,
            r"\[channel\] delays or loses broadcasts; double integrators",
        ),
    ],
)
def test_refusals(changes, velocities, damping, message):
    with pytest.raises(ScenarioError, match=message):
        double_integrator_agents(replace(read_scenario(RING), **changes), velocities, damping)

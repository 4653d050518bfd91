"""The exact solution used as an oracle, itself checked: published values, solutions by hand, a general ODE solver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.exact_consensus import exact_run, safe_step
from scipy.integrate import solve_ivp

from hybrid_model.consensus.graphs.undirected import complete_edges, weighted_laplacian
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario

TWO_AGENTS = {
    "name": "two",
    "stop_time": 30.0,
    "network": {"agents": 2, "edges": [[1, 2]], "initial": [0.0, 0.05]},
    "weights": {"kind": "constant", "value": 1.0},
    "trigger": {"kind": "static", "threshold": 0.5},
}


@pytest.mark.parametrize(
    ("name", "counts", "min_gap", "x_end"),
    [
        ("paper-a-static", [2, 6, 13, 4], 0.106236, [0.817749136204, 0.809163584777, 1.078555901778, 0.994531377241]),
        ("paper-a", [4, 10, 13, 8], 0.103836, [0.927800406772, 0.932060314225, 0.915459109314, 0.924680169689]),
    ],
)
def test_published_reference_values_of_scenario_a(name, counts, min_gap, x_end):
    run = exact_run(load_scenario(name))
    assert run.counts == counts
    assert run.min_gap == pytest.approx(min_gap, abs=5e-7)  # published with six decimals
    # Event times are ill-conditioned where the weight is near zero; states agree to 1e-10.
    np.testing.assert_allclose(run.x_end, x_end, atol=1e-10)


def test_two_agents_fire_together_at_the_times_found_by_hand():
    # The difference .05 drives each error to .5 in 10 s; then the difference .95 in 1/1.9 s; then .05 again.
    run = exact_run(read_scenario(TWO_AGENTS))
    expected = [10.0, 10.0 + 1 / 1.9, 20.0 + 1 / 1.9, 20.0 + 2 / 1.9]
    for times in run.event_times:
        np.testing.assert_allclose(times, expected, rtol=1e-13)
    np.testing.assert_array_equal(*run.event_times)


def test_an_event_while_no_edge_carries_weight():
    # Weight 1 up to t = 1, then none. |e| = .2 from then on meets .5 exp(-t/2) at 2 ln 2.5.
    entries = {
        **TWO_AGENTS,
        "network": {"agents": 2, "edges": [[1, 2]], "initial": [0.0, 0.2]},
        "switching": {"dwell": 1.0, "active": [[1], []]},
        "stop_time": 1.99,
        "trigger": {"kind": "dynamic", "threshold": 0.5, "decay": 0.5},
    }
    run = exact_run(read_scenario(entries))
    for times in run.event_times:
        np.testing.assert_allclose(times, [2 * np.log(2.5)], rtol=1e-13)


def test_a_safe_step_is_the_first_root_of_the_parabola():
    f, slope, curvature = np.array([-1.0, -1.0, -1.0, -1.0, 0.0]), np.array([1.0, -1.0, 0.0, -1.0, -1.0]), 2.0
    curvatures = np.array([curvature, curvature, 0.0, 0.0, 0.0])
    golden = (np.sqrt(5) - 1) / 2
    np.testing.assert_allclose(safe_step(f, slope, curvatures), [golden, golden + 1, np.inf, np.inf, np.inf])


@st.composite
def random_scenarios(draw):
    agents = draw(st.integers(2, 4))
    pairs = complete_edges(agents)
    edges = draw(st.lists(st.sampled_from(pairs), min_size=1, unique=True))
    each = {"min_size": len(edges), "max_size": len(edges)}
    gated = {
        "kind": "gated-sine",
        "map": draw(st.sampled_from(["square", "abs"])),
        "gate_rate": draw(st.lists(st.floats(1.0, 8.0), **each)),
        "sine_rate": draw(st.lists(st.floats(1.0, 8.0), **each)),
        "duty_percent": draw(st.lists(st.floats(10.0, 90.0), **each)),
        "phase": draw(st.lists(st.floats(-3.0, 3.0), **each)),
    }
    constant = {"kind": "constant", "value": draw(st.lists(st.floats(0.1, 2.0), **each))}
    numbers = st.integers(1, len(edges))
    phases = st.lists(st.lists(numbers, unique=True), min_size=1, max_size=3)
    entries = {
        "name": "random",
        "stop_time": 4.0,
        "network": {
            "agents": agents,
            "edges": [list(edge) for edge in edges],
            "initial": draw(st.lists(st.floats(-1.0, 1.0), min_size=agents, max_size=agents)),
        },
        "weights": draw(st.sampled_from([gated, constant])),
        "trigger": {"kind": "dynamic", "threshold": draw(st.floats(0.1, 0.5)), "decay": draw(st.floats(0.0, 0.5))},
    }
    if draw(st.booleans()):
        entries["switching"] = {"dwell": draw(st.floats(0.3, 1.5)), "active": draw(phases)}
    return read_scenario(entries)


@given(random_scenarios())
@settings(max_examples=25, deadline=None)
def test_between_its_events_the_run_solves_the_differential_equation(scenario):
    """A general solver replays the oracle's events: the end must agree and the errors obey the threshold."""
    run = exact_run(scenario)
    network, weights = scenario.network, scenario.edge_weights
    x = np.array(network.initial)
    broadcast = x.copy()
    instants = sorted({t for times in run.event_times for t in times})
    for start, end in zip([0.0, *instants], [*instants, scenario.stop_time], strict=True):
        for piece in weights.pieces(start, end):

            def flow(t, _, piece=piece, held=broadcast):
                values = piece.amplitudes * [float(carrier.value(t)) for carrier in piece.carriers]
                return -network.gain * weighted_laplacian(network.agents, network.edges, values) @ held

            times = np.linspace(piece.start, piece.end, 8)
            solution = solve_ivp(flow, (piece.start, piece.end), x, "DOP853", times, rtol=1e-10, atol=1e-12)
            error = np.abs(broadcast[:, None] - solution.y)
            assert np.all(error <= scenario.trigger.level(times) + 1e-8)
            x = solution.y[:, -1]
        for agent, events in enumerate(run.event_times):
            if end in events:
                # The solver's tolerance of 1e-12 per piece, over at most some hundred pieces.
                assert abs(abs(broadcast[agent] - x[agent]) - float(scenario.trigger.level(end))) < 1e-9
                broadcast[agent] = x[agent]
    np.testing.assert_allclose(x, run.x_end, atol=1e-9)
    assert run.x_end.mean() == pytest.approx(np.mean(network.initial), abs=1e-13)  # 1^T D = 0: the mean is conserved

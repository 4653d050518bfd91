"""The edge-domain system against the graph's spectrum and against an event-triggered run."""

from itertools import pairwise

import control
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus.exact.edge_domain import edge_domain_system
from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.laws.closed_loop import agent_name, closed_loop
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario


@pytest.fixture
def scenario():
    return read_scenario(
        {
            "name": "ring",
            "stop_time": 3.0,
            "network": {
                "agents": 4,
                "edges": [[1, 2], [2, 3], [3, 4], [4, 1], [1, 3]],
                "initial": [1.0, -2.0, 0.3, 0.8],
                "gain": 1.5,
            },
            "weights": {"kind": "constant", "value": [1.0, 0.5, 2.0, 0.7, 0.2]},
            "trigger": {"kind": "static", "threshold": 0.2},
        }
    )


def test_poles_are_the_nonzero_eigenvalues_of_the_laplacian(scenario):
    """The paths to both sides differ: python-control's poles, and the symmetric eigenvalue problem of L."""
    matrix = incidence(4, scenario.network.edges)
    laplacian = matrix @ np.diag([1.0, 0.5, 2.0, 0.7, 0.2]) @ matrix.T
    expected = -1.5 * np.linalg.eigvalsh(laplacian)[1:]
    poles = np.sort(control.poles(edge_domain_system(scenario)).real)
    np.testing.assert_allclose(poles, np.sort(expected), rtol=1e-10)


def test_signals_have_names(scenario):
    system = edge_domain_system(scenario)
    assert system.input_labels == ["e[1]", "e[2]", "e[3]", "e[4]"]
    assert system.output_labels == [f"x_e[{k}]" for k in range(1, 6)]
    assert system.nstates == 3


def test_driven_by_the_errors_of_a_run_it_gives_the_edge_states_of_the_run(scenario):
    """Between two events e is linear in time, so the response on a grid with both sides of the events is exact."""
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    system = edge_domain_system(scenario)
    matrix = incidence(4, scenario.network.edges)
    cuts = np.unique([0.0, *(jump.t for jump in arc.jumps), scenario.stop_time])
    names = [agent_name(i) for i in range(1, 5)]
    state = None
    for start, end in pairwise(cuts):
        broadcast = np.array([arc.at(f"{name}.broadcast", start) for name in names])
        times = np.linspace(0.0, end - start, 5)
        x = np.array([arc.at(f"{name}.x", start + times, before=True) for name in names])
        x[:, 0] = [arc.at(f"{name}.x", start) for name in names]
        if state is None:
            state = np.linalg.lstsq(system.C, matrix.T @ x[:, 0], rcond=None)[0]
        response = control.forced_response(system, times, broadcast[:, None] - x, state)
        np.testing.assert_allclose(response.outputs, matrix.T @ x, rtol=0, atol=1e-9)
        state = response.states[:, -1]


def test_weights_that_change_are_refused():
    with pytest.raises(ScenarioError, match="paper-a: the weights change with time"):
        edge_domain_system(load_scenario("paper-a"))

"""Gains of the edge domain: closed forms for two agents, independent discretisations for the rest."""

from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from hybrid_model.consensus.certificates.edge_comparison import compare_edge_domain
from hybrid_model.consensus.certificates.tree_bound import BoundForm
from hybrid_model.consensus.exact.edge_domain import edge_domain_gains, edge_domain_system, impulse_modes
from hybrid_model.consensus.exact.exponential_sums import absolute_integral, zeros
from hybrid_model.consensus.exact.floquet import floquet_spectrum, transition_matrix
from hybrid_model.consensus.exact.l2_gain import periodic_l2_gain
from hybrid_model.consensus.exact.periodic_edge_domain import period_map, periodic_gains
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.errors import DeclarationError
from hybrid_model.linear import h_infinity_norm

BISECTION = 3e-6  # python-control's bisection is asked for 1e-6 relative; twice that for its first bracket


def network(edges, values, *, agents=None, gain=1.0, switching=None, trigger=None):
    agents = agents or max(max(edge) for edge in edges)
    entries = {
        "name": "network",
        "stop_time": 5.0,
        "network": {"agents": agents, "edges": edges, "initial": [0.3 * i for i in range(agents)], "gain": gain},
        "weights": {"kind": "constant", "value": values},
        "trigger": trigger or {"kind": "static", "threshold": 0.2},
    }
    return read_scenario(entries | ({"switching": switching} if switching else {}))


PAIR = {"edges": [[1, 2]], "values": [0.7], "gain": 1.3}
RING = {
    "edges": [[1, 2], [2, 3], [3, 4], [4, 1], [1, 3]],
    "values": [1.0, 0.5, 2.0, 0.7, 0.2],
    "gain": 1.5,
}


def test_two_agents_in_closed_form():
    """``x_e' = -2kw x_e - 2kw (e_2 - e_1)``: one pole, gains sqrt(2) and 2."""
    gains = edge_domain_gains(network(**PAIR))
    np.testing.assert_allclose(gains.poles, [-2 * 1.3 * 0.7], rtol=1e-12)
    assert gains.l2 == pytest.approx(np.sqrt(2), rel=BISECTION)
    assert gains.peak == pytest.approx(2.0, rel=1e-12)
    assert gains.radius == pytest.approx(2.0, rel=1e-6)


def test_complete_graph_with_one_weight_in_closed_form():
    """All poles are -kwn, ``g_e = -kwn exp(-kwn t)`` times +-1: peak 2 on each edge; sqrt(n) and c_n for the norms."""
    n, w = 4, 0.6
    edges = [[i, j] for i in range(1, n + 1) for j in range(i + 1, n + 1)]
    gains = edge_domain_gains(network(edges, [w] * len(edges)))
    np.testing.assert_allclose(gains.poles, -w * n, rtol=1e-9)
    np.testing.assert_allclose(gains.peaks, 2.0, rtol=1e-9)
    assert gains.h_infinity == pytest.approx(np.sqrt(n), rel=BISECTION)
    # ||x_e|| = sqrt(n) ||U^T e||, largest with half of the signs each way: sqrt(n) sqrt(n).
    assert gains.radius == pytest.approx(n, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_h_infinity_norm_is_that_of_the_incidence_matrix_whatever_the_weights(scale):
    system = edge_domain_system(network(RING["edges"], [scale * w for w in RING["values"]]))
    expected = np.linalg.norm(incidence(4, [tuple(edge) for edge in RING["edges"]]), 2)
    assert h_infinity_norm(system) == pytest.approx(expected, rel=BISECTION)
    frequencies = np.concatenate(([0.0], scale * np.logspace(-3, 3, 50)))
    largest = max(np.linalg.norm(system(1j * w), 2) for w in frequencies)
    assert largest == pytest.approx(expected, rel=1e-9)


def test_h_infinity_norm_of_a_resonance():
    """``1/(s^2 + 2 d s + 1)`` has the largest gain ``1/(2 d sqrt(1 - d^2))``."""
    d = 0.05
    resonance = control.ss([[0, 1], [-1, -2 * d]], [[0], [1]], [[1, 0]], 0)
    assert h_infinity_norm(resonance) == pytest.approx(1 / (2 * d * np.sqrt(1 - d**2)), rel=BISECTION)
    with pytest.raises(DeclarationError, match="not stable"):
        h_infinity_norm(control.ss(0, 1, 1, 0))


def test_peak_gains_against_quadrature_of_python_controls_impulse_responses():
    scenario = network(**RING)
    gains, system = edge_domain_gains(scenario), edge_domain_system(scenario)
    times = np.linspace(0.0, 12.0, 12001)
    responses = control.impulse_response(system, times).outputs
    # The trapezoidal rule on a step of 1 ms: error about h^2 rate^2/12 = 4e-6, and kinks where a response changes sign.
    expected = np.trapezoid(np.abs(responses), times, axis=2).sum(axis=1)
    np.testing.assert_allclose(gains.peaks, expected, rtol=2e-5)


def test_bang_bang_errors_reach_the_peak_gain():
    """The errors with the signs of the reversed impulse response: the edge state comes up to its peak gain."""
    scenario = network(**RING)
    rates, modes = impulse_modes(scenario)
    edge, horizon = 1, 20.0 / rates[0]
    times = np.linspace(0.0, horizon, 40001)
    response = modes[edge] @ np.exp(-np.outer(rates, times))
    reached = np.trapezoid(response * np.sign(response), times, axis=1).sum()
    assert reached == pytest.approx(edge_domain_gains(scenario).peaks[edge], rel=1e-4)  # trapezoid at 40001 points


@pytest.mark.parametrize("seed", range(20))
def test_absolute_integral_against_quadrature(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 6))
    values, rates = rng.standard_normal(count), rng.uniform(0.3, 5.0, count)
    cuts = [0.0, *zeros(values[np.argsort(rates)], np.sort(rates), 60.0), 120.0]
    expected = sum(
        quad(lambda t: abs(values @ np.exp(-rates * t)), a, b, epsabs=1e-12, limit=200)[0] for a, b in pairwise(cuts)
    )
    assert absolute_integral(values, rates) == pytest.approx(expected, rel=1e-7, abs=1e-10)
    grid = np.linspace(0.0, 10.0, 4001)
    signs = np.sign(np.exp(-np.outer(grid, rates)) @ values)
    assert len([t for t in cuts if 0 < t < 10.0]) >= np.count_nonzero(np.diff(signs))


def test_integral_of_terms_that_cancel_is_zero_and_of_growing_ones_is_refused():
    assert absolute_integral(np.array([1.0, -1.0]), np.array([2.0, 2.0])) == 0.0
    assert absolute_integral(np.array([1.0, -2.0]), np.array([1.0, 2.0])) == pytest.approx(0.5)
    with pytest.raises(ValueError, match="not positive"):
        absolute_integral(np.array([1.0]), np.array([0.0]))


# --- periodic weights ------------------------------------------------------------------------------------------------


def pair_on_and_off(on, off, w=0.7, gain=1.3):
    phases = {"kind": "sequence", "dwell": [on, off], "active": [[1], []], "repeat": True}
    return network([[1, 2]], [w], gain=gain, switching=phases)


@pytest.mark.parametrize(("on", "off"), [(0.4, 0.4), (0.1, 2.0), (1.5, 0.2)])
def test_l2_gain_of_two_agents_that_meet_now_and_then(on, off):
    """With a = 2kw and s = a sqrt(1 - 1/g^2): the Hamiltonian's trace over a period is 2 at
    ``2 tanh(s on/2) = off a^2/(g^2 s)``; sqrt(2) takes e_2 - e_1 for one error."""
    a = 2 * 0.7 * 1.3

    def defect(gain):
        s = a * np.sqrt(1 - 1 / gain**2)
        return 2 * np.tanh(s * on / 2) - off * a**2 / (gain**2 * s)

    expected = np.sqrt(2) * brentq(defect, 1 + 1e-12, 1e3, xtol=1e-12)
    # The bisection stops at 1e-7; weights are constant on each piece, so the grid adds nothing.
    assert periodic_l2_gain(pair_on_and_off(on, off)) == pytest.approx(expected, rel=2e-7)


def test_l2_gain_of_constant_weights_is_the_h_infinity_norm():
    assert periodic_l2_gain(network(**RING)) == pytest.approx(edge_domain_gains(network(**RING)).l2, rel=BISECTION)


def lifted_gain(scenario, cells, phases=5):
    """Largest gain over errors held on short cells that repeat up to a factor on the unit circle from period to period.

    Independent of the Hamiltonian: one matrix from all errors of a period to all edge states at the cells' middles.
    """
    period = scenario.edge_weights.period
    times = np.linspace(0.0, period, cells + 1)
    flows = [transition_matrix(scenario, a, b) for a, b in pairwise(times)]
    basis = disagreement_basis(scenario.network.agents)
    size = basis.shape[1]
    outputs = incidence(scenario.network.agents, scenario.network.underlying_edges).T @ basis
    # Held errors act like a shift of the state: xi + U^T e moves freely.
    start, driven = np.eye(size, dtype=complex), np.zeros((size, cells * size))
    rows_start, rows_driven = [], []
    for j, flow in enumerate(flows):
        before_start, before_driven = start, driven
        start, driven = flow @ start, flow @ driven
        driven[:, j * size : (j + 1) * size] += flow - np.eye(size)
        rows_start.append((before_start + start) / 2)
        rows_driven.append((before_driven + driven) / 2)
    best = 0.0
    for theta in np.linspace(0.0, np.pi, phases):
        first = np.linalg.solve(np.exp(1j * theta) * np.eye(size) - start, driven)
        states = np.concatenate([a @ first + b for a, b in zip(rows_start, rows_driven, strict=True)])
        best = max(best, np.linalg.norm(np.kron(np.eye(cells), outputs) @ states, 2))
    return best


def test_l2_gain_with_switching_and_gated_weights_against_a_lifted_matrix():
    switched = network([[1, 2], [2, 3]], [1.2, 0.5], switching={"kind": "periodic", "dwell": 0.8, "active": [[1], [2]]})
    gain = periodic_l2_gain(switched)
    # Held errors are some of all errors, and the middles' rule is of second order: the sequence is extrapolated.
    coarse, fine = lifted_gain(switched, 24), lifted_gain(switched, 48)
    assert gain == pytest.approx(fine + (fine - coarse) / 3, rel=1e-3)
    paper = load_scenario("paper-a")
    # Cells that do not end where the gates do: first order, some per cent at this number of cells.
    assert periodic_l2_gain(paper) == pytest.approx(lifted_gain(paper, 80, phases=1), rel=0.05)


def test_l2_gain_converges_in_the_second_order():
    paper = load_scenario("paper-a")
    gains = [periodic_l2_gain(paper, resolution, tolerance=1e-10) for resolution in (0.08, 0.04, 0.02)]
    assert (gains[1] - gains[0]) / (gains[2] - gains[1]) == pytest.approx(4.0, rel=0.3)


def test_map_over_a_period_has_the_multipliers_as_poles_and_moves_as_the_network_does():
    paper = load_scenario("paper-a")
    system = period_map(paper)
    assert system.dt == pytest.approx(2 * np.pi)
    spectrum = floquet_spectrum(paper)
    np.testing.assert_allclose(np.sort(np.abs(system.poles())), np.sort(np.abs(spectrum.multipliers)), rtol=1e-9)
    # Published reference values of scenario A, to the digits printed.
    np.testing.assert_allclose(np.sort(system.poles().real)[::-1], [0.0525799, 0.0262069, 0.000292459], rtol=2e-6)
    # Constant errors end at x = -e up to the mean: gain -D^T at frequency zero.
    np.testing.assert_allclose(system.dcgain(), -incidence(4, paper.network.underlying_edges).T, rtol=0, atol=1e-10)
    assert h_infinity_refuses(system)


def h_infinity_refuses(system):
    with pytest.raises(DeclarationError, match="is discrete"):
        h_infinity_norm(system)
    return True


def test_periodic_gains_of_the_paper_have_the_published_exact_radius():
    gains = periodic_gains(load_scenario("paper-a"))
    assert gains.spectrum.rate == pytest.approx(0.468778, abs=5e-7)
    assert 0.5 * gains.radius == pytest.approx(2.26459, abs=1e-5)  # c = 0.5; printed with five decimals
    assert max(gains.peaks.values()) <= gains.radius
    assert min(gains.peaks.values()) >= 2.0  # constant errors of either sign


# --- and the paper's alpha_v and kappa_2 -----------------------------------------------------------------------------


def test_for_two_agents_and_short_windows_alpha_and_kappa_tend_to_the_exact_values():
    """As T tends to 0, alpha_v tends to the pole 2kw and rho kappa_2 to 2c, the exact peak."""
    for window, accuracy in ((1e-2, 0.1), (1e-4, 1e-3)):  # both err by about 2 k w T, times a small factor
        found = compare_edge_domain(network(**PAIR), window=window)
        for form in BoundForm:
            assert found.alpha[form] == pytest.approx(found.rate, rel=accuracy)
            assert found.alpha[form] < found.rate
            assert found.rho_kappa2[form] == pytest.approx(found.radius, rel=accuracy)
            assert found.rho_kappa2[form] > found.radius
    assert found.rate == pytest.approx(2 * 1.3 * 0.7)
    assert found.radius == pytest.approx(0.4, rel=1e-6)
    assert found.rms == pytest.approx(0.2 * np.sqrt(2) * np.sqrt(2), rel=BISECTION)


@pytest.mark.parametrize("scenario", [network(**RING), load_scenario("paper-a")], ids=["constant", "paper-a"])
def test_exact_values_lie_on_the_right_side_of_the_valid_bounds(scenario):
    found = compare_edge_domain(scenario, resolution=0.03)
    assert 0 < found.alpha[BoundForm.VALID] <= found.rate
    assert found.rho_kappa2[BoundForm.VALID] >= found.radius


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: edge_domain_gains(load_scenario("paper-a")), "paper-a: the weights change with time"),
        (lambda: edge_domain_gains(network([[1, 2], [2, 3]], [1.0, 0.0])), "do not join all agents"),
        (
            lambda: periodic_gains(
                network([[1, 2], [2, 3]], [1.0, 1.0], switching={"dwell": 1.0, "active": [[1], []]})
            ),
            "do not join all agents",
        ),
        (lambda: compare_edge_domain(network(**PAIR, trigger={"kind": "continuous"})), "has no threshold c"),
    ],
)
def test_what_has_no_gain_is_refused(call, message):
    with pytest.raises(ScenarioError, match=message):
        call()

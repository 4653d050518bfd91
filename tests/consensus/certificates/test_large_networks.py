"""Certificates of large networks: what scales is right; what does not is left out, with a note, before it is begun."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from hybrid_model.consensus import ConstantWeight, GatedSine, Scenario, SineWeight, certify, graph_of_kind
from hybrid_model.consensus.certificates import analysis as analysis_module
from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.energy import initial_peaks
from hybrid_model.consensus.certificates.observation import undisturbed
from hybrid_model.consensus.certificates.sizes import LARGE, Cost, trees_cost, worst_case_cost
from hybrid_model.consensus.exact.floquet import floquet_spectrum
from hybrid_model.consensus.exact.free_motion import CellMotion, ConstantMotion, SparseMotion, leading_multipliers
from hybrid_model.consensus.exact.transition_grid import transition_grid
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence, weighted_laplacian
from hybrid_model.consensus.messages import enumerated
from hybrid_model.consensus.scenario.definition import Network, Weights
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching

WAVES = {
    "constant": lambda k: ConstantWeight(1.0 + 0.1 * (k % 3)),
    "gated": lambda k: GatedSine(4.0, 5.0, 40.0 - (k % 2), 0.0),
    "different": lambda k: SineWeight(2.0 + (k % 2), 1.0, 0.5, 0.0),
}


def network(agents, wave="constant", kind="ring", decay=0.0):
    graph = graph_of_kind(kind, agents, degree=4, seed=2)
    count = len(graph.edges)
    initial = np.random.default_rng(agents).standard_normal(agents)
    trigger = Trigger(TriggerKind.DYNAMIC, 0.05, decay) if decay else Trigger(TriggerKind.STATIC, 0.05)
    return Scenario(
        f"{kind} of {agents}",
        20.0,
        Network(agents, graph.edges, tuple(initial.tolist())),
        Weights(tuple(WAVES[wave](k) for k in range(count))),
        NoSwitching(count),
        trigger,
    )


def as_small(monkeypatch):
    monkeypatch.setattr(analysis_module, "LARGE", 10**9)


def test_states_with_constant_weights_are_those_of_the_matrix_exponential():
    scenario = network(20, kind="small-world")
    laplacian = weighted_laplacian(20, scenario.network.edges, scenario.edge_weights.value(0.0))
    times = np.array([0.0, 0.3, 2.0, 40.0])
    expected = np.stack([expm(-t * laplacian) @ scenario.network.initial for t in times], axis=1)
    assert ConstantMotion(scenario).states(times) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("wave", ["gated", "different"])
def test_states_from_cell_to_cell_are_those_of_transition_matrices(wave):
    scenario = network(12, wave)
    period = scenario.edge_weights.period
    motion, cells = SparseMotion(scenario, period), transition_grid(scenario, 0.0, period, 0.02)
    basis, start = disagreement_basis(12), np.asarray(scenario.network.initial)
    flow = np.linalg.matrix_power(cells.product(), 2)
    expected = basis @ flow @ basis.T @ start + start.mean()
    # A product rounds by an ulp a factor; both are Magnus series of the fourth order where edges have different shapes.
    rounding = 2 * len(cells.flows) * np.finfo(float).eps
    assert motion.over_a_cycle(start, 2) == pytest.approx(expected, abs=rounding if wave == "gated" else 1e-8)
    assert motion.path(start)[-1] == pytest.approx(motion.over_a_cycle(start), abs=1e-14)


@pytest.mark.parametrize("wave", ["gated", "different"])
def test_the_largest_multipliers_are_those_of_the_monodromy_matrix(wave):
    scenario = network(16, wave)
    period = scenario.edge_weights.period
    cells = transition_grid(scenario, 0.0, period, 0.02)
    expected = np.sort(np.abs(np.linalg.eigvals(cells.product())))[::-1][:4]
    # Without matrices a period takes long where edges of different shape make many cells.
    motion = SparseMotion(scenario, period) if wave == "gated" else CellMotion(scenario, cells)
    assert np.abs(leading_multipliers(motion, 16)) == pytest.approx(expected, rel=1e-10)


def test_the_rate_of_weights_of_different_shape_needs_no_monodromy_matrix():
    scenario = network(16, "different")
    assert analyse(scenario).spectrum.rate == pytest.approx(floquet_spectrum(scenario).rate, rel=1e-7)


@pytest.mark.parametrize("wave", ["constant", "gated"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_the_share_of_the_start_is_bounded_from_above_and_closely(wave, share, monkeypatch):
    scenario = network(18, wave)
    analysis = analyse(scenario)
    decay = share * analysis.spectrum.rate
    norm, pairs = initial_peaks(analysis, decay)
    # The same quantities from matrices, as of small networks.
    as_small(monkeypatch)
    other, others = initial_peaks(analyse(scenario), decay)
    assert norm == pytest.approx(other, rel=1e-3)
    assert pairs == pytest.approx(others, rel=2e-2)
    if wave == "constant":
        times = np.linspace(0.0, 60.0, 6001)
        D = incidence(18, scenario.network.edges)
        shown = np.abs(D.T @ ConstantMotion(scenario).states(times)) * np.exp(decay * times)
        assert np.all(pairs >= shown.max(axis=1))
        assert norm >= np.linalg.norm(shown, axis=0).max()


def test_what_errors_leave_out_is_the_same_by_modes_and_by_matrices(monkeypatch):
    scenario = network(17, "gated")
    times, states = undisturbed(analyse(scenario), 20.0)
    as_small(monkeypatch)
    expected = undisturbed(analyse(scenario), 20.0)
    assert times == pytest.approx(expected[0], abs=1e-12)
    assert states == pytest.approx(expected[1], abs=1e-12)


def test_a_ring_of_a_hundred_has_its_bounds_and_says_what_is_left_out():
    scenario = network(100)
    scenario = replace(scenario, weights=Weights((ConstantWeight(1.0),) * 100))
    found = certify(scenario)
    rate = 2 - 2 * math.cos(2 * math.pi / 100)
    assert found.value("rate", "floquet") == pytest.approx(rate, rel=1e-10)
    assert found.value("rate", "improved") <= found.value("rate", "floquet") * (1 + 1e-12)
    assert found.value("radius", "exact") is None
    # A trivial run: errors of c on every other agent, for ever, shift them by c against their neighbours.
    assert found.value("radius", "energy") >= 0.05 * 2 * math.sqrt(100)
    assert found.value("radius", "energy") <= found.value("radius", "improved") <= found.value("radius", "valid")
    assert 0 < found.value("min_gap", "valid") <= found.value("min_gap", "improved")
    notes = " ".join(found.notes)
    assert "The exact radius is left out: for 100 agents it would take about" in notes
    assert "along all spanning trees are left out" in notes
    assert "(99 in all)" in notes
    assert all(len(note) < 1500 for note in found.notes)


def test_a_thousand_agents_are_judged_before_anything_is_begun():
    scenario = network(1000)
    cost = worst_case_cost(scenario, 2.5e4, 0.0, 0.01, 4.0)
    assert cost.seconds > 1e5
    assert "days" in str(cost)
    # A ring has as many spanning trees as edges; that many numbers of a complete graph leave the range of floats.
    assert trees_cost(scenario, 200).seconds > 1e3
    assert trees_cost(network(150, kind="complete"), 200).seconds > 30


def test_patience_decides_in_large_networks_and_memory_in_all(monkeypatch):
    scenario = network(LARGE + 4)
    impatient, patient = (Bounds(analyse(scenario, patience=patience)) for patience in (0.1, 1e6))
    assert impatient.is_left_out(0.0)
    assert not patient.is_left_out(0.0)
    small = analyse(network(4))
    assert small.affords(Cost(1e9, 0.0))
    assert not small.affords(Cost(0.0, 1e18))
    monkeypatch.setattr(analysis_module, "memory_limit", lambda: 1e3)
    assert Bounds(small).is_left_out(0.0)
    assert Bounds(small).exact_radius is None


def test_long_lists_in_sentences_are_cut():
    assert enumerated(range(30)).endswith("28, 29")
    assert enumerated(range(31)) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, ... (31 in all)"

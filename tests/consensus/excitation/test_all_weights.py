"""Excitation constants of every kind of weight, and jointly connected intervals."""

import math

import networkx as nx
import numpy as np
import pytest
from catalogue_weights import SWITCHING, WEIGHTS, moving_agents, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid_model.consensus.excitation.joint import joint_excitation
from hybrid_model.consensus.excitation.persistence import (
    Signal,
    excitation_constants,
    scenario_excitation,
    signal_factor,
    window_extremes,
)
from hybrid_model.consensus.excitation.trees import tree_excitations
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.sources import preset_names
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.weights.edge_weights import EdgeWeights
from hybrid_model.consensus.weights.function import FunctionWeight
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sine import SineWeight

PERIODIC = {
    "sine": {"kind": "sine", "mean": [0.5, 1.0, 0.7, 0.3], "depth": 0.9, "rate": [1.0, 2.0, 3.0, 1.5], "phase": 0.4},
    "square": {
        "kind": "square",
        "high": [2.0, 1.0, 1.5, 0.8],
        "low": [0.0, 0.1, 0.0, 0.3],
        "gate_rate": [3.0, 2.0, 2.0, 4.0],
        "duty_percent": [30.0, 55.0, 40.0, 20.0],
        "phase": [0.0, 1.0, -0.5, 0.2],
    },
    "piecewise": WEIGHTS["piecewise"],
    "sampled": WEIGHTS["sampled"] | {"repeat": True},
}


def scan(scenario, factor, window, starts):
    """Extremes over many starts, the integrals by a fine midpoint rule on values alone."""
    grid = np.linspace(starts[0], starts[-1] + window, 20001)
    step = grid[1] - grid[0]
    middles = grid[:-1] + step / 2
    values = np.stack([wave.value(middles) for wave in scenario.weights.waveforms], axis=-1)
    if not isinstance(scenario.switching, NoSwitching):
        values = values * np.array([scenario.switching.active_at(t) for t in middles])
    before = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0))) * step

    def primitive(t):
        return np.stack([np.interp(t, grid, column) for column in before.T], axis=-1)

    integrals = primitive(starts + window) - primitive(starts)
    matrices = np.einsum("re,se,qe->srq", factor, integrals, factor)
    eigenvalues = np.linalg.eigvalsh(matrices)
    return eigenvalues[:, 0].min(), eigenvalues[:, -1].max(), np.linalg.norm(matrices, axis=(1, 2)).max()


class TestConstantsOfEveryKind:
    @pytest.mark.parametrize("kind", [*PERIODIC, "moving"])
    @pytest.mark.parametrize("share", [0.37, 1.0, 1.8])
    def test_periodic_weights_against_dense_sampling(self, kind, share):
        scenario = moving_agents() if kind == "moving" else ring(weights=PERIODIC[kind])
        period = scenario.edge_weights.period
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        found = excitation_constants(factor, scenario.edge_weights, share * period)
        assert found.horizon is None
        mu1, mu2, frobenius = scan(scenario, factor, share * period, np.linspace(0.0, period, 1501))
        # The scan errs by the step of its midpoint rule at jumps and by the step of its starts, both below 1e-3 of
        # the period, times weights of at most 4.
        slack = 4e-3 * period
        assert found.mu1 == pytest.approx(mu1, abs=slack)
        assert found.mu2 == pytest.approx(mu2, abs=slack)
        assert found.frobenius == pytest.approx(frobenius, abs=2 * slack)
        assert found.mu2 <= found.mu2_bar * (1 + 1e-12)
        assert found.mu2_bar <= 3 * found.mu2 * (1 + 1e-12)  # the trace, for p = 3

    @pytest.mark.parametrize("kind", ["sampled", "random_dwell", "markov", "jointly_connected"])
    def test_without_a_period_the_constants_hold_for_the_run(self, kind):
        scenario = ring(weights=WEIGHTS["sampled"]) if kind == "sampled" else ring(switching=SWITCHING[kind])
        assert scenario.edge_weights.period is None
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        found = scenario_excitation(scenario, Signal.DISAGREEMENT, window=4.1)
        assert found.horizon == scenario.stop_time == 12.0
        mu1, mu2, frobenius = scan(scenario, factor, 4.1, np.linspace(0.0, 12.0 - 4.1, 2001))
        assert (found.mu1, found.mu2, found.frobenius) == pytest.approx((mu1, mu2, frobenius), abs=2e-2)
        whole = scenario_excitation(scenario, Signal.DISAGREEMENT, window=12.0)
        dose = scenario.edge_weights.integral(0.0, 12.0)
        assert whole.mu1 == pytest.approx(np.linalg.eigvalsh((factor * dose) @ factor.T)[0], rel=1e-12)

    @given(
        values=st.lists(st.lists(st.integers(0, 8), min_size=4, max_size=4), min_size=3, max_size=3),
        window=st.floats(0.05, 9.0),
    )
    @settings(max_examples=40, deadline=None)
    def test_piecewise_constant_weights_have_their_extremes_at_corners(self, values, window):
        starts, cycle = (0.0, 0.5, 1.3, 2.0), 3.1
        weights = EdgeWeights(
            tuple(PiecewiseWeight(starts, tuple(map(float, row)), cycle) for row in values), NoSwitching(3)
        )
        factor = np.array([[1.0, 0.4, 0.0], [0.0, -0.3, 1.2]])
        found = window_extremes(factor, weights, window, None) if weights.period else None
        if found is None:
            return
        corners = [s + k * cycle for k in (0, 1) for s in starts]
        tried = np.array([t % cycle for t in [*corners, *(c - window for c in corners)]])
        integrals = weights.integral(tried, tried + window)
        eigenvalues = np.linalg.eigvalsh(np.einsum("re,se,qe->srq", factor, integrals, factor))
        assert found.mu1 == pytest.approx(max(eigenvalues[:, 0].min(), 0.0), abs=1e-10)
        assert found.mu2 == pytest.approx(eigenvalues[:, -1].max(), abs=1e-10)

    def test_windows_that_make_no_sense_are_refused(self):
        scenario = ring(switching=SWITCHING["markov"])
        with pytest.raises(ValueError, match=r"window is 13.0, longer than the horizon of 12.0 s"):
            scenario_excitation(scenario, Signal.DISAGREEMENT, window=13.0)
        with pytest.raises(ValueError, match="have no period, so no window length is the natural one"):
            scenario_excitation(scenario, Signal.DISAGREEMENT)


class TestJointlyConnectedIntervals:
    @pytest.mark.parametrize(
        "make",
        [
            lambda: load_scenario("paper-a"),
            lambda: load_scenario("paper-a-dwell-5"),
            lambda: load_scenario("paper-t"),
            lambda: ring(switching=SWITCHING["sequence"]),
            lambda: ring(switching=SWITCHING["jointly_connected"]),
            lambda: ring(weights=WEIGHTS["piecewise"], switching={"dwell": 0.85, "active": [[1, 3], [2], [4]]}),
        ],
    )
    def test_intervals_are_contiguous_and_joined_and_their_bounds_are_in_order(self, make):
        scenario = make()
        joint = joint_excitation(scenario)
        assert joint.intervals[0].start == 0.0
        for before, after in zip(joint.intervals, joint.intervals[1:], strict=False):
            assert before.end == after.start
        for interval in joint.intervals:
            tree = nx.Graph([scenario.network.edges[e - 1] for e in interval.tree])
            assert nx.is_tree(tree)
            assert tree.number_of_nodes() == scenario.network.agents
            assert interval.connectivity == pytest.approx(nx.algebraic_connectivity(tree, tol=1e-12), abs=1e-8)
            doses = scenario.edge_weights.integral(interval.start, interval.end)
            assert interval.weight == pytest.approx(min(doses[e - 1] for e in interval.tree), rel=1e-12)
        assert joint.longest == max(interval.length for interval in joint.intervals)
        assert joint.window == pytest.approx(min(2 * joint.longest, joint.exact.horizon or math.inf))
        slack = 1 + 1e-9
        assert joint.mu1_of_paths <= joint.mu1_of_trees * slack
        assert joint.mu1_of_trees <= joint.mu1_of_intervals * slack
        assert joint.mu1_of_intervals <= joint.exact.mu1 * slack
        assert joint.exact.mu2 <= joint.trace * slack
        assert joint.trace <= (scenario.network.agents - 1) * joint.exact.mu2 * slack

    def test_scenario_a(self):
        # Each dwell interval holds a tree: h = pi, T = 2 pi; the smallest integrated weights are 4 d_3 and 4 d_4.
        joint = joint_excitation(load_scenario("paper-a"))
        assert [interval.tree for interval in joint.intervals] == [(1, 2, 3), (2, 3, 4)]
        assert [interval.weight for interval in joint.intervals] == pytest.approx([1.217159, 1.197419], abs=1e-6)
        assert joint.window == pytest.approx(2 * math.pi)
        assert joint.exact.mu1 == pytest.approx(2.990276, abs=1e-6)
        assert joint.mu1_of_paths == pytest.approx(joint.mu1_of_trees)  # both trees are paths

    def test_unions_reach_over_several_graphs_and_over_the_end_of_the_cycle(self):
        switching = {"kind": "sequence", "dwell": [1.0, 2.0, 3.0], "active": [[1], [2, 3], [4]], "repeat": True}
        joint = joint_excitation(ring(switching=switching))
        # From 0: edges 1, 2, 3 join all at 3. From 3: 4, then 1, then 2 and 3, at 9, which is 3 again in the cycle.
        assert [(i.start, i.end) for i in joint.intervals] == [(0.0, 3.0), (3.0, 9.0)]
        assert joint.window == 12.0

    def test_fading_weights_have_no_lower_bound_although_every_union_is_connected(self):
        # Audit, section 8: weights 2^-j in interval j; the corollary as printed is content with this.
        count = 12
        fading = {"kind": "piecewise", "starts": list(range(count)), "values": [2.0**-j for j in range(count)]}
        scenario = ring(weights=fading, switching={"dwell": 0.5, "active": [[1, 3], [2, 4]]})
        weights = [interval.weight for interval in joint_excitation(scenario).intervals]
        np.testing.assert_allclose(weights, [0.5 * 2.0**-j for j in range(count)])

    def test_a_network_that_is_never_joined_is_refused(self):
        with pytest.raises(ValueError, match="the union of the graphs over the whole run is not connected"):
            joint_excitation(ring(switching={"dwell": 1.0, "active": [[1], [2]]}))
        with pytest.raises(ValueError, match="nothing changes in time"):
            joint_excitation(ring())

    def test_constants_along_each_tree_of_scenario_a(self):
        scenario = load_scenario("paper-a")
        trees = {found.partition.tree: found for found in tree_excitations(scenario)}
        assert set(trees) == {(1, 2, 3), (1, 2, 4), (1, 3, 4), (2, 3, 4)}  # a ring without one of its edges
        first = trees[1, 2, 3]
        assert (first.weights.mu1, first.weights.mu2) == pytest.approx((1.256637, 2.473796), abs=1e-6)
        assert (first.coordinates.mu1, first.coordinates.mu2) == pytest.approx((1.577391, 5.725561), abs=1e-6)
        for found in trees.values():
            assert found.weights.mu1 <= found.coordinates.mu1
        assert len(tree_excitations(scenario, most=2)) == 2


def test_every_preset_has_a_window():
    for name in preset_names():
        scenario = load_scenario(name)
        if scenario.edge_weights.period is None:
            # Long enough for both trees: a window of 12 s holds each dwell interval of at most 5 s whole.
            assert scenario_excitation(scenario, Signal.DISAGREEMENT, window=12.0).mu1 > 0.1
        else:
            assert scenario_excitation(scenario, Signal.DISAGREEMENT).mu1 > 0.1


def test_many_oscillations_between_breakpoints_are_all_searched():
    # sin(3 t) beats against sin(2.9 t): 59 waves in the common period, one of which is the highest.
    weights = EdgeWeights((SineWeight(1.0, 1.0, 3.0), SineWeight(1.0, 1.0, 2.9)), NoSwitching(2))
    found = window_extremes(np.ones((1, 2)), weights, 0.4)
    starts = np.linspace(0.0, 20 * math.pi, 200001)
    sums = weights.integral(starts, starts + 0.4).sum(axis=-1)
    # A smooth extremum is met to the square of half a step, times the curvature of at most 9*0.8.
    assert found.mu2 == pytest.approx(sums.max(), abs=1e-6)
    assert found.mu1 == pytest.approx(sums.min(), abs=1e-6)


def test_the_rate_of_a_function_is_counted():
    assert FunctionWeight(lambda t: 1 + np.sin(7 * t), period=2 * math.pi).carrier.rate == pytest.approx(7.0, abs=1.0)
    assert FunctionWeight(lambda t: 1 / (1 + t**2)).carrier.rate == 0.0

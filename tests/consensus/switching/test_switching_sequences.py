"""Listed and random sequences of graphs: what they promise, checked on the sequences themselves."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid_model.consensus.graphs.undirected import complete_edges
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.switching.random_sequences import (
    Order,
    jointly_connected_sequence,
    markov_sequence,
    random_dwell_sequence,
)
from hybrid_model.consensus.switching.sequence import SwitchingSequence

THREE = ((1, 2), (2, 3), ())
LISTED = SwitchingSequence((0.5, 1.25, 0.25), THREE, 3, repeat=True)
seeds = st.integers(0, 2**63)


class TestListed:
    def test_phases_begin_at_their_instants_and_repeat(self):
        assert [LISTED.phase(t) for t in (0.0, 0.49, 0.5, 1.74, 1.75, 2.0, 2.5)] == [0, 0, 1, 1, 2, 0, 1]
        np.testing.assert_array_equal(LISTED.active_at(3.0), [False, True, True])
        np.testing.assert_array_equal(LISTED.breakpoints(0.0, 4.0), [0.5, 1.75, 2.0, 2.5, 3.75])
        assert LISTED.period == LISTED.duration == 2.0

    def test_without_repetition_the_last_graph_stays_but_nothing_is_promised_there(self):
        once = SwitchingSequence((0.5, 1.25), ((1,), (2,)), 2)
        assert once.phase(99.0) == 1
        assert once.period is None
        assert once.domain == (0.0, 1.75)
        np.testing.assert_array_equal(once.breakpoints(0.0, 99.0), [0.5])

    def test_equal_graphs_are_constant(self):
        assert SwitchingSequence((1.0, 2.0), ((1, 2), (2, 1)), 2).period == 0.0

    @given(dwell=st.floats(0.01, 10.0), count=st.integers(1, 5), t=st.floats(0.0, 300.0))
    @settings(max_examples=100)
    def test_equal_dwells_are_periodic_switching(self, dwell, count, t):
        active = tuple((k + 1,) for k in range(count))
        sequence = SwitchingSequence((dwell,) * count, active, count, repeat=True)
        cyclic = SwitchingCycle(dwell, active, count)
        # The two place their instants by sums and by products, which differ in the last digits.
        if cyclic.breakpoints(t - 1e-9, t + 1e-9).size == 0:
            assert sequence.phase(t) == cyclic.phase(t)

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (((1.0,), ((1,), (2,)), 2), "dwell lists 1 times for 2 graphs; give one for each"),
            (((1.0, -1.0), ((1,), (2,)), 2), r"dwell\[2\] is -1.0; it must be positive"),
            (((), (), 2), "active is empty"),
            (((1.0,), ((3,),), 2), "active phase 1 names edge 3"),
            (((1.0,), ((1, 1),), 2), "each edge may be listed only once"),
        ],
    )
    def test_bad_values_are_named(self, arguments, message):
        with pytest.raises(ValueError, match=message):
            SwitchingSequence(*arguments)


class TestRandomDwell:
    @given(seed=seeds, shortest=st.floats(0.01, 1.0), extra=st.floats(0.0, 2.0), order=st.sampled_from(list(Order)))
    @settings(max_examples=60)
    def test_dwells_lie_between_the_bounds_and_cover_the_duration(self, seed, shortest, extra, order):
        longest = shortest + extra
        made = random_dwell_sequence(
            THREE, 3, shortest=shortest, longest=longest, duration=20.0, seed=seed, order=order
        )
        assert all(shortest <= dwell <= longest * (1 + 1e-15) for dwell in made.dwells)
        assert made.duration >= 20.0 > made.duration - made.dwells[-1] * (1 + 1e-12)
        following = [(THREE.index(a), THREE.index(b)) for a, b in zip(made.active, made.active[1:], strict=False)]
        if order is Order.CYCLIC:
            assert all(b == (a + 1) % 3 for a, b in following)
        else:
            assert all(a != b for a, b in following)

    @given(seed=seeds)
    @settings(max_examples=30)
    def test_a_seed_means_one_sequence_and_repetition_cuts_at_the_duration(self, seed):
        options = {"shortest": 0.3, "longest": 0.9, "duration": 2 * math.pi, "seed": seed}
        made = random_dwell_sequence(THREE, 3, repeat=True, **options)
        assert made == random_dwell_sequence(THREE, 3, repeat=True, **options)
        assert made.period == pytest.approx(2 * math.pi, rel=4e-16)

    def test_the_stream_of_a_seed_does_not_change(self):
        made = random_dwell_sequence(THREE, 3, shortest=0.0 + 0.5, longest=1.5, duration=2.0, seed=42)
        # PCG64 with seed 42 begins with 0.7739560485559633, 0.4388784397520523 (NumPy's documentation).
        np.testing.assert_allclose(made.dwells[:2], [0.5 + 0.7739560485559633, 0.5 + 0.4388784397520523], rtol=1e-15)

    def test_all_dwell_times_are_about_equally_likely(self):
        made = random_dwell_sequence(THREE, 3, shortest=1.0, longest=2.0, duration=6000.0, seed=5)
        counts, _ = np.histogram(made.dwells, bins=10, range=(1.0, 2.0))
        expected = len(made.dwells) / 10
        # Chi squared with 9 degrees of freedom exceeds 30 with a chance of 4e-4; the seed is fixed.
        assert ((counts - expected) ** 2 / expected).sum() < 30

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"shortest": 0.0}, "shortest is 0.0; it must be positive"),
            ({"longest": 0.1}, "longest is 0.1; it must be at least shortest, 0.5"),
            ({"duration": -1.0}, "duration is -1.0; it must be positive"),
            ({"seed": -1}, "seed is -1; it must not be negative"),
            ({"shortest": 1e-9, "longest": 1e-9}, "more than 100000 intervals are drawn"),
        ],
    )
    def test_bad_values_are_named(self, changes, message):
        options = {"shortest": 0.5, "longest": 1.0, "duration": 10.0, "seed": 1} | changes
        with pytest.raises(ValueError, match=message):
            random_dwell_sequence(THREE, 3, **options)


class TestMarkov:
    MATRIX = ((0.2, 0.5, 0.3), (0.6, 0.0, 0.4), (0.25, 0.75, 0.0))

    def test_transitions_are_as_frequent_as_the_matrix_says(self):
        made = markov_sequence(THREE, 3, transition=self.MATRIX, shortest=1.0, longest=1.0, duration=20000.0, seed=1)
        counts = np.zeros((3, 3))
        for a, b in zip(made.active, made.active[1:], strict=False):
            counts[THREE.index(a), THREE.index(b)] += 1
        assert counts[1, 1] == counts[2, 2] == 0
        # Shares of at least 4000 transitions: a standard deviation of at most 0.008.
        np.testing.assert_allclose(counts / counts.sum(axis=1, keepdims=True), self.MATRIX, atol=0.03)

    def test_a_permutation_matrix_is_a_cycle_and_the_first_graph_is_chosen(self):
        made = markov_sequence(
            THREE,
            3,
            transition=((0, 1, 0), (0, 0, 1), (1, 0, 0)),
            shortest=1.0,
            longest=1.0,
            duration=6.0,
            seed=9,
            first=2,
        )
        assert made.active == (THREE[1], THREE[2], THREE[0]) * 2
        assert made.dwells == (1.0,) * 6

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"transition": ((1.0,),)}, "transition lists 1 rows for 3 graphs in active"),
            ({"transition": ((0.5, 0.6, 0.0),) * 3}, r"transition\[1\] is .*; it must hold chances that add up to 1"),
            ({"transition": ((1.5, -0.5, 0.0),) * 3}, r"transition\[1\]"),
            ({"first": 4}, "first is 4; graphs are numbered from 1 to 3"),
        ],
    )
    def test_bad_values_are_named(self, changes, message):
        options = {"transition": self.MATRIX, "shortest": 1.0, "longest": 1.0, "duration": 9.0, "seed": 0} | changes
        with pytest.raises(ValueError, match=message):
            markov_sequence(THREE, 3, **options)


class TestJointlyConnected:
    @given(
        seed=seeds,
        agents=st.integers(2, 7),
        graphs=st.integers(1, 4),
        window=st.floats(0.1, 5.0),
        spare=st.sampled_from([0.0, 0.3, 1.0]),
    )
    @settings(max_examples=80, deadline=None)
    def test_every_window_joins_all_agents(self, seed, agents, graphs, window, spare):
        edges = complete_edges(agents)
        made = jointly_connected_sequence(
            agents, edges, window=window, graphs=graphs, duration=12.0, seed=seed, spare=spare
        )
        ends = np.cumsum(made.dwells)
        np.testing.assert_allclose(
            ends[graphs - 1 :: graphs], window * np.arange(1, len(ends) // graphs + 1), rtol=1e-12
        )
        assert ends[-1] >= 12.0 * (1 - 1e-9)
        assert min(made.dwells) >= 0.5 * window / graphs * (1 - 1e-12)
        for begin in range(0, len(made.active), graphs):
            union = nx.Graph()
            union.add_nodes_from(range(1, agents + 1))
            union.add_edges_from(edges[e - 1] for row in made.active[begin : begin + graphs] for e in row)
            assert nx.is_connected(union)

    def test_no_graph_alone_need_be_connected(self):
        edges = complete_edges(5)
        made = jointly_connected_sequence(5, edges, window=1.0, graphs=4, duration=20.0, seed=3)
        sizes = [len(row) for row in made.active]
        assert max(sizes) < 4 or sum(size < 4 for size in sizes) > 0.9 * len(sizes)
        assert sum(sizes) == 20 * 4  # one spanning tree a window, each edge dealt out once

    def test_the_generator_reaches_every_tree_of_a_triangle(self):
        made = jointly_connected_sequence(3, complete_edges(3), window=1.0, graphs=1, duration=90.0, seed=2)
        assert set(made.active) == {(1, 2), (1, 3), (2, 3)}

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"edges": ((1, 2),)}, "the network's graph is not connected"),
            ({"window": 0.0}, "window is 0.0; it must be positive"),
            ({"graphs": 0}, "graphs is 0; it must be at least 1"),
            ({"spare": 1.5}, "spare is 1.5; it must lie between 0 and 1"),
            ({"duration": 1e9}, "more than 100000 graphs; choose a longer window"),
        ],
    )
    def test_bad_values_are_named(self, changes, message):
        options = {"edges": ((1, 2), (2, 3)), "window": 1.0, "graphs": 2, "duration": 5.0, "seed": 0} | changes
        with pytest.raises(ValueError, match=message):
            jointly_connected_sequence(3, **options)

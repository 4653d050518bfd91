"""Rule 1: hybrid time is (t, j); each jump keeps x- and x+."""

import numpy as np
from small_automata import Corridor, Ramp, Timer

import hybrid_model as hm


def test_j_counts_jumps_and_t_never_decreases():
    arc = hm.simulate(Ramp(), 2.25)
    assert len(arc.jumps) == 4
    assert np.all(np.diff(arc.t) >= 0.0)
    assert set(np.diff(arc.j)) == {0, 1}
    assert arc.j[0] == 0
    assert arc.j[-1] == len(arc.jumps)
    # At each jump there are two samples of one t, with j one apart.
    for jump in arc.jumps:
        at = np.flatnonzero((arc.t == jump.t) & ((arc.j == jump.j) | (arc.j == jump.j + 1)))
        assert len(at) == 2


def test_each_jump_keeps_the_states_of_both_sides():
    arc = hm.simulate(Corridor(back=0.5), 1.2)
    (jump,) = arc.jumps
    assert (arc.before(jump).x, arc.after(jump).x) == (jump.x_before[0], jump.x_after[0])
    np.testing.assert_allclose([jump.x_before[0], jump.x_after[0]], [1.0, 0.5], atol=1e-12)
    # The samples hold both sides as well, in this order.
    at = np.flatnonzero(arc.t == jump.t)
    np.testing.assert_array_equal(arc["x"][at], [jump.x_before[0], jump.x_after[0]])


def test_a_cascade_has_one_t_and_successive_j():
    class Cascade(hm.HybridAutomaton):
        n = hm.DiscreteState(3, integer=True)

        def jump_set(self, s):
            return s.n - 0.5

        def jump_map(self, s):
            return {"n": s.n - 1}

    arc = hm.simulate(Cascade(), 1.0)
    assert [(jump.t, jump.j) for jump in arc.jumps] == [(0.0, 0), (0.0, 1), (0.0, 2)]
    np.testing.assert_array_equal(arc["n"][:4], [3, 2, 1, 0])


def test_hybrid_time_starts_at_t_start():
    arc = hm.simulate(Timer(first=-1.0, period=2.0), 0.0, t_start=-3.5)
    assert arc.t[0] == -3.5
    assert arc.t[-1] == 0.0
    assert [jump.t for jump in arc.jumps] == [-1.0]

"""Every model of the repository can be told, and models that share a key trace to the same expressions."""

import itertools

import pytest
from catalogue import cases

from hybrid_model.native.free_values.snapshots import snapshot, why_untold
from hybrid_model.native.trace import trace


@pytest.fixture(scope="module")
def keys():
    found = {}
    for name, case in cases().items():
        taken = snapshot(case.automaton)
        assert taken is not None, f"{name}: {why_untold(case.automaton)}"
        assert taken.still_holds(), name
        found.setdefault(taken.key, []).append(case.automaton)
    return found


def test_models_that_share_a_key_trace_to_the_same(keys):
    shared = [alike for alike in keys.values() if len(alike) > 1]
    assert shared, "no two models of the catalogue share a key: the test compares nothing"
    for alike in shared:
        traces = [[function.serialize() for function in trace(automaton).functions] for automaton in alike]
        assert all(one == other for one, other in itertools.pairwise(traces))


def test_tracing_changes_nothing_that_is_read():
    for name in ("bouncing_ball", "resting_ball", "two_tank", "integrator", "agent2_dynamic"):
        automaton = cases()[name].automaton
        then = snapshot(automaton)
        trace(automaton)
        assert then.still_holds(), name

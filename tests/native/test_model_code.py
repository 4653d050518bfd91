"""The C of a model: of a jump map, what it changes."""

import numpy as np

import hybrid_model as hm
from hybrid_model.native.kept_models import traced_maps
from hybrid_model.native.model_code import run_code


class Moves(hm.HybridAutomaton):
    """Counts seconds in one of many places; the others, and x, stay as they were."""

    x = hm.State(2.0, shape=3)
    counts = hm.DiscreteState(1.0, shape=4)
    due = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"x": 0.0 * s.x}

    def count(self, s):
        return {"counts": s.counts + np.array([0.0, 0.0, 1.0, 0.0]), "due": s.due + 1.0}

    transitions = (hm.TimeEvent("second", lambda self, s: s.due, count),)


def test_jump_maps_write_the_states_that_they_change():
    assert "reset_places[] = {\n    2,\n    4\n};" in run_code(traced_maps(Moves()))
    arc = hm.simulate(Moves(), 2.5, engine="native")
    np.testing.assert_array_equal(arc["counts"][-1], [1.0, 1.0, 3.0, 1.0])
    np.testing.assert_array_equal(arc["x"][-1], [2.0, 2.0, 2.0])
    assert arc["due"][-1] == 3.0

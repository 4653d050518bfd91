"""An automaton with other start values as its own: the same as one that was made with them."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.declare.wrapper import with_starts
from hybrid_model.errors import DeclarationError


class Decays(hm.HybridAutomaton):
    rate = hm.Parameter(1.0)
    x = hm.State([1.0, 2.0], output=True)
    first = hm.State(0.0, computed=True)
    y = hm.Output()

    def start_map(self, s):
        return {"first": s.x[1]}

    def flow_map(self, s):
        return {"x": -s.rate * s.x, "first": 0.0}

    def outputs(self, s):
        return {"y": 2.0 * s.first}


def test_it_runs_like_one_that_was_made_with_them():
    other = with_starts(Decays(), {"x[2]": 5.0, "rate": 0.5})
    found, expected = hm.simulate(other, 1.0), hm.simulate(Decays(x=[1.0, 5.0], rate=0.5), 1.0)
    for name in ("x[1]", "x[2]", "first", "y"):
        np.testing.assert_array_equal(found[name], expected[name])
    assert hm.simulate(Decays(), 1.0)["first"][0] == 2.0


@pytest.mark.parametrize(
    ("name", "said"), [("first", "Decays.first is computed"), ("y", "Decays.y is computed"), ("z", "nothing named 'z'")]
)
def test_what_cannot_be_given_is_refused(name, said):
    with pytest.raises(DeclarationError, match=said):
        with_starts(Decays(), {name: 1.0})

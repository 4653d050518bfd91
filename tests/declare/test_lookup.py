"""Tables looked up by a discrete state: on floats, on arrays, and traced into both engines and FMUs."""

import numpy as np
import pytest

import hybrid_model as hm

TABLE = [1.0, 2.0, 4.0]


class Stairs(hm.HybridAutomaton):
    """Climbs with the speed of the stair it is on; each stair is 1 high."""

    speeds = hm.Parameter(TABLE, unit="1/s")
    stair = hm.DiscreteState(0, integer=True)
    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": hm.lookup(s.speeds, s.stair)}

    def jump_set(self, s):
        return s.x - (s.stair + 1)

    def jump_map(self, s):
        return {"stair": s.stair + 1}


@pytest.mark.parametrize(("index", "entry"), [(0, 1.0), (1.0, 2.0), (np.float64(2.0), 4.0), (-3, 1.0), (17, 4.0)])
def test_an_entry_is_found_and_ends_are_held(index, entry):
    assert hm.lookup(TABLE, index) == entry


def test_infinite_entries_stay_what_they_are():
    assert hm.lookup([0.5, np.inf], 0) == 0.5
    assert hm.lookup([0.5, np.inf], 1) == np.inf


def test_rows_of_a_table():
    np.testing.assert_array_equal(hm.lookup([[1.0, 2.0], [3.0, 4.0]], 1), [3.0, 4.0])


@pytest.mark.parametrize("table", [[], 3.0, np.zeros((2, 2, 2))])
def test_what_is_no_table_is_refused(table):
    with pytest.raises(hm.DeclarationError, match="cannot be looked up: give a list of entries, or of rows"):
        hm.lookup(table, 0)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_run_looks_its_rate_up(engine):
    """The last speed holds on the stairs beyond the table: 1 s, 1/2 s, 1/4 s, 1/4 s, ..."""
    arc = hm.simulate(Stairs(), 2.1, engine=engine)
    np.testing.assert_allclose(arc.event_times("jump"), [1.0, 1.5, 1.75, 2.0], rtol=0, atol=1e-12)
    assert arc.at("x", 2.1) == pytest.approx(4.4, abs=1e-12)

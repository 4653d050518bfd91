"""`simulate(..., starts=...)`: one automaton, run from other values than the declared ones."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus import closed_loop, load_scenario
from hybrid_model.models import BouncingBall


class Filter(hm.HybridAutomaton):
    """``x' = a (u - x)`` with a gain that a run cannot change, a vector state, and a state computed at the start."""

    gain = hm.Parameter(1.0, minimum=0.0)
    order = hm.Parameter(1, integer=True)
    u = hm.Input(0.0)
    x = hm.State([1.0, 2.0])
    begun = hm.DiscreteState(computed=True)
    y = hm.Output(shape=(2,))

    def start_map(self, s):
        return {"begun": 2 * s.x[0]}

    def flow_map(self, s):
        return {"x": s.gain * (s.u - s.x)}

    def outputs(self, s):
        return {"y": s.gain * s.x}


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_run_from_other_values_is_the_run_of_an_automaton_made_with_them(engine):
    declared, starts = BouncingBall(), {"h": 2.5, "v": -1.0, "e": 0.6}
    arc, again = (
        hm.simulate(declared, 2.0, starts=starts, engine=engine),
        hm.simulate(BouncingBall(**starts), 2.0, engine=engine),
    )
    assert len(arc.jumps) == 2
    for name in ("h", "v", "e"):
        assert np.array_equal(arc[name], again[name])
    # And the next run is from the declared values again.
    assert hm.simulate(declared, 0.1, engine=engine)["h"][0] == BouncingBall().variables[0].start


@pytest.mark.parametrize("engine", ["native", "python"])
def test_states_inputs_parameters_and_what_is_computed_from_them(engine):
    arc = hm.simulate(Filter(), 1.0, starts={"x": [3.0, 0.0], "gain": 2.0, "u": 1.0}, engine=engine)
    expected = 1.0 + np.array([2.0, -1.0]) * np.exp(-2.0)
    # The solver's relative tolerance is 1e-13.
    assert arc["x"][-1] == pytest.approx(expected, rel=1e-11)
    assert arc["y"][-1] == pytest.approx(2.0 * expected, rel=1e-11)
    assert arc["begun"][0] == 6.0
    # What is given as an input goes before its start value.
    held = hm.simulate(Filter(), 1.0, starts={"u": 1.0}, inputs={"u": 0.0}, engine=engine)
    assert held["x"][-1] == pytest.approx(np.array([1.0, 2.0]) * np.exp(-1.0), rel=1e-11)


def test_compositions_are_compiled_once_for_many_values():
    scenario = load_scenario("paper-a")
    loop = closed_loop(scenario)
    starts = {f"agent{i}.threshold": 0.3 for i in range(1, 5)} | {"agent2.x": 1.5}
    arc = hm.simulate(loop, 5.0, starts=starts, engine="native")
    assert arc.at("agent2.x", 0.0) == 1.5
    assert arc["agent3.threshold"][-1] == 0.3
    assert arc.engine == "native: its maps are compiled."


@pytest.mark.parametrize(
    ("starts", "error", "message"),
    [
        ({"z": 1.0}, hm.DeclarationError, "starts: Filter has no variable 'z'; it has x, begun, gain, order, u"),
        ({"y": 1.0}, hm.DeclarationError, "starts: Filter has no variable 'y'"),
        ({"begun": 1.0}, hm.DeclarationError, "Filter.begun is computed at the start"),
        ({"gain": -1.0}, hm.DeclarationError, "start value of gain is set to -1.0, outside its range from 0 to inf"),
        ({"order": 1.5}, hm.DeclarationError, "it holds whole numbers"),
        ({"x": [1.0, 2.0, 3.0]}, hm.DeclarationError, "of shape .3,.: give one number for all elements"),
        ({"gain": float("nan")}, hm.DeclarationError, "start value of gain"),
        ([1.0], hm.SimulationError, "starts = .1.0. is no mapping"),
    ],
)
def test_values_that_cannot_be_are_refused(starts, error, message):
    with pytest.raises(error, match=message):
        hm.simulate(Filter(), 1.0, starts=starts)

"""Errors of one part among many of its class name the part, in all executions."""

import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.masters import run_event_exact
from cosim.system import System

WIRES = {"b.heard": "a.sent", "a.heard": "b.sent"}


class Diverges(hm.HybridAutomaton):
    """Its count becomes infinite at the first jump, where `wrong` is set."""

    x = hm.State(0.0)
    sent = hm.DiscreteState(0.0, output=True)
    heard = hm.Input(0.0)
    wrong = hm.Parameter(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return s.x - 0.5

    def jump_map(self, s):
        return {"x": 0.0, "sent": s.sent + 1.0 / (1.0 - s.wrong)}


def parts():
    return {"a": Diverges(), "b": Diverges(wrong=1.0)}


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize("engine", ["python", "auto"])
def test_an_error_of_a_network_names_the_part(engine):
    with pytest.raises(hm.SimulationError, match=r"\bb: .*sent = inf after jump 'jump' at t = 0\.5 s"):
        hm.simulate_network(hm.Composition("pair", parts(), WIRES), 2.0, engine=engine)


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize("engine", ["python", "auto"])
def test_an_error_of_a_slave_names_it(engine):
    slaves = [AutomatonSlave(name, part, engine=engine) for name, part in parts().items()]
    with pytest.raises(hm.SimulationError, match=r"^b: Diverges: .*sent = inf after jump 'jump' at t = 0\.5 s"):
        run_event_exact(System(slaves, WIRES), 2.0)

"""Errors of one part among many of its class name the part, in all executions."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import MisfitError
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


class Roots(hm.HybridAutomaton):
    """Tells the root of a number, which is below zero from t = 0.5 s on."""

    x = hm.State(0.0)
    number = hm.DiscreteState(0.5)
    told = hm.Output(discrete=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def outputs(self, s):
        return {"told": np.sqrt(s.number)}

    transitions = (hm.Jump("sink", lambda self, s: s.x - s.number, lambda self, s: {"number": -1.0, "x": -9.0}),)


class Listens(hm.HybridAutomaton):
    """Makes nothing of what it hears."""

    x = hm.State(0.0, output=True)
    other = hm.Input(0.0, discrete=True)
    heard = hm.Input(0.0, discrete=True)

    def flow_map(self, s):
        return {"x": 1.0}


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("engine", ["python", "auto"])
def test_a_value_that_is_not_finite_is_refused_by_the_input_that_it_is_sent_to(engine):
    slaves = [AutomatonSlave("a", Roots(), engine=engine), AutomatonSlave("b", Listens(), engine=engine)]
    with pytest.raises(MisfitError, match=r"^b\.heard is set to nan: set a finite number\.$"):
        run_event_exact(System(slaves, {"b.heard": "a.told"}), 2.0)

"""Traced maps in Python runs: the same automaton, the same run."""

import numpy as np
import pytest
from catalogue import cases
from executions import reference, step_inputs

import hybrid_model as hm
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import TraceError
from hybrid_model.native.compiled import compiled


@pytest.mark.parametrize("name", list(cases()))
def test_every_model_runs_alike(name):
    case = cases()[name]
    plain, fast = reference(name), hm.simulate(compiled(case.automaton), case.t_end, inputs=step_inputs(case))
    assert [(jump.name, jump.j) for jump in fast.jumps] == [(jump.name, jump.j) for jump in plain.jumps]
    # The same operations in another order: rounding, magnified by what lies between two jumps.
    np.testing.assert_allclose([jump.t for jump in fast.jumps], [jump.t for jump in plain.jumps], rtol=0, atol=1e-9)
    assert fast.stop is plain.stop
    for variable in case.automaton.of_kind(Kind.STATE, Kind.DISCRETE, Kind.OUTPUT):
        np.testing.assert_allclose(
            fast.end[variable.name] if variable.kind is not Kind.OUTPUT else fast.at(variable.name, fast.t[-1]),
            plain.at(variable.name, plain.t[-1]),
            atol=1e-9,
        )


def test_inputs_that_vary_and_a_copy_of_the_run():
    """A driven integrator: x' = u(t) with u a sine and then a step; x in closed form."""

    class Integrator(hm.HybridAutomaton):
        x = hm.State(0.0)
        u = hm.Input(0.0)

        def flow_map(self, s):
            return {"x": s.u}

        def jump_set(self, s):
            return s.x - 1.5

        def jump_map(self, s):
            return {"x": 0.0}

    signal = hm.Signal(lambda t: np.sin(t) if t < np.pi else 1.0, [np.pi])
    arc = hm.simulate(compiled(Integrator()), 5.0, inputs={"u": signal})
    first = np.arccos(-0.5)
    # x(pi) = 0.5 after the jump, then slope one.
    assert [jump.t for jump in arc.jumps] == pytest.approx([first, np.pi + 1.0], abs=1e-11)
    assert arc.at("x", 4.5) == pytest.approx(4.5 - np.pi - 1.0, abs=1e-11)


def test_two_runs_of_one_compiled_automaton_do_not_meet():
    automaton = compiled(cases()["thermostat"].automaton)
    one, two = hm.Execution(automaton), hm.Execution(automaton)
    two.x = two.x + 0.5
    one.flow(1.0)
    alone = hm.Execution(automaton)
    alone.flow(1.0)
    assert one.x == alone.x


def test_an_automaton_that_cannot_be_traced_is_refused():
    class Branching(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0 if s.x > 0 else -1.0}

    with pytest.raises(TraceError, match=r"np\.where"):
        compiled(Branching())

"""What an automaton may not do when it is to become an FMU, and the sentence that says so."""

import math

import numpy as np
import pytest

import hybrid_model as hm
from fmu.errors import TraceError
from fmu.trace import trace
from hybrid_model.layout import Layout
from hybrid_model.models import BouncingBall


def automaton(**maps):
    return type("Block", (hm.HybridAutomaton,), {"x": hm.State(1.0), "k": hm.DiscreteState(0), **maps})()


FLOW = {"flow_map": lambda self, s: {"x": -s.x}}


def time_event(time, reset, *, internal=False):
    return {**FLOW, "transitions": (hm.TimeEvent("tick", time, reset, internal=internal),)}


@pytest.mark.parametrize(
    ("maps", "sentence"),
    [
        ({"flow_map": lambda self, s: {"x": 1.0 if s.x > 0 else 0.0}}, r"flow_map of Block .*np\.where"),
        ({"flow_map": lambda self, s: {"x": math.sin(s.x)}}, r"flow_map of Block .*np\.sin"),
        (
            {"flow_map": lambda self, s: {"x": np.array([s.x, s.x])}},
            r"computed for x has shape \(2,\), but x has shape \(\)",
        ),
        (time_event(lambda self, s: s.x, lambda self, s: {"k": s.k + 1}), "depends on the time, a continuous state"),
        (time_event(lambda self, s: s.t + 1, lambda self, s: {"k": s.k + 1}), "depends on the time"),
        (
            time_event(lambda self, s: s.k + 1, lambda self, s: {"k": s.k + 1, "x": 0.0}, internal=True),
            "internal event 'tick' uses or changes a continuous state",
        ),
    ],
)
def test_maps_that_cannot_be_traced_are_refused(maps, sentence):
    with pytest.raises(TraceError, match=sentence):
        trace(automaton(**maps))


def test_vector_margins_are_refused():
    block = automaton(**FLOW, jump_set=lambda self, s: np.stack([s.x, -s.x]), jump_map=lambda self, s: {"x": 0.0})
    with pytest.raises(hm.DeclarationError, match=r"join the elements with np\.min"):
        trace(block)


def test_trace_and_python_give_the_same_numbers():
    ball = BouncingBall()
    traced, layout = trace(ball), Layout(ball)
    rng = np.random.default_rng(1)
    for _ in range(100):
        t, x = rng.normal(), rng.normal(size=2)
        s = layout.values(t, x, np.zeros(0), np.zeros(0), np.array([9.81, 0.7]))
        arguments = (t, x, [], [], [9.81, 0.7])
        flow = ball.derivatives(s)
        assert np.ravel(traced.flow(*arguments)).tolist() == [flow["h"], flow["v"]]
        assert float(traced.margins(*arguments)) == ball.jump_margins(s)[0]
        assert float(traced.flow_set(*arguments)) == ball.flow_margin(s)


def test_dependencies_are_those_of_the_expressions():
    traced = trace(BouncingBall())
    np.testing.assert_array_equal(traced.pattern("flow", "x").toarray(), [[False, True], [False, False]])
    np.testing.assert_array_equal(traced.pattern("flow", "p").toarray(), [[False, False], [True, False]])


@pytest.mark.parametrize("function", [np.argmax, np.sort, lambda x: np.interp(x[0], [0.0, 1.0], [1.0, 2.0])])
def test_functions_that_need_numbers_are_refused_with_a_remedy(function):
    class Sorting(hm.HybridAutomaton):
        x = hm.State([1.0, 2.0])

        def flow_map(self, s):
            return {"x": -s.x * function(s.x)}

    with pytest.raises(TraceError, match=r"flow_map of Sorting cannot be traced.*Remedy: .*np\.where"):
        trace(Sorting())

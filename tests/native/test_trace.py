"""What an automaton may not do when it is to become an FMU, and the sentence that says so."""

import itertools
import math
import time

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.declare.layout import Layout
from hybrid_model.errors import TraceError
from hybrid_model.models import BouncingBall
from hybrid_model.native.trace import trace


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


@pytest.mark.parametrize("function", [np.argmax, np.sort, lambda x: np.interp(0.5, x, [1.0, 2.0])])
def test_functions_that_need_numbers_are_refused_with_a_remedy(function):
    class Sorting(hm.HybridAutomaton):
        x = hm.State([1.0, 2.0])

        def flow_map(self, s):
            return {"x": -s.x * function(s.x)}

    with pytest.raises(TraceError, match=r"flow_map of Sorting cannot be traced.*Remedy: .*np\.where"):
        trace(Sorting())


@pytest.mark.parametrize("draw", [itertools.count().__next__, np.random.default_rng(2).random, time.perf_counter_ns])
@pytest.mark.parametrize(
    ("name", "body", "what"),
    [
        ("flow_map", lambda s, one: {"h": s.v, "v": -s.g * one}, "flow_map"),
        ("flow_set", lambda s, one: s.h + one, "flow_set"),
        ("jump_set", lambda s, one: -s.h - one, "a jump set"),
        ("jump_map", lambda s, one: {"v": one}, "the jump map of 'jump'"),
        ("outputs", lambda s, one: {"y": s.h * one}, "outputs"),
        ("start_map", lambda s, one: {"n": one}, "start_map"),
    ],
)
def test_what_changes_from_call_to_call_is_not_frozen(draw, name, body, what):
    declared = {"outputs": {"y": hm.Output()}, "start_map": {"n": hm.DiscreteState(computed=True)}}.get(name, {})
    wrong = type("Wrong", (BouncingBall,), {**declared, name: lambda self, s: body(s, draw())})
    with pytest.raises(TraceError, match=f"^{what} of Wrong is another one when it is called again: .*np.random"):
        trace(wrong())


def test_random_numbers_drawn_beforehand_are_parameters():
    class Noisy(BouncingBall):
        kicks = hm.Parameter(np.random.default_rng(1).random(3))

        def jump_map(self, s):
            return {"h": 0.0, "v": -s.e * s.v + s.kicks[0]}

    assert trace(Noisy()).resets[0](0.0, [0.0, -1.0], [], [], [9.81, 0.7, 0.25, 0.0, 0.0])[0][1] == 0.7 + 0.25


@pytest.mark.parametrize("value", ["1", None, 1j, {}, 10**400, object()])
@pytest.mark.parametrize("name", ["flow_map", "jump_map"])
def test_what_is_no_number_is_refused_in_symbols_too(name, value):
    wrong = type("Wrong", (BouncingBall,), {name: lambda self, s: {"h": value, "v": -s.g}})
    with pytest.raises(TraceError, match=r"^Wrong: the value computed for h is .*: return one number\.$"):
        trace(wrong())

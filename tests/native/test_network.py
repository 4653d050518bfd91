"""Which compositions become loops over tables, which parts share a function, and what is refused."""

from dataclasses import dataclass

import networkx as nx
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.errors import TraceError
from hybrid_model.models import BouncingBall
from hybrid_model.native.networks.members import NotLoopable
from hybrid_model.native.networks.network import NetworkTrace, network_trace, trace_any, worth_looping
from hybrid_model.native.trace import Trace


class Part(hm.HybridAutomaton):
    """Looks at an attribute of the instance."""

    x = hm.State(1.0, output=True)
    u = hm.Input(0.0)

    def __init__(self, name, setting=None, **values):
        super().__init__(name, **values)
        self.setting = setting
        self.unused = name

    def flow_map(self, s):
        return {"x": self.rate() * s.u - s.x}

    def rate(self):
        return 1.7


class ByNumber(Part):
    def rate(self):
        return self.setting


class ByLength(Part):
    def rate(self):
        return 1.5 if self.setting > 2 else np.sqrt(self.setting)


class ByName(Part):
    def rate(self):
        return len(self.name)


class ByStart(Part):
    def rate(self):
        return float(next(v for v in self.variables if v.name == "x").start)


class ByEverything(Part):
    def rate(self):
        return len(vars(self)["unused"]) + 0.5


class ByCall(Part):
    def rate(self):
        return self.setting()


class ByArray(Part):
    def rate(self):
        return np.sum(self.setting)


@dataclass(frozen=True)
class Settings:
    rate: float
    shape: tuple[int, ...] = (1, 2)


class BySettings(Part):
    def rate(self):
        return self.setting.rate * self.setting.shape[1]


def ring(parts):
    names = list(parts)
    wires = {f"{b}.u": f"{a}.x" for a, b in zip(names, [*names[1:], names[0]], strict=True)}
    return hm.Composition("ring", parts, wires)


def traced_parts(parts):
    return network_trace(ring({part.name: part for part in parts}))


def rates(traced):
    """The factors of u in the parts' rates, by way of the functions and constants that stand for each part."""
    found = {}
    for group in traced.groups:
        for row, number in zip(group.constants, group.members, strict=True):
            found[number] = float(group.maps["flow"](0.0, 0.0, [], 1.0, [], row)[0])
    return [found[number] for number in range(len(found))]


@pytest.mark.parametrize(
    ("cls", "settings", "expected"),
    [
        (Part, [1, 2, 3], [1.7, 1.7, 1.7]),
        (ByNumber, [0.3, 0.3, 0.4, -7.0], [0.3, 0.3, 0.4, -7.0]),
        (ByLength, [3, 2, 5, 2], [1.5, np.sqrt(2), 1.5, np.sqrt(2)]),
        (ByCall, [lambda: 0.3, lambda: 0.6], [0.3, 0.6]),
        (ByArray, [np.array([0.1, 0.3]), np.array([0.1, 0.3]), np.array([0.1, 0.4])], [0.4, 0.4, 0.5]),
        (BySettings, [Settings(0.3), Settings(0.3), Settings(0.3, (1, 3))], [0.6, 0.6, 0.9]),
    ],
)
def test_attributes_that_maps_look_at(cls, settings, expected):
    traced = traced_parts([cls(f"p{k}", setting) for k, setting in enumerate(settings)])
    np.testing.assert_allclose(rates(traced), expected, rtol=1e-15)
    assert len(traced.groups) == 1


def test_names_and_start_values_that_maps_look_at():
    np.testing.assert_array_equal(rates(traced_parts([ByName("abc"), ByName("abd"), ByName("abcde")])), [3, 3, 5])
    np.testing.assert_array_equal(
        rates(traced_parts([ByStart("a", x=3.0), ByStart("b", x=5.0), ByStart("c", x=3.0)])), [3, 5, 3]
    )
    np.testing.assert_array_equal(rates(traced_parts([ByEverything("a"), ByEverything("abcd")])), [1.5, 4.5])


def test_watching_leaves_the_parts_as_they_were():
    parts = [ByNumber("a", 0.3), ByNumber("b", 0.3)]
    traced_parts(parts)
    assert [type(part) for part in parts] == [ByNumber, ByNumber]
    assert {type(variable).__name__ for part in parts for variable in part.variables} == {"Variable"}
    broken = [ByCall("a", lambda: 1 / 0), ByCall("b", lambda: 0.0)]
    with pytest.raises(ZeroDivisionError):
        traced_parts(broken)
    assert [type(part) for part in broken] == [ByCall, ByCall]


def traces_of(parts, cls, monkeypatch):
    """How many parts of a class are traced in a network; each is, twice, to see that it gives the same again."""
    composition = ring({part.name: part for part in parts})
    count = 0
    original = cls.flow_map

    def counting(self, s):
        nonlocal count
        count += 1
        return original(self, s)

    with monkeypatch.context() as patch:
        patch.setattr(cls, "flow_map", counting)
        network_trace(composition)
    return count / 2


def test_a_part_that_changes_from_call_to_call_is_found_in_a_network():
    class Noisy(Part):
        def rate(self):
            return np.random.default_rng().random()

    with pytest.raises(TraceError, match=r"^flow_map of p0 is another one when it is called again"):
        network_trace(ring({f"p{k}": Noisy(f"p{k}") for k in range(3)}))


def test_equal_parts_are_traced_once(monkeypatch):
    assert traces_of([Part(f"p{k}", k) for k in range(20)], Part, monkeypatch) == 1
    assert traces_of([ByNumber(f"p{k}", 0.1 * (k % 3)) for k in range(20)], ByNumber, monkeypatch) == 3
    assert traces_of([ByName(f"p{k}") for k in range(20)], ByName, monkeypatch) == 20


def test_constants_that_leave_other_expressions_make_other_groups():
    """A factor of 1 is no factor, so that part cannot share the function of the others."""
    traced = traced_parts([ByNumber("a", 0.5), ByNumber("b", 0.25), ByNumber("c", 1.0)])
    assert rates(traced) == [0.5, 0.25, 1.0]
    assert [group.members for group in traced.groups] == [(0, 1), (2,)]
    assert [group.constants.tolist() for group in traced.groups] == [[[0.5], [0.25]], [[]]]


def consensus(agents, degree=4):
    graph = nx.random_regular_graph(degree, agents, seed=3)
    edges = [[a + 1, b + 1] for a, b in graph.edges]
    rng = np.random.default_rng(3)
    return closed_loop(
        read_scenario(
            {
                "name": "network",
                "stop_time": 1.0,
                "network": {"agents": agents, "edges": edges, "initial": rng.uniform(-1, 1, agents).tolist()},
                "weights": {"kind": "constant", "value": rng.uniform(0.1, 1.0, len(edges)).tolist()},
                "trigger": {"kind": "dynamic", "threshold": 0.1, "decay": 0.1},
            }
        )
    )


def test_what_is_worth_a_loop():
    assert worth_looping(consensus(20))
    assert not worth_looping(consensus(8))
    assert not worth_looping(BouncingBall())
    many = {f"p{k}": Part(f"p{k}") for k in range(14)}
    assert worth_looping(ring(many))
    # Parts of fourteen kinds: a loop over each would be no shorter than the parts.
    unlike = {f"p{k}": type(f"Part{k}", (Part,), {})(f"p{k}") for k in range(14)}
    assert not worth_looping(ring(unlike))
    # A network in a network counts by its parts.
    assert worth_looping(hm.Composition("plant and network", {"ball": BouncingBall(), "network": ring(many)}))

    class Own(hm.Composition):
        def derivatives(self, s):
            return {name: 2 * rate for name, rate in super().derivatives(s).items()}

    assert not worth_looping(Own("own", many))
    with pytest.raises(NotLoopable, match="own does not evaluate its maps"):
        network_trace(Own("own", many))


def test_trace_any_takes_the_better_form():
    assert isinstance(trace_any(consensus(20)), NetworkTrace)
    assert isinstance(trace_any(consensus(6)), Trace)


def test_a_consensus_network_is_one_group_and_sparse():
    """Constant weights: the rate of an agent depends on its own state's sample, its neighbours' samples and weights."""
    composition = consensus(30)
    traced = network_trace(composition)
    assert len(traced.groups) == 1
    assert traced.order.calls == ()
    pattern = traced.pattern("flow", "z").toarray()
    names = traced.layout.names(hm.declare.variables.Kind.DISCRETE)
    wires = {f"agent{k}": {f"agent{k}.broadcast"} for k in range(1, 31)}
    for wire in composition.wires:
        wires[wire.target].add(f"{wire.source}.broadcast")
    for k in range(30):
        assert {names[i] for i in np.flatnonzero(pattern[k])} == wires[f"agent{k + 1}"]
    assert traced.pattern("flow", "x").nnz == 0
    assert traced.pattern("flow", "p").shape == (30, 7 * 30)


class Waits(hm.HybridAutomaton):
    """A time event at a time that arrives over a wire."""

    when = hm.Input(1.0, discrete=True)
    done = hm.DiscreteState(0, integer=True)
    x = hm.State(0.0, output=True)
    k = hm.DiscreteState(2.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def fires(self, s):
        return s.when + s.done

    def fire(self, s):
        return {"done": s.done + 1}

    transitions = (hm.TimeEvent("fire", fires, fire),)


class Sums(hm.HybridAutomaton):
    a = hm.Input(0.0)
    y = hm.Output(discrete=True)

    def outputs(self, s):
        return {"y": 2.0 * s.a}


def test_times_over_wires():
    """A time may come from another part's discrete state, also through outputs; not from states, inputs or the time."""
    parts = {"one": Waits(), "two": Waits(), "sums": Sums()}
    first = {"one.when": "two.k", "sums.a": "one.k", "two.when": "sums.y"}
    traced = network_trace(hm.Composition("waiting", parts, first))
    assert traced.pattern("times", "z").toarray().tolist() == [
        [True, False, False, True],
        [False, True, True, False],
    ]
    with pytest.raises(TraceError, match=r"waiting: an event of two \(fire\) depends, by its inputs"):
        network_trace(hm.Composition("waiting", parts, {**first, "sums.a": "one.x"}))
    with pytest.raises(TraceError, match=r"waiting: an event of two \(fire\) depends, by its inputs"):
        network_trace(hm.Composition("waiting", parts, {key: first[key] for key in ("one.when", "sums.a")}))


def test_the_part_says_what_its_own_event_does_wrong():
    class Late(Waits):
        transitions = (hm.TimeEvent("fire", lambda self, s: s.t + 1.0, Waits.fire),)

    class Hidden(Waits):
        transitions = (hm.TimeEvent("fire", lambda self, s: s.k, lambda self, s: {"x": 0.0}, internal=True),)

    for part, sentence in ((Late(), "Late: the time of an event"), (Hidden(), "Hidden: the internal event 'fire'")):
        with pytest.raises(TraceError, match=sentence):
            network_trace(hm.Composition("waiting", {"sums": Sums(), "part": part}))


def test_start_values_across_the_border_of_a_nested_network():
    """A nested composition reads its inputs before its parts start, so a loop over all parts would start otherwise."""

    class Starts(Part):
        z = hm.DiscreteState(0.0, computed=True, output=True)

        def start_map(self, s):
            return {"z": s.u + 1.0}

    inner = hm.Composition("inner", {f"p{k}": Starts(f"p{k}") for k in range(14)})
    outer = hm.Composition("outer", {"inner": inner, "end": Part("end")}, {"inner.p3.u": "inner.p1.z"})
    with pytest.raises(NotLoopable, match=r"Start values depend, in inner\.p3"):
        network_trace(outer)
    assert isinstance(trace_any(outer), Trace)

    # Also by way of an output inside.
    inner = hm.Composition(
        "inner", {f"p{k}": Starts(f"p{k}") for k in range(14)} | {"sums": Sums()}, {"p4.u": "sums.y"}
    )
    outer = hm.Composition("outer", {"inner": inner, "end": Part("end")}, {"inner.sums.a": "inner.p1.z"})
    with pytest.raises(NotLoopable, match=r"Start values depend, in inner\.sums"):
        network_trace(outer)


def test_a_network_of_next_to_nothing():
    """Parts without states, inputs, outputs or jumps have no maps to call."""
    Still = type("Still", (hm.HybridAutomaton,), {"p": hm.Parameter(1.0)})
    traced = network_trace(hm.Composition("still", {"a": Still("a"), "b": Still("b")}))
    assert [len(group.members) for group in traced.groups] == [2]
    assert traced.definitions().work[:2] == (10, 5)
    assert traced.pattern("flow", "p").shape == (0, 2)
    assert "hybrid_reset" in traced.definitions().text

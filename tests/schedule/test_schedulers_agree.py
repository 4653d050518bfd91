"""The scheduler in C and the one in Python: the same events in the same order, and the same states."""

import time

import numpy as np
import pytest
from drawing import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenarios import FURTHER, KNOWN_AHEAD, TRIGGERS, random_scenario

import hybrid_model as hm
from hybrid_model import consensus

CHANNELS = {
    "ideal": None,
    "delay": {"delay": 0.07, "slots": 64},
    "loss": {"delay": 0.03, "loss": 0.3, "seed": 5, "slots": 64},
}
KINDS = sorted(set(TRIGGERS) - {"continuous"})
"""Agents that see each other's states all the time are no network of parts."""
DRAWN = {
    "seed": st.integers(0, 10**6),
    "trigger": st.sampled_from(KINDS),
    "channel": st.sampled_from(sorted(CHANNELS)),
    "weights": st.sampled_from(sorted({*KNOWN_AHEAD, *FURTHER})),
}
"""Graph, switching and numbers come with the seed."""


def happened(run):
    return [(part, jump.name) for part, jump in run.jumps]


def assert_alike(network, t_end, **options):
    """Events the same, times within 1e-8 s and states within 1e-9, at all jumps and between them."""
    native, plain = (hm.simulate_network(network, t_end, engine=engine, **options) for engine in ("native", "python"))
    assert native.stop is plain.stop
    assert happened(native) == happened(plain)
    times = [[jump.t for _, jump in run.jumps] for run in (native, plain)]
    np.testing.assert_allclose(*times, rtol=0.0, atol=1e-8)
    for part, arc in plain.arcs.items():
        other = native.arcs[part]
        for one, two in zip(other.jumps, arc.jumps, strict=True):
            # Rates are of the order of one, so a time within 1e-8 s may move a state as far.
            np.testing.assert_allclose(one.x_after, two.x_after, rtol=0.0, atol=1e-8)
            np.testing.assert_allclose(one.z_after, two.z_after, rtol=0.0, atol=1e-8)
        jumps = np.array([jump.t for jump in arc.jumps])
        grid = np.linspace(0.0, t_end, 41)
        apart = grid if not len(jumps) else grid[np.abs(grid[:, None] - jumps).min(axis=1) > 1e-6]
        apart = apart[apart <= plain.t]
        for name in ("x", "neighbours"):
            np.testing.assert_allclose(other.at(name, apart), arc.at(name, apart), rtol=0.0, atol=1e-9)


def assert_scenario_alike(seed, trigger, channel, weights, t_end):
    ideal = trigger in ("relative", "girard", "self-triggered") or channel == "ideal"
    if trigger == "self-triggered" and weights not in KNOWN_AHEAD:
        weights = "sine"
    given = None if ideal else CHANNELS[channel]
    scenario = random_scenario(seed, trigger, channel=given, weights=weights, stop_time=t_end)
    assert_alike(consensus.closed_loop(scenario), t_end)


# Few, and short: each is compiled, and the scheduler in Python takes some ten milliseconds an event.
@examples(2, 3)
@given(**DRAWN)
def test_random_scenarios(seed, trigger, channel, weights):
    assert_scenario_alike(seed, trigger, channel, weights, 0.7)


@pytest.mark.long
@settings(max_examples=60, deadline=None)
@given(**DRAWN)
def test_many_random_scenarios(seed, trigger, channel, weights):
    assert_scenario_alike(seed, trigger, channel, weights, 2.0)


NEVER = 1e9
"""In s: after the runs."""


class Counter(hm.HybridAutomaton):
    """Passes on what it gets, one more; at a time of its own it begins."""

    first = hm.Parameter(NEVER, unit="s")
    u = hm.Input(0.0, discrete=True)
    begun = hm.DiscreteState(0, integer=True)
    seen = hm.DiscreteState(0.0)
    sent = hm.DiscreteState(0.0, output=True)

    def begins(self, s):
        return np.where(s.begun > 0.5, np.inf, s.first)

    transitions = (
        hm.TimeEvent("begin", begins, lambda self, s: {"begun": 1, "sent": s.sent + 1.0}),
        hm.Jump("pass", lambda self, s: s.u - s.seen - 0.5, lambda self, s: {"seen": s.u, "sent": s.u + 1.0}),
    )


@pytest.mark.parametrize("names", ["abc", "cba"])
def test_a_cascade_at_one_instant_goes_the_same_way(names):
    parts = {name: Counter(first=1.0 if name == "a" else NEVER) for name in names}
    network = hm.Composition("chain", parts, {"b.u": "a.sent", "c.u": "b.sent"})
    runs = [hm.simulate_network(network, 2.0, engine=engine) for engine in ("native", "python")]
    assert happened(runs[0]) == happened(runs[1])
    assert sorted(happened(runs[0])) == [("a", "begin"), ("b", "pass"), ("c", "pass")]
    assert {jump.t for _, jump in runs[0].jumps} == {1.0}


def test_parts_that_answer_each_other_without_end_are_refused_by_name():
    network = hm.Composition("talk", {"a": Counter(first=1.0), "b": Counter()}, {"b.u": "a.sent", "a.u": "b.sent"})
    for engine in ("native", "python"):
        run = hm.simulate_network(network, 2.0, zeno=hm.ZenoGuard(jumps_at_once=20), engine=engine)
        assert run.stop is hm.Stop.ZENO
        assert "part b" in run.message or "part a" in run.message
        assert run.t == 1.0


@pytest.mark.parametrize("engine", ["native", "python"])
def test_the_jumps_of_each_part_are_bounded(engine):
    class Clock(hm.HybridAutomaton):
        period = hm.Parameter(1.0)
        count = hm.DiscreteState(0, integer=True)
        transitions = (
            hm.TimeEvent("tick", lambda self, s: s.period * (s.count + 1), lambda self, s: {"count": s.count + 1}),
        )

    network = hm.product("clocks", Clock("slow", period=1.0), Clock("fast", period=0.1))
    run = hm.simulate_network(network, 9.0, zeno=hm.ZenoGuard(max_jumps=20), engine=engine)
    assert run.stop is hm.Stop.JUMPS
    assert "part fast" in run.message
    assert len(run.arcs["fast"].jumps) == len(run.event_times("fast", "tick")) == run.events.counts(2)[1] == 20
    assert run.t == pytest.approx(2.0)
    assert len(run.arcs["slow"].jumps) in (1, 2)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_what_a_part_makes_of_its_state_is_told_with_its_name(engine):
    class Breaks(hm.HybridAutomaton):
        x = hm.State(1.0, output=True)

        def flow_map(self, s):
            return {"x": -1.0}

        transitions = (hm.Jump("break", lambda self, s: -s.x, lambda self, s: {"x": np.inf}),)

    network = hm.product("pair", Breaks("left"), Breaks("right", x=0.5))
    with pytest.raises(hm.SimulationError, match=r"right"):
        hm.simulate_network(network, 2.0, engine=engine)


def test_stiff_parts_run_with_a_method_for_them():
    class Fast(hm.HybridAutomaton):
        x = hm.State(1.0, output=True)
        y = hm.State(0.0)
        sent = hm.DiscreteState(0.0, output=True)

        def flow_map(self, s):
            return {"x": -1e6 * (s.x - np.cos(s.t)), "y": s.x}

        transitions = (hm.Jump("send", lambda self, s: s.y - s.sent - 0.3, lambda self, s: {"sent": s.y}),)

    network = hm.product("stiff", Fast("a"), Fast("b", x=0.5))
    run = hm.simulate_network(network, 1.0, engine="native")
    whole = hm.simulate(network, 1.0, engine="native")
    for part in "ab":
        assert run.event_times(part, "send") == pytest.approx(whole.event_times(f"{part}.send"), abs=1e-8)


class Talker(hm.HybridAutomaton):
    """Drifts to what it hears and sends its state when that has moved; counts what it gets in jumps of its own."""

    degree = hm.Dimension()
    threshold = hm.Parameter(0.2)
    heard = hm.Input(0.0, shape="degree", discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)
    noticed = hm.DiscreteState(0.0, computed=True)
    phase = hm.DiscreteState(0, integer=True)
    answer = hm.Output(discrete=True)

    def start_map(self, s):
        return {"sent": s.x, "noticed": np.sum(s.heard)}

    def flow_map(self, s):
        return {"x": np.cos(3.0 * s.t) * np.where(s.phase % 2 < 0.5, 1.0, 0.5) + np.sum(s.heard) - s.sent}

    def outputs(self, s):
        return {"answer": 0.5 * s.sent}

    transitions = (
        hm.TimeEvent(
            "turn", lambda self, s: 0.3 * (s.phase + 1.0), lambda self, s: {"phase": s.phase + 1}, internal=True
        ),
        hm.Jump("send", lambda self, s: abs(s.x - s.sent) - s.threshold, lambda self, s: {"sent": s.x}),
        hm.Jump(
            "notice",
            lambda self, s: abs(np.sum(s.heard) - s.noticed) - 0.25,
            lambda self, s: {"noticed": np.sum(s.heard), "x": s.x + 0.01},
        ),
    )


@examples(2, 4)
@given(data=st.data(), count=st.integers(1, 4), by=st.sampled_from(["sent", "answer"]))
def test_random_wires(data, count, by):
    assert_wired_alike(data, count, by, 1.0)


@pytest.mark.long
@settings(max_examples=80, deadline=None)
@given(data=st.data(), count=st.integers(1, 5), by=st.sampled_from(["sent", "answer"]))
def test_many_random_wires(data, count, by):
    assert_wired_alike(data, count, by, 1.5)


def assert_wired_alike(data, count, by, t_end):
    """Loops, parts that hear themselves, states and outputs, and parts that hear nobody."""
    pairs = [(i, j) for i in range(count) for j in range(count)]
    links = data.draw(st.lists(st.sampled_from(pairs), max_size=6, unique=True))
    drawn = st.lists(st.floats(-1.0, 1.0).map(lambda x: round(x, 3)), min_size=count, max_size=count)
    columns = tuple(np.array([link[k] for link in links], np.int64) for k in (0, 1))
    # Thresholds apart, so that no two parts are so alike that rounding decides.
    values = {"x": np.array(data.draw(drawn)), "threshold": 0.2 + 0.0137 * np.arange(count)}
    network = hm.Network(
        "random", lambda degree: Talker(degree=degree), columns, {"heard": by}, values=values, count=count
    )
    native, plain = (hm.simulate_network(network, t_end, engine=engine) for engine in ("native", "python"))
    assert native.stop is plain.stop
    assert sorted(happened(native)) == sorted(happened(plain))
    for part in network.parts:
        for one, two in zip(native.arcs[part].jumps, plain.arcs[part].jumps, strict=True):
            assert one.name == two.name
            assert one.t == pytest.approx(two.t, abs=1e-8)
            np.testing.assert_allclose(one.x_after, two.x_after, rtol=0.0, atol=1e-8)
    if native.stop is hm.Stop.HORIZON:
        np.testing.assert_allclose(native.final("x"), plain.final("x"), rtol=0.0, atol=1e-9)
        assert hm.verify(network.copy(0), native.arcs["part1"]).ok


class Slide(hm.HybridAutomaton):
    """Leaves its flow set, by so little that a step of one rounding does not show it."""

    heard = hm.Input(0.0, discrete=True)
    x = hm.State(0.3)
    sent = hm.DiscreteState(0.0)

    def flow_map(self, s):
        return {"x": -1.0 + 0.0 * s.heard}

    def flow_set(self, s):
        return s.x + 0.1

    transitions = (hm.Jump("never", lambda self, s: s.x - 10.0, lambda self, s: {"sent": s.x}),)


def test_a_part_that_leaves_its_flow_set_ends_the_run_at_once():
    """Not after millions of steps of one rounding each."""
    parts = {"one": Slide("one"), "two": Slide("two", x=0.7)}
    network = hm.Composition("slides", parts, {"one.heard": "two.sent", "two.heard": "one.sent"})
    hm.simulate_network(network, 0.3, engine="native")  # compiles
    begin = time.process_time()
    native = hm.simulate_network(network, 1.0, engine="native")
    between = time.process_time()
    plain = hm.simulate_network(network, 1.0, engine="python")
    # A fifth of the reference's time where it is right, 150 times as much where it is not.
    assert between - begin < 10.0 * (time.process_time() - between)
    assert native.stop is plain.stop is hm.Stop.BLOCKED
    # Where the flow leaves its set, which counts as inside up to 1e-9 of its size; one instant is 8e-12 s here.
    assert native.t == pytest.approx(0.4, rel=0, abs=1e-15)
    assert plain.t == pytest.approx(0.4, rel=0, abs=1e-11)

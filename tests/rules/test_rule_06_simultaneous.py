"""Rule 6: simultaneous guards are all handled at one instant, in a fixed order that wiring does not change."""

import itertools

import numpy as np
import pytest
from small_automata import Alarm, Ramp, Timer

import hybrid_model as hm


def twins(order=("rising", "falling")):
    """Both move by 0.5 at t = 10, one from 0 upward and one from 0.05 downward: equal times, different rounding."""
    parts = {"rising": Ramp(x=0.0, rate=0.05), "falling": Ramp(x=0.05, rate=-0.05)}
    return hm.Composition("twins", {name: parts[name] for name in order})


@pytest.mark.parametrize("order", [("rising", "falling"), ("falling", "rising")])
def test_guards_that_differ_in_rounding_jump_at_one_instant(order):
    arc = hm.simulate(twins(order), 15.0)
    assert [jump.name for jump in arc.jumps] == [f"{name}.moved" for name in order]
    assert arc.jumps[0].t == arc.jumps[1].t == pytest.approx(10.0, abs=1e-12)
    assert (arc.jumps[0].j, arc.jumps[1].j) == (0, 1)


def test_the_order_of_parts_changes_the_order_of_j_and_nothing_else():
    ends = [hm.simulate(twins(order), 35.0).end for order in (("rising", "falling"), ("falling", "rising"))]
    for name in ("rising.x", "falling.x", "rising.held", "falling.held", "rising.count", "falling.count"):
        assert ends[0][name] == ends[1][name]


def test_crossings_further_apart_than_the_tolerance_are_two_instants():
    def run(tolerance):
        parts = {"a": Ramp(threshold=0.5), "b": Ramp(threshold=0.5 + 1e-7)}
        arc = hm.simulate(hm.Composition("pair", parts), 0.75, solver=hm.Solver(event_tolerance=tolerance))
        return [jump.t for jump in arc.jumps]

    apart, together = run(1e-9), run(1e-6)
    assert apart[1] - apart[0] == pytest.approx(1e-7, rel=1e-6)
    assert together[0] == together[1] == pytest.approx(0.5 + 1e-7, abs=1e-13)


def test_many_identical_guards_jump_together_in_order():
    parts = {f"p{k}": Ramp() for k in range(12)}
    arc = hm.simulate(hm.Composition("row", parts), 0.6)
    assert [jump.name for jump in arc.jumps] == [f"p{k}.moved" for k in range(12)]
    assert len({jump.t for jump in arc.jumps}) == 1


@pytest.mark.parametrize("order", list(itertools.permutations(["alarm", "timer", "other"])))
def test_guard_and_timers_that_coincide_are_all_taken_in_the_order_of_the_parts(order):
    parts = {"alarm": Alarm.of(lambda t: t - 1.0), "timer": Timer(first=1.0), "other": Timer(first=1.0)}
    arc = hm.simulate(hm.Composition("three", {name: parts[name] for name in order}), 1.5)
    names = {"alarm": "alarm.ring", "timer": "timer.tick", "other": "other.tick"}
    assert [(jump.name, jump.t) for jump in arc.jumps] == [(names[name], 1.0) for name in order]


def test_guards_and_timers_that_coincide_but_for_rounding_are_all_taken():
    parts = {"ramp": Ramp(rate=0.05), "timer": Timer(first=10.0, period=100.0)}
    arc = hm.simulate(hm.Composition("both", parts), 11.0)
    assert {jump.name for jump in arc.jumps} == {"ramp.moved", "timer.tick"}
    assert [jump.t for jump in arc.jumps] == pytest.approx([10.0, 10.0], abs=1e-12)


def test_transitions_of_one_automaton_are_taken_in_their_order():
    class Both(hm.HybridAutomaton):
        x = hm.State(0.0)
        order = hm.DiscreteState(0.0)
        a = hm.DiscreteState(0)
        b = hm.DiscreteState(0)

        def flow_map(self, s):
            return {"x": 1.0}

        transitions = (
            hm.Jump(
                "b", lambda self, s: hm.least(s.x - 1, 0.5 - s.b), lambda self, s: {"b": 1, "order": s.order * 10 + 2}
            ),
            hm.Jump(
                "a", lambda self, s: hm.least(s.x - 1, 0.5 - s.a), lambda self, s: {"a": 1, "order": s.order * 10 + 1}
            ),
        )

    arc = hm.simulate(Both(), 2.0)
    assert arc.end.order == 21
    assert len({jump.t for jump in arc.jumps}) == 1


class Sender(hm.HybridAutomaton):
    """Sends a new value when its time has come."""

    value = hm.DiscreteState(0.0, output=True)
    k = hm.DiscreteState(1, integer=True)

    transitions = (hm.TimeEvent("send", lambda self, s: s.k * 1.0, lambda self, s: {"value": s.k * 2.0, "k": s.k + 1}),)


class Receiver(hm.HybridAutomaton):
    """Takes over what it hears as soon as it differs."""

    heard = hm.Input(0.0, discrete=True)
    value = hm.DiscreteState(0.0, output=True)

    def jump_set(self, s):
        return np.abs(s.heard - s.value) - 0.5

    def jump_map(self, s):
        return {"value": s.heard}


@pytest.mark.parametrize("order", list(itertools.permutations(["sender", "first", "second"])))
def test_a_broadcast_is_visible_at_the_same_t_in_the_next_j(order):
    parts = {"sender": Sender(), "first": Receiver(), "second": Receiver()}
    chain = hm.Composition(
        "chain",
        {name: parts[name] for name in order},
        {"first.heard": "sender.value", "second.heard": "first.value"},
    )
    arc = hm.simulate(chain, 2.5)
    assert [jump.name for jump in arc.jumps] == ["sender.send", "first.jump", "second.jump"] * 2
    assert [jump.t for jump in arc.jumps] == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    assert [jump.j for jump in arc.jumps] == list(range(6))
    assert arc.end["second.value"] == 4.0


def test_the_order_of_connections_changes_nothing():
    wires = {"first.heard": "sender.value", "second.heard": "first.value"}
    runs = []
    for order in itertools.permutations(wires.items()):
        parts = {"sender": Sender(), "first": Receiver(), "second": Receiver()}
        arc = hm.simulate(hm.Composition("chain", parts, dict(order)), 2.5)
        runs.append([(jump.t, jump.name, *jump.z_after) for jump in arc.jumps])
    assert runs[0] == runs[1]


def test_a_jump_that_disables_the_others_leaves_them_untaken():
    class Rival(Ramp):
        silent = hm.Input(0.0, discrete=True)

        def moved(self, s):
            return hm.least(abs(s.x - s.held) - s.threshold, 0.5 - s.silent)

        transitions = (hm.Jump("moved", moved, Ramp.hold),)

    pair = hm.Composition("pair", {"one": Rival(), "two": Rival()}, {"two.silent": "one.count"})
    arc = hm.simulate(pair, 0.75)
    assert [jump.name for jump in arc.jumps] == ["one.moved"]

"""Composition is associative up to names, indifferent to the order of parts, and a product of strangers is each alone.

The parts are drawn: lags, ramps that send on change, pulsers, wired at random. Their guards and resets look at their
own states only and inputs enter their flows, so jumps of different parts at one instant commute. Where jumps do not
commute rule 6 fixes their order by the order of the parts, and the last test says what that means.
"""

from collections import Counter
from itertools import groupby, permutations

import numpy as np
import pytest
from drawing import examples
from hypothesis import given
from hypothesis import strategies as st

import hybrid_model as hm

T_END = 2.0
# Another order of the states changes the rounding of the error norm and with it the steps: the solver's error, 1e-13 a
# step, over slopes of 0.1 and more.
TIME, STATE = 1e-10, 1e-10


class Lag(hm.HybridAutomaton):
    """x' = b u - a x + c; counts its way up in steps of `gap`."""

    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    level = hm.DiscreteState(0.55, output=True)
    a, b, c = hm.Parameter(1.0), hm.Parameter(1.0), hm.Parameter(0.0)
    gap = hm.Parameter(0.35)

    def flow_map(self, s):
        return {"x": s.b * s.u - s.a * s.x + s.c}

    def reached(self, s):
        return s.x - s.level

    def lift(self, s):
        return {"level": s.level + s.gap}

    transitions = (hm.Jump("reached", reached, lift),)


class Sender(hm.HybridAutomaton):
    """x' = rate + u/2; holds x each time that it has moved by `threshold`."""

    u = hm.Input(0.0)
    x = hm.State(0.0)
    value = hm.DiscreteState(0.0, output=True)
    rate, threshold = hm.Parameter(1.0), hm.Parameter(0.4)

    def flow_map(self, s):
        return {"x": s.rate + 0.5 * s.u}

    def moved(self, s):
        return abs(s.x - s.value) - s.threshold

    def hold(self, s):
        return {"value": s.x}

    transitions = (hm.Jump("moved", moved, hold),)


class Pulser(hm.HybridAutomaton):
    """Its value changes sign every `period`; listens to nobody."""

    k = hm.DiscreteState(0, integer=True)
    value = hm.DiscreteState(1.0, output=True)
    period = hm.Parameter(0.5)

    def time(self, s):
        return (s.k + 1) * s.period

    def turn(self, s):
        return {"k": s.k + 1, "value": -s.value}

    transitions = (hm.TimeEvent("turn", time, turn),)


SIGNAL = {Lag: "x", Sender: "value", Pulser: "value"}
number = st.integers(-6, 6).map(lambda k: k / 4 + 0.013)
positive = st.integers(2, 8).map(lambda k: k / 8)
# Gains below the decay at most, so that loops do not run away in hundreds of jumps.
gain = st.integers(-4, 4).map(lambda k: k / 8)
lags = st.builds(Lag, x=number, a=st.just(0.5), b=gain, c=number)
senders = st.builds(Sender, x=number, rate=number, threshold=positive)
pulsers = st.builds(Pulser, period=positive)


@st.composite
def networks(draw, size=3, wired=True):
    """Parts by name, and wires; sometimes a part twice, so that both jump at the same instants."""
    parts = [draw(st.one_of(lags, senders, pulsers)) for _ in range(size)]
    if draw(st.booleans()):
        parts[-1] = parts[0]
    named = dict(zip("abcd", parts, strict=False))
    wires = {}
    for name, part in named.items():
        source = draw(st.sampled_from([None, *named])) if wired else None
        if source and not isinstance(part, Pulser):
            wires[f"{name}.u"] = f"{source}.{SIGNAL[type(named[source])]}"
    return named, wires


def nested(name, parts, wires, inside):
    """Compose the parts named in `inside` first, as the part "inner", and the rest with it."""

    def scoped(path):
        return f"inner.{path}" if path[0] in inside else path

    own = {to: start for to, start in wires.items() if to[0] in inside and start[0] in inside}
    inner = hm.Composition("inner", {key: parts[key] for key in inside}, own)
    # In the place of the first part inside, so that the order of parts, flattened, is the same.
    order = {"inner" if key in inside else key: inner if key in inside else part for key, part in parts.items()}
    return hm.Composition(name, order, {scoped(to): scoped(start) for to, start in wires.items() if to not in own})


def flat_names(arc):
    """Jumps as (time, name, states after), with the scope of the inner composition taken off."""
    return [(jump.t, jump.name.removeprefix("inner."), *jump.x_after, *jump.z_after) for jump in arc.jumps]


@examples(5, 20)
@given(networks())
def test_composition_is_associative_up_to_names(network):
    parts, wires = network
    flat = hm.simulate(hm.Composition("flat", parts, wires), T_END)
    left = hm.simulate(nested("left", parts, wires, "ab"), T_END)
    right = hm.simulate(nested("right", parts, wires, "bc"), T_END)
    # The same maps over the same vectors: the same bits, the order of simultaneous jumps included.
    assert flat_names(left) == flat_names(flat)
    assert flat_names(right) == flat_names(flat)
    names = [variable.name for variable in flat.automaton.variables]
    for arc in (left, right):
        assert [variable.name.removeprefix("inner.") for variable in arc.automaton.variables] == names
        for variable in arc.automaton.variables:
            assert np.array_equal(arc.end[variable.name], flat.end[variable.name.removeprefix("inner.")])


@examples(5, 20)
@given(networks(), st.sampled_from(list(permutations("abc"))[1:]))
def test_the_order_of_parts_decides_only_the_order_within_an_instant(network, order):
    parts, wires = network
    one = hm.simulate(hm.Composition("one", parts, wires), T_END)
    other = hm.simulate(hm.Composition("other", {key: parts[key] for key in order}, wires), T_END)
    same_jumps(one.jumps, other.jumps)
    for variable in one.automaton.variables:
        assert other.end[variable.name] == pytest.approx(one.end[variable.name], abs=STATE)


@examples(5, 20)
@given(networks(wired=False))
def test_a_product_of_strangers_is_each_of_them_alone(network):
    parts, _ = network
    together = hm.simulate(hm.Composition("together", parts), T_END)
    for name, part in parts.items():
        alone = hm.simulate(part, T_END)
        own = [jump for jump in together.jumps if jump.name.startswith(f"{name}.")]
        assert [jump.name for jump in own] == [f"{name}.{jump.name}" for jump in alone.jumps]
        assert [jump.t for jump in own] == pytest.approx([jump.t for jump in alone.jumps], abs=TIME)
        for variable in part.variables:
            assert together.end[f"{name}.{variable.name}"] == pytest.approx(alone.end[variable.name], abs=STATE)


@examples(3, 10)
@given(networks(size=4), st.sampled_from(["ab", "bc", "cd", "abc", "bcd"]))
def test_four_parts_bracketed_anyhow(network, inside):
    parts, wires = network
    flat = hm.simulate(hm.Composition("flat", parts, wires), T_END)
    bracketed = hm.simulate(nested("bracketed", parts, wires, inside), T_END)
    assert flat_names(bracketed) == flat_names(flat)


def test_the_draws_hold_simultaneous_jumps_of_different_parts():
    # Else the tests above would say nothing of rule 6.
    twins = hm.Composition("twins", {"a": Sender(rate=0.3), "b": Lag(c=2.0), "c": Sender(rate=0.3)})
    sizes = Counter(len(list(group)) for _, group in groupby(hm.simulate(twins, T_END).jumps, lambda jump: jump.t))
    assert sizes[2] >= 1


class Copier(hm.HybridAutomaton):
    """At t = 1 takes over what it hears at that instant: jumps that do not commute."""

    heard = hm.Input(0.0, discrete=True)
    value = hm.DiscreteState(0.0, output=True)
    done = hm.DiscreteState(0)

    def time(self, s):
        return 1.0 + 1e6 * s.done

    def copy(self, s):
        return {"value": s.heard, "done": 1}

    transitions = (hm.TimeEvent("copy", time, copy),)


@pytest.mark.parametrize(("order", "kept"), [("ab", 2.0), ("ba", 1.0)])
def test_where_jumps_do_not_commute_the_first_part_jumps_first_and_the_second_sees_it(order, kept):
    parts = {"a": Copier(value=1.0), "b": Copier(value=2.0)}
    wires = {"a.heard": "b.value", "b.heard": "a.value"}
    arc = hm.simulate(hm.Composition("pair", {key: parts[key] for key in order}, wires), 2.0)
    assert [jump.name for jump in arc.jumps] == [f"{key}.copy" for key in order]
    assert (arc.end["a.value"], arc.end["b.value"]) == (kept, kept)


def same_jumps(one, other):
    """Require equal jumps at equal times; within one instant in any order."""
    assert len(one) == len(other)
    assert [jump.t for jump in one] == pytest.approx([jump.t for jump in other], abs=TIME)
    assert sorted(instants(one)) == sorted(instants(other))


def instants(jumps):
    """Names with the number of their instant: jumps less than the event tolerance apart are at one."""
    number, found = 0, []
    for k, jump in enumerate(jumps):
        number += bool(k and jump.t - jumps[k - 1].t > 1e-9)
        found.append((number, jump.name))
    return found

"""Composition: scopes, wires, loops, nesting; what does not fit is refused with both names."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.declare.variables import Kind
from hybrid_model.models import BouncingBall, Thermostat


class Gain(hm.HybridAutomaton):
    """y = k u, without a state: feedthrough."""

    u = hm.Input(0.0, unit="m")
    k = hm.Parameter(2.0)
    y = hm.Output(unit="m")

    def outputs(self, s):
        return {"y": s.k * s.u}


class Lag(hm.HybridAutomaton):
    """x' = u - x, and y = x + 1: no feedthrough."""

    u = hm.Input(0.0, unit="m")
    x = hm.State(0.0, unit="m", output=True)
    y = hm.Output(unit="m")

    def flow_map(self, s):
        return {"x": s.u - s.x}

    def outputs(self, s):
        return {"y": s.x + 1.0}


class Source(hm.HybridAutomaton):
    """A constant output, a discrete one and a vector."""

    n = hm.Dimension()
    value = hm.DiscreteState(3.0, output=True)
    vector = hm.Output(shape="n")
    seconds = hm.Output(unit="s")

    def outputs(self, s):
        return {"vector": np.arange(1.0, self.length + 1.0), "seconds": 1.0}

    @property
    def length(self):
        return next(v for v in self.variables if v.name == "vector").size


class Sink(hm.HybridAutomaton):
    """Integrates the sum of a vector input; a discrete input beside it."""

    n = hm.Dimension()
    w = hm.Input(0.0, shape="n")
    sampled = hm.Input(0.0, discrete=True)
    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": np.sum(s.w) + s.sampled}


# Scopes and names.


def test_variables_are_scoped_and_wired_inputs_are_hidden():
    both = hm.Composition("both", {"gain": Gain(), "lag": Lag()}, {"lag.u": "gain.y"})
    assert [v.name for v in both.variables] == ["gain.u", "gain.k", "gain.y", "lag.x", "lag.y"]
    assert [v.name for v in both.of_kind(Kind.INPUT)] == ["gain.u"]


def test_free_inputs_of_parts_are_inputs_of_the_whole():
    both = hm.Composition("both", {"gain": Gain(), "lag": Lag()}, {"lag.u": "gain.y"})
    arc = hm.simulate(both, 1.0, inputs={"gain.u": 1.5})
    assert arc.end["lag.x"] == pytest.approx(3.0 * (1.0 - np.exp(-1.0)), abs=1e-11)
    assert arc.at("lag.y", 1.0) == pytest.approx(1.0 + 3.0 * (1.0 - np.exp(-1.0)), abs=1e-11)
    assert arc.at("gain.y", 0.3) == 3.0


def test_parts_without_wires_run_as_if_alone():
    both = hm.Composition("both", {"ball": BouncingBall(), "room": Thermostat(temperature=20.9)})
    arc = hm.simulate(both, 2.0)
    alone = {"ball": hm.simulate(BouncingBall(), 2.0), "room": hm.simulate(Thermostat(temperature=20.9), 2.0)}
    assert len(arc.jumps) == sum(len(run.jumps) for run in alone.values()) == 5
    assert arc.event_times("ball.jump") == pytest.approx(alone["ball"].event_times("jump"), abs=1e-11)
    assert arc.event_times("room.off") == pytest.approx(alone["room"].event_times("off"), abs=1e-9)
    assert arc.end["ball.h"] == pytest.approx(alone["ball"].end.h, abs=1e-10)
    assert arc.end["room.temperature"] == pytest.approx(alone["room"].end.temperature, abs=1e-10)


def test_names_replace_scoped_names_of_variables_and_clocks():
    one = hm.Composition("one", {"ball": BouncingBall()}, names={"ball.h": "height", "ball.impact": "bell"})
    assert [v.name for v in one.variables] == ["height", "ball.v", "ball.g", "ball.e"]
    assert [(clock.name, clock.jump) for clock in one.clocks] == [("bell", 0)]
    assert hm.simulate(one, 0.1).end["height"] == pytest.approx(1.0 - 9.81 / 2 * 0.01, abs=1e-14)


def test_clocks_tick_with_the_jump_of_their_own_part():
    two = hm.Composition("two", {"room": Thermostat(), "ball": BouncingBall()})
    (clock,) = two.clocks
    assert two.jumps[clock.jump].name == "ball.jump"


def test_a_composition_of_compositions_runs_like_a_flat_one():
    inner = hm.Composition("inner", {"gain": Gain(k=3.0), "lag": Lag()}, {"lag.u": "gain.y"}, {"gain.u": "u"})
    outer = hm.Composition("outer", {"first": inner, "second": Lag()}, {"second.u": "first.lag.y"})
    flat = hm.Composition(
        "flat", {"gain": Gain(k=3.0), "lag": Lag(), "second": Lag()}, {"lag.u": "gain.y", "second.u": "lag.y"}
    )
    nested = hm.simulate(outer, 2.0, inputs={"first.u": 1.0})
    plain = hm.simulate(flat, 2.0, inputs={"gain.u": 1.0})
    assert nested.end["second.x"] == plain.end["second.x"]
    # x2' = 1 + 3 (1 - e^-t) - x2.
    assert nested.end["second.x"] == pytest.approx(4.0 * (1 - np.exp(-2.0)) - 3.0 * 2.0 * np.exp(-2.0), abs=1e-11)


def test_jumps_of_nested_parts_are_scoped_and_in_order():
    inner = hm.Composition("inner", {"b": BouncingBall(), "a": BouncingBall()})
    outer = hm.Composition("outer", {"z": inner, "y": Thermostat()})
    assert [jump.name for jump in outer.jumps] == ["z.b.jump", "z.a.jump", "y.off", "y.on"]
    arc = hm.simulate(outer, 0.5)
    assert [jump.name for jump in arc.jumps] == ["z.b.jump", "z.a.jump"]
    assert arc.jumps[0].t == arc.jumps[1].t


def test_computed_starts_see_those_of_earlier_parts():
    class Copy(hm.HybridAutomaton):
        u = hm.Input(0.0)
        x = hm.DiscreteState(computed=True)

        def start_map(self, s):
            return {"x": s.u + 1.0}

    chain = hm.Composition("chain", {"a": Copy(), "b": Copy(), "c": Copy()}, {"b.u": "a.x", "c.u": "b.x"})
    end = hm.simulate(chain, 0.0, inputs={"a.u": 10.0}).end
    assert (end["a.x"], end["b.x"], end["c.x"]) == (11.0, 12.0, 13.0)


def test_the_flow_set_of_the_whole_is_the_intersection():
    class Fence(hm.HybridAutomaton):
        x = hm.State(0.0)
        limit = hm.Parameter(1.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def flow_set(self, s):
            return s.limit - s.x

    arc = hm.simulate(hm.Composition("two", {"far": Fence(limit=2.0), "near": Fence(limit=0.5)}), 5.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] == pytest.approx(0.5, abs=2e-9)
    assert "near.x = 0.5" in arc.message


def test_a_composition_of_nothing_runs():
    assert hm.simulate(hm.Composition("nothing", {}), 1.0).stop is hm.Stop.HORIZON


# Vector inputs.


def test_scalars_are_stacked_into_a_vector_in_their_order():
    parts = {"a": Gain(k=1.0), "b": Gain(k=10.0), "sink": Sink(n=3)}
    whole = hm.Composition("whole", parts, {"sink.w": ["a.y", "b.y", "a.y"]})
    arc = hm.simulate(whole, 1.0, inputs={"a.u": 1.0, "b.u": 2.0})
    assert arc.end["sink.x"] == pytest.approx(22.0, abs=1e-12)


def test_a_vector_may_be_connected_as_a_whole():
    whole = hm.Composition("whole", {"source": Source(n=3), "sink": Sink(n=3)}, {"sink.w": "source.vector"})
    assert hm.simulate(whole, 1.0).end["sink.x"] == pytest.approx(6.0, abs=1e-12)


def test_empty_vectors_are_vectors():
    whole = hm.Composition("whole", {"sink": Sink(n=0)}, {"sink.w": []})
    assert hm.simulate(whole, 1.0, inputs={"sink.sampled": 2.0}).end["sink.x"] == pytest.approx(2.0, abs=1e-12)
    free = hm.Composition("free", {"sink": Sink(n=0)})
    assert hm.simulate(free, 1.0, inputs={"sink.w": []}).stop is hm.Stop.HORIZON


# Loops.


def test_an_algebraic_loop_is_refused_with_its_names():
    with pytest.raises(hm.AlgebraicLoopError, match=r"loop: the outputs of a -> b -> a need each other .* put a state"):
        hm.Composition("loop", {"a": Gain(), "b": Gain()}, {"a.u": "b.y", "b.u": "a.y"})


def test_a_part_that_feeds_itself_through_is_a_loop():
    with pytest.raises(hm.AlgebraicLoopError, match="a -> a"):
        hm.Composition("loop", {"a": Gain()}, {"a.u": "a.y"})


def test_the_message_holds_the_loop_and_not_the_way_to_it():
    parts = {"before": Gain(), "a": Gain(), "b": Gain(), "c": Gain()}
    with pytest.raises(hm.AlgebraicLoopError, match=r"outputs of a -> c -> b -> a need"):
        hm.Composition("loop", parts, {"before.u": "a.y", "a.u": "c.y", "b.u": "a.y", "c.u": "b.y"})


def test_a_loop_over_a_state_is_none():
    loop = hm.Composition("loop", {"gain": Gain(k=-1.0), "lag": Lag()}, {"gain.u": "lag.x", "lag.u": "gain.y"})
    assert hm.simulate(loop, 1.0).end["lag.x"] == 0.0
    loop = hm.Composition("loop", {"gain": Gain(k=-1.0), "lag": Lag(x=1.0)}, {"gain.u": "lag.x", "lag.u": "gain.y"})
    assert hm.simulate(loop, 1.0).end["lag.x"] == pytest.approx(np.exp(-2.0), abs=1e-11)


def test_an_output_that_does_not_use_the_input_makes_no_loop():
    whole = hm.Composition("whole", {"one": Lag(), "two": Lag()}, {"one.u": "two.y", "two.u": "one.y"})
    assert hm.simulate(whole, 1.0).stop is hm.Stop.HORIZON


def test_a_loop_inside_a_nested_composition_is_refused_there():
    inner = hm.Composition("inner", {"gain": Gain()})
    with pytest.raises(hm.AlgebraicLoopError, match="outer"):
        hm.Composition("outer", {"part": inner, "back": Gain()}, {"part.gain.u": "back.y", "back.u": "part.gain.y"})


# Wires that do not fit.


@pytest.mark.parametrize(
    ("connections", "sentence"),
    [
        ({"lag.v": "gain.y"}, r"whole: lag\.v is not an input; lag has u"),
        ({"lag.x": "gain.y"}, r"lag\.x is not an input"),
        ({"lagg.u": "gain.y"}, r"whole \(parts\) has no variable 'lagg\.u'; it has gain, lag, source, sink"),
        ({"lag.u": "gain.z"}, r"whole: gain\.z is not an output; gain has y"),
        ({"lag.u": "gain.k"}, r"gain\.k is not an output"),
        ({"lag.u": "y"}, r"has no variable 'y'"),
        ({"lag.u": "source.vector"}, r"source\.vector has shape \(2,\), but lag\.u takes \(\): connect equal shapes"),
        ({"sink.w": "gain.y"}, r"gain\.y has shape \(\), but sink\.w takes \(3,\)"),
        ({"sink.w": "source.vector"}, r"source\.vector has shape \(2,\), but sink\.w takes \(3,\)"),
        ({"sink.w": ["gain.y", "lag.x"]}, r"sink\.w has shape \(3,\), but 2 signals are connected"),
        ({"lag.u": ["gain.y"]}, r"lag\.u has shape \(\), but 1 signals"),
        ({"sink.w": ["source.vector"] * 3}, r"source\.vector has shape \(2,\), but sink\.w takes \(\)"),
        ({"lag.u": "source.seconds"}, r"source\.seconds is in 's', but lag\.u is in 'm': convert one"),
        ({"sink.sampled": "lag.x"}, r"lag\.x changes along flows, but sink\.sampled is a discrete input.*sample it"),
        ({"sink.sampled": "gain.y"}, r"gain\.y changes along flows"),
    ],
)
def test_wires_that_do_not_fit(connections, sentence):
    parts = {"gain": Gain(), "lag": Lag(), "source": Source(n=2), "sink": Sink(n=3)}
    with pytest.raises(hm.WiringError, match=sentence):
        hm.Composition("whole", parts, connections)


def test_a_discrete_state_fits_a_discrete_input_and_a_signal_without_unit_fits_any():
    parts = {"source": Source(n=0), "sink": Sink(n=0), "lag": Lag()}
    whole = hm.Composition("whole", parts, {"sink.sampled": "source.value", "lag.u": "source.value"})
    assert hm.simulate(whole, 1.0).end["sink.x"] == pytest.approx(3.0, abs=1e-12)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ({"lag.z": "z"}, r"whole \(names\) has no variable 'lag\.z'"),
        ({"lag.x": "gain.k"}, r"two variables are called 'gain\.k': name them apart"),
        ({"lag.x": "same", "gain.k": "same"}, r"two variables are called 'same'"),
        ({"lag.x": "t"}, r"called 't'"),
    ],
)
def test_names_that_do_not_fit(names, sentence):
    with pytest.raises(hm.WiringError, match=sentence):
        hm.Composition("whole", {"gain": Gain(), "lag": Lag()}, names=names)


def test_part_names_that_begin_alike_are_kept_apart():
    parts = {"gain": Gain(k=1.0), "gain2": Gain(k=2.0), "gain.inner": Gain(k=3.0), "lag": Lag()}
    for source, level in (("gain.y", 1.0), ("gain2.y", 2.0), ("gain.inner.y", 3.0)):
        whole = hm.Composition("whole", parts, {"lag.u": source})
        arc = hm.simulate(whole, 1.0, inputs={"gain.u": 1.0, "gain2.u": 1.0, "gain.inner.u": 1.0})
        assert arc.end["lag.x"] == pytest.approx(level * (1.0 - np.exp(-1.0)), abs=1e-11)


def test_parts_with_jumps_must_agree_on_the_priority():
    class Patient(BouncingBall):
        priority = hm.Priority.FLOW

    with pytest.raises(
        hm.WiringError, match=r"mixed: some parts let the jump win .* give all parts with jumps the same"
    ):
        hm.Composition("mixed", {"a": BouncingBall(), "b": Patient()})
    assert hm.Composition("alike", {"a": Patient(), "c": Gain()}).priority is hm.Priority.FLOW


class _Follower(hm.HybridAutomaton):
    """y = x, whatever u."""

    u = hm.Input(0.0)
    x = hm.State(1.0)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": s.u - s.x}

    def outputs(self, s):
        return {"y": s.x}


class _Doubling(hm.HybridAutomaton):
    u = hm.Input(0.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": 2.0 * s.u}


def test_nesting_makes_no_algebraic_loop_of_a_chain():
    """a -> c -> b, with a and b nested in one composition: the outputs of a do not need what b needs."""
    flat = hm.Composition("flat", {"a": _Follower(), "c": _Doubling(), "b": _Doubling()}, {"c.u": "a.y", "b.u": "c.y"})
    inner = hm.Composition("inner", {"a": _Follower(), "b": _Doubling()})
    nested = hm.Composition("nested", {"inner": inner, "c": _Doubling()}, {"c.u": "inner.a.y", "inner.b.u": "c.y"})
    one, other = hm.simulate(flat, 1.0), hm.simulate(nested, 1.0)
    assert one.at("b.y", 1.0) == other.at("inner.b.y", 1.0) == pytest.approx(4.0 * np.exp(-1.0), abs=1e-12)


def test_a_real_loop_through_a_nested_composition_is_still_refused():
    inner = hm.Composition("inner", {"a": _Doubling(), "b": _Doubling()}, {"b.u": "a.y"})
    with pytest.raises(hm.AlgebraicLoopError, match=r"inner\.b\.y -> c -> inner\.b\.y|c -> inner\.b\.y -> c"):
        hm.Composition("nested", {"inner": inner, "c": _Doubling()}, {"c.u": "inner.b.y", "inner.a.u": "c.y"})


def test_several_parts_with_flow_priority_are_refused():
    class Late(hm.HybridAutomaton):
        priority = hm.Priority.FLOW
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def flow_set(self, s):
            return 2.0 - s.x

        def jump_set(self, s):
            return s.x - 1.0

        def jump_map(self, s):
            return {"x": 0.0}

    with pytest.raises(hm.WiringError, match="a and b jump on state, and under flow priority"):
        hm.Composition("two", {"a": Late(), "b": Late()})
    assert len(hm.simulate(hm.Composition("one", {"a": Late()}), 5.0).jumps) == 2


@pytest.mark.parametrize(
    ("part", "words"), [(_Doubling, r"_Doubling is a class: make an instance"), (3, "3 is not an")]
)
def test_what_is_no_automaton_is_refused(part, words):
    with pytest.raises(hm.DeclarationError, match=words):
        hm.Composition("broken", {"a": part})

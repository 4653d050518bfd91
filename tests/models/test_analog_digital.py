"""Converter, state machine and hold: each against what its definition says, and the loop against its recursion."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import (
    AnalogDigitalConverter,
    AnalogDigitalLoop,
    BouncingBall,
    FiniteStateMachine,
    FirstOrderPlant,
    ZeroOrderHold,
)

# Some tens of exponentials near 1, each to the solver's relative 1e-13.
ROUNDING = 1e-11


def test_the_converter_samples_a_sine_every_pi_8():
    arc = hm.simulate(AnalogDigitalConverter(period=np.pi / 8, levels=[-0.5, 0.5]), 7.8, inputs={"analog": np.sin})
    times = np.arange(20) * np.pi / 8
    assert np.array_equal(arc.event_times("sample"), times)
    after = [arc.after(jump) for jump in arc.jumps]
    assert np.array_equal([s.sample for s in after], np.sin(times))
    assert np.array_equal([s.code for s in after], np.digitize(np.sin(times), [-0.5, 0.5]))


def test_the_converter_samples_the_bouncing_ball():
    period, e, g = 0.1, 0.8, 9.81
    parts = {"ball": BouncingBall(e=e), "converter": AnalogDigitalConverter(period=period, levels=[0.0])}
    arc = hm.simulate(hm.Composition("Watched", parts, {"converter.analog": "ball.h"}), 3.05)
    speed = np.sqrt(2 * g)
    impacts = np.cumsum([speed / g, *(2 * speed * e ** np.arange(1, 12) / g)])
    times = np.arange(31) * period
    flight = np.searchsorted(impacts, times, side="right")
    since = times - np.concatenate([[-speed / g], impacts])[flight]
    heights = speed * e**flight * since - g * since**2 / 2
    samples = [arc.after(jump)["converter.sample"] for jump in arc.jumps if jump.name == "converter.sample"]
    assert samples == pytest.approx(heights, abs=ROUNDING)


def test_the_hold_holds_the_sampled_ball():
    ball = {"ball": BouncingBall(e=0.8), "sampler": AnalogDigitalConverter(period=0.05, levels=[0.0])}
    parts = {**ball, "hold": ZeroOrderHold(period=0.2, gain=2.0, offset=-1.0)}
    wires = {"sampler.analog": "ball.h", "hold.digital": "sampler.sample"}
    arc = hm.simulate(hm.Composition("Held", parts, wires), 2.0)
    t = np.linspace(0.0, 1.999, 500)
    held = 2.0 * arc.at("ball.h", np.floor(t / 0.2 + 1e-9) * 0.2) - 1.0
    assert arc.at("hold.held", t) == pytest.approx(held, abs=ROUNDING)


def test_the_state_machine_of_the_toolbox():
    # delta(q, u) = 3 - u in each component, with inputs that are 2 in windows and 1 outside; here counted from 0.
    edges = [
        sorted([*(2.0 * k for k in range(5)), *(2.0 * k + 0.4 for k in range(5))]),
        sorted([*(3.0 * k + 1.0 for k in range(3)), *(3.0 * k + 1.6 for k in range(3))]),
    ]
    signals = [hm.Signal(lambda t, at=at: float(np.searchsorted(at, t, side="right") % 2), at) for at in edges]
    parts = {name: FiniteStateMachine(table=[[1, 0], [1, 0]], q=start) for name, start in (("q1", 0), ("q2", 1))}
    machine = hm.Composition("Machine", parts, {})
    arc = hm.simulate(machine, 10.0, inputs={"q1.symbol": signals[0], "q2.symbol": signals[1]})
    # q1 starts where its input sends it at t = 0 anyway; q2 starts in agreement with its input.
    assert np.array_equal(arc.event_times("q1.move"), edges[0][1:])
    assert np.array_equal(arc.event_times("q2.move"), edges[1])
    t = np.linspace(0.0, 9.99, 112)
    for name, signal in zip(("q1", "q2"), signals, strict=True):
        assert np.array_equal(arc.at(f"{name}.q", t), [1.0 - signal.value(time) for time in t])


def test_the_state_machine_follows_a_chain_at_one_instant_and_stops_on_a_circle():
    chain = hm.simulate(FiniteStateMachine(table=[[1], [2], [3], [3]]), 1.0)
    assert [(jump.t, jump.z_after[0]) for jump in chain.jumps] == [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0)]
    circle = hm.simulate(FiniteStateMachine(table=[[1], [0]]), 1.0)
    assert circle.stop is hm.Stop.ZENO
    assert "at one instant" in circle.message


def loop(period, latency, low, high, x, count):
    """Samples and machine states: x(t) relaxes to the state that the hold has taken over `latency` after a sample."""
    q, held, found = 0, 0.0, []
    for _ in range(count):
        sample = x
        q = 1 if sample < low else 0 if sample >= high else q
        found.append((sample, q))
        x = held + (x - held) * np.exp(-latency)
        held = float(q)
        x = held + (x - held) * np.exp(-(period - latency))
    return np.array(found)


@pytest.mark.parametrize(("latency", "start"), [(0.0, 0.0), (0.05, 0.9), (0.1, 0.5)])
def test_the_loop_follows_its_recursion(latency, start):
    period, low, high, count = 0.13, 0.37, 0.61, 60
    exact = loop(period, latency, low, high, start, count)
    automaton = AnalogDigitalLoop(low=low, high=high, period=period, latency=latency, x=start)
    arc = hm.simulate(automaton, (count - 0.5) * period)
    taken = [arc.after(jump) for jump in arc.jumps if jump.name == "converter.sample"]
    assert [s["converter.sample"] for s in taken] == pytest.approx(exact[:, 0], abs=ROUNDING)
    # The machine moves at the same instant, in the next jump.
    assert np.array_equal(arc.at("machine.q", np.arange(count) * period), exact[:, 1])
    assert len(arc.event_times("machine.move")) == np.count_nonzero(np.diff([0, *exact[:, 1]])) > 5


def test_one_instant_is_taken_in_the_order_of_the_signal():
    arc = hm.simulate(AnalogDigitalLoop(), 0.05)
    assert [(jump.j, jump.name) for jump in arc.jumps] == [
        (0, "converter.sample"),
        (1, "machine.move"),
        (2, "hold.update"),
    ]
    assert arc.end["hold.held"] == 1.0


def test_against_the_order_of_the_signal_the_hold_answers_one_period_later():
    whole = AnalogDigitalLoop()
    parts = {name: whole.parts[name] for name in ("hold", "machine", "converter", "plant")}
    wires = {
        "converter.analog": "plant.x",
        "machine.symbol": "converter.code",
        "hold.digital": "machine.q",
        "plant.u": "hold.held",
    }
    arc = hm.simulate(hm.Composition("Reversed", parts, wires), 0.15)
    assert arc.at("hold.held", [0.05, 0.15]) == pytest.approx([0.0, 1.0])


def test_the_plant_under_a_constant_input_is_an_exponential():
    arc = hm.simulate(FirstOrderPlant(x=1.0, time_constant=0.5), 2.0, inputs={"u": 3.0})
    t = np.linspace(0.0, 2.0, 50)
    assert arc.at("x", t) == pytest.approx(3.0 - 2.0 * np.exp(-2.0 * t), abs=ROUNDING)

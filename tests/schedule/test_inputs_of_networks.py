"""What parts of a network are given from outside while it runs: the run of all parts together."""

import numpy as np
import pytest

import hybrid_model as hm

ENGINES = pytest.mark.parametrize("engine", ["native", "python"])


class Room(hm.HybridAutomaton):
    """A room with a thermostat, and warmth from the heater of the room beside it."""

    outside = hm.Input(5.0)
    beside = hm.Input(0.0, discrete=True)
    target = hm.Parameter(20.0, tunable=True)
    temperature = hm.State(18.0, output=True)
    on = hm.DiscreteState(0.0, output=True)

    def flow_map(self, s):
        return {"temperature": -0.1 * (s.temperature - s.outside) + 3.0 * s.on + 0.5 * s.beside}

    transitions = (
        hm.Jump(
            "start",
            lambda self, s: np.minimum(s.target - 1.0 - s.temperature, 0.5 - s.on),
            lambda self, s: {"on": 1.0},
        ),
        hm.Jump(
            "stop",
            lambda self, s: np.minimum(s.temperature - s.target - 1.0, s.on - 0.5),
            lambda self, s: {"on": 0.0},
        ),
    )


def rooms(count):
    parts = {f"room{k}": Room(temperature=18.0 + 0.3 * k) for k in range(count)}
    return hm.Composition("rooms", parts, {f"room{k}.beside": f"room{k - 1}.on" for k in range(1, count)})


TIMES, VALUES = [0.0, 3.0, 7.0, 20.0, 30.0], [5.0, 0.0, -5.0, 3.0, 10.0]
WEATHER = {
    "room0.outside": lambda t: 5.0 + 4.0 * np.sin(0.3 * t),
    "room1.outside": hm.Signal(lambda t: float(np.interp(t, TIMES, VALUES)), TIMES),
    "room2.outside": hm.Signal(lambda t: np.where(t < 6.0, np.exp(0.2 * t), 1.0), [6.0]),
    "room2.target": hm.Signal(lambda t: 20.0 if t < 6.0 else 21.0, [6.0, 9.0]),
    "room3.target": hm.Signal(lambda t: 20.0 if t < 25.0 else 15.0, [25.0]),
}
"""Traced; polynomials between breakpoints; traced between them; parameters, one of them at a breakpoint of an input."""


@ENGINES
def test_tables_and_functions_of_time_reach_the_parts(engine):
    network = rooms(4)
    apart = hm.simulate_network(network, 25.0, inputs=WEATHER, engine=engine)
    together = hm.simulate(network, 25.0, inputs=WEATHER)
    assert apart.engine.startswith(engine)
    assert len(apart.events) > 60
    for part in network.parts:
        for jump in ("start", "stop"):
            # Two integrators whose states agree to some 1e-11; rates at thresholds are of the order of one.
            theirs = together.event_times(f"{part}.{jump}")
            assert apart.event_times(part, jump) == pytest.approx(theirs, rel=0.0, abs=1e-9)
    grid = np.linspace(0.013, 24.987, 200)
    for name in ("temperature", "outside", "target"):
        theirs = np.array([together.at(f"{part}.{name}", grid) for part in network.parts])
        assert np.abs(apart.at(name, grid) - theirs).max() < 1e-9


class Bell(hm.HybridAutomaton):
    """Counts at a time of its own, at a change of what comes from outside, and at what it hears."""

    u = hm.Input(0.0, discrete=True)
    heard = hm.Input(0.0, discrete=True)
    level = hm.Parameter(0.5, tunable=True)
    seen = hm.DiscreteState(0.0)
    answered = hm.DiscreteState(0.0)
    rung = hm.DiscreteState(0, integer=True)
    sent = hm.DiscreteState(0.0, output=True)
    told = hm.Output(discrete=True)
    clock = hm.State(0.0)

    def flow_map(self, s):
        return {"clock": 1.0}

    def outputs(self, s):
        return {"told": 10.0 * s.level}

    transitions = (
        hm.TimeEvent("ring", lambda self, s: 2.0 + 2.0 * s.rung, lambda self, s: {"rung": s.rung + 1}),
        hm.Jump("see", lambda self, s: abs(s.u - s.seen) - s.level, lambda self, s: {"seen": s.u, "sent": s.sent + 1}),
        hm.Jump("hear", lambda self, s: abs(s.heard - s.answered) - 0.5, lambda self, s: {"answered": s.heard}),
    )


@ENGINES
@pytest.mark.parametrize("end", [4.0, 5.0])
def test_a_change_comes_before_the_jumps_of_its_instant(engine, end):
    """At 2 s all ring, and one is given a value that makes it jump, which another one hears."""
    inputs = {
        "b.u": hm.Signal(lambda t: np.floor(t / 2.0), [2.0, 4.0]),
        "a.level": hm.Signal(lambda t: 0.5 if t < 3.0 else 0.25, [3.0]),
    }
    network = hm.Composition("bells", {name: Bell() for name in "abc"}, {"a.heard": "b.sent", "c.heard": "a.told"})
    apart = hm.simulate_network(network, end, inputs=inputs, engine=engine)
    together = hm.simulate(network, end, inputs=inputs)
    mine = sorted((jump.t, f"{part}.{jump.name}") for part, jump in apart.jumps)
    assert mine == sorted((jump.t, jump.name) for jump in together.jumps)
    assert (3.0, "c.hear") in mine
    assert (end, "b.see") in mine or end > 4.0
    for part in "abc":
        own = [jump.name for name, jump in apart.jumps if name == part]
        assert own == [jump.name[2:] for jump in together.jumps if jump.name.startswith(part)]


@ENGINES
def test_order_of_events_within_the_instant_of_a_change(engine):
    inputs = {"b.u": hm.Signal(lambda t: 0.0 if t < 2.0 else 1.0, [2.0])}
    network = hm.Composition("bells", {name: Bell() for name in "ab"}, {"a.heard": "b.sent"})
    events = hm.simulate_network(network, 3.0, inputs=inputs, engine=engine).events
    together = hm.simulate(network, 3.0, inputs=inputs)
    names = [f"{'ab'[part]}.{events.jumps[0][jump]}" for part, jump in zip(events.part, events.jump, strict=True)]
    assert names == [jump.name for jump in together.jumps]


def test_what_cannot_be_traced_runs_in_python_and_is_named():
    table = {0: 5.0, 1: 6.0}
    inputs = {"room1.outside": lambda t: table[int(t)]}
    run = hm.simulate_network(rooms(2), 1.5, inputs=inputs)
    assert run.engine.startswith("python: the function of time given for input outside")
    with pytest.raises(hm.SimulationError, match=r"rooms cannot run on the native engine: .*outside"):
        hm.simulate_network(rooms(2), 1.5, inputs=inputs, engine="native")


def test_many_parts_with_tables_of_their_own_share_their_maps():
    """A table costs its part alone something, and none of them a compiler."""
    network = rooms(12)
    inputs = {
        f"room{k}.outside": hm.Signal(lambda t, k=k: 5.0 - k * (t > 0.1 * k), [0.1 * k, 20.0]) for k in range(1, 12)
    }
    apart = hm.simulate_network(network, 6.0, inputs=inputs, engine="native")
    together = hm.simulate(network, 6.0, inputs=inputs)
    theirs = np.array([together.at(f"{part}.temperature", 6.0) for part in network.parts])
    assert np.abs(apart.final("temperature") - theirs).max() < 1e-9


def corridor(count, **values):
    links = (np.arange(1, count), np.arange(count - 1))
    starts = 18.0 + 0.3 * np.arange(count)
    return hm.Network(
        "corridor", Room(), links, {"beside": "on"}, values={"temperature": starts, **values}, label="room", count=count
    )


SUN = hm.Signal(lambda t: float(np.interp(t, TIMES, VALUES)), TIMES)
OF_ARRAYS = {
    "shared function": {"outside": WEATHER["room0.outside"]},
    "shared table, some targets": {"outside": SUN, "target": [None, WEATHER["room2.target"], None, None]},
    "each its own": {"outside": [SUN, None, WEATHER["room0.outside"], hm.Signal(lambda t: 5.0 + (t > 3.0), [3.0])]},
}


@pytest.mark.parametrize("name", OF_ARRAYS)
@ENGINES
def test_parts_of_arrays_are_given_one_function_or_one_each(name, engine):
    network = corridor(4, outside=np.arange(4.0), target=[20.0, 20.5, 21.0, 19.5])
    apart = hm.simulate_network(network, 6.0, inputs=OF_ARRAYS[name], engine=engine)
    each = {key: value if isinstance(value, list) else [value] * 4 for key, value in OF_ARRAYS[name].items()}
    given = {f"room{k + 1}.{key}": one for key, ones in each.items() for k, one in enumerate(ones) if one is not None}
    together = hm.simulate(network.composition(), 6.0, inputs=given)
    assert apart.engine.startswith(engine)
    assert len(apart.events) > 10
    grid = np.linspace(0.013, 5.987, 30)
    for variable in ("temperature", "outside", "target", "on"):
        theirs = np.array([together.at(f"{part}.{variable}", grid) for part in network.parts])
        assert np.abs(apart.at(variable, grid) - theirs).max() < 1e-9


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"weather": SUN}, "each part of corridor has no input 'weather'"),
        ({"beside": SUN}, "corridor: beside is what parts hear of others: leave it out of the inputs"),
        ({"outside": [SUN] * 3}, "corridor: outside = .*one function of time or Signal for all parts, or a list of 4"),
        ({"outside": 5.0}, "corridor: outside = 5.0 among the inputs: .*numbers are given among the values"),
        ({"outside": "warm"}, "corridor: outside = 'warm' among the inputs"),
        ({"outside": [5.0] * 4}, "numbers are given among the values"),
    ],
)
def test_what_arrays_cannot_be_given_is_told(inputs, message):
    with pytest.raises(hm.WiringError, match=message):
        hm.simulate_network(corridor(4), 1.0, inputs=inputs)

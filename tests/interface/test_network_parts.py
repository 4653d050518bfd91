"""Networks that run part by part inside a Co-Simulation FMU, call for call beside the same network stepped as one.

Both are given the same random calls: steps of any length with and without event mode and early return, inputs and
tunable parameters set at communication points and in Event Mode, states saved, restored and moved as bytes, clocks,
derivatives. Reading must leave every byte of a state as it is.
"""

import functools
import random

import numpy as np
import pytest
from fmi_driver.binary import OK, Binary
from fmi_driver.component import Component
from parts_network import parts_network

import fmu.build.fmu_code
import hybrid_model as hm
from fmu.export import export_fmu

END = 3.0
TIMES, VALUES = 1e-8, 1e-9  # the limits of the issue; derivatives are of values
SETTINGS = {
    "3.0": [{"events": True, "early": True}, {"events": True}, {"early": True}, {}],
    "2.0": [{}],
}


@pytest.fixture(scope="module")
def binaries(exported, tmp_path_factory):
    """The network in parts and as one, by version."""

    def load(fmi):
        whole = tmp_path_factory.mktemp("whole") / "network.fmu"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(fmu.build.fmu_code, "assembly_code", lambda network: None)
            export_fmu(parts_network(), whole, fmi=fmi, sources=False)
        return Binary(exported(parts_network(), fmi=fmi)), Binary(whole)

    return functools.cache(load)


def near(one, other, limit):
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert abs(a - b) <= limit * max(1.0, abs(b)), (a, b)


class Pair:
    """The network in parts (`one`) and as one (`other`), and random calls of both."""

    def __init__(self, binaries, seed):
        self.rng = random.Random(seed)
        version = {3: "3.0", 2: "2.0"}[binaries[0].version]
        self.options = self.rng.choice(SETTINGS[version])
        self.has_events = bool(self.options.get("events"))
        self.one, self.other = (Component(binary, logging=True, **self.options) for binary in binaries)
        variables = binaries[0].variables
        self.floats = [name for name, v in variables.items() if v.type in ("Float64", "Real")]
        self.names = [name for name, (whole, _) in binaries[0].elements.items() if variables[whole].type != "Clock"]
        self.inputs = [name for name in self.floats if variables[name].causality == "input"]
        self.settable = self.inputs + [name for name in self.floats if variables[name].variability == "tunable"]
        self.unknowns = [n for n in self.floats if variables[n].causality == "output" or n.startswith("der(")]
        self.outputs = [name for name in self.floats if variables[name].causality == "output"]
        self.t = self.rng.choice([0.0, 0.0, 0.1])
        self.updates = self.forecasts = 0
        start = {name: self.rng.uniform(-1, 1) for name in ("p1.push", "p2.x") if self.rng.random() < 0.5}
        if version == "2.0" and self.rng.random() < 0.5:
            start["stop_at_events"] = 1
        stop = self.rng.choice([None, END])
        for component in self.both:
            component.initialize(self.t, stop, **start)
        if self.has_events:
            self.iterate()

    @property
    def both(self):
        return self.one, self.other

    def compare(self):
        before = self.one.bytes()
        names = self.names if self.rng.random() < 0.2 else self.rng.sample(self.names, 8)
        near([self.one.get(name) for name in names], [self.other.get(name) for name in names], VALUES)
        if self.rng.random() < 0.3:
            self.derivatives()
        assert self.one.bytes() == before

    def derivatives(self):
        unknowns, knowns = self.rng.sample(self.unknowns, 5), self.rng.sample(self.inputs, 3)
        calls = [("GetDirectionalDerivative", 3)] + [("GetAdjointDerivative", 5)] * (self.one.binary.version == 3)
        for function, n in calls:
            seeds = [self.rng.uniform(-1, 1) for _ in range(n)]
            found = [component.derivative(function, unknowns, knowns, seeds) for component in self.both]
            assert found[0][0] == found[1][0] == OK
            near(found[0][1], found[1][1], 10 * VALUES)

    def rates(self):
        names = self.rng.sample(self.outputs, 4)
        (status, one), (_, other) = (component.rates(names) for component in self.both)
        assert status == OK
        near(one, other, 10 * VALUES)

    def set(self):
        name, value = self.rng.choice(self.settable), self.rng.uniform(0.02, 0.4)
        for component in self.both:
            component.set(name, value)

    def iterate(self):
        again = True
        while again:
            if self.rng.random() < 0.2:
                self.set()
            assert self.one.ticks() == self.other.ticks()
            if self.rng.random() < 0.5:
                self.compare()
            one, other = (component.update() for component in self.both)
            assert one[:4] == other[:4]
            again, self.updates = one.again, self.updates + 1
        assert (one.next_time is None) == (other.next_time is None)
        if one.next_time is not None:
            # Where a look ahead has found nothing yet, it may end elsewhere.
            assert one.next_time > self.t
            self.forecasts += abs(one.next_time - other.next_time) <= TIMES
        for component in self.both:
            component.do("EnterStepMode")

    def event(self):
        for component in self.both:
            component.do("EnterEventMode")
        self.iterate()

    def save_or_move(self):
        state, place = self.one.bytes(), self.other.save()
        self.step()
        status, pointer = self.one.deserialize(state)
        assert status == OK
        if self.rng.random() < 0.5:
            self.one.free()
            self.one = Component(self.one.binary, logging=True, **self.options)
        self.one.load(pointer)
        self.one.forget(pointer)
        self.other.load(place)
        self.other.forget(place)
        assert self.one.bytes() == state

    def step(self):
        h = min(self.rng.choice([0.01, 0.1, 0.3, 1.0, self.rng.uniform(0, 0.5)]), END - self.t)
        one, other = (component.step(self.t, h) for component in self.both)
        assert one[:4] == other[:4]
        near([one.time], [other.time], TIMES)
        reached = (one.time, other.time)
        if one.event and self.has_events:
            self.event()
        if reached[0] != reached[1]:
            # They go on from one point, a little later.
            target = max(reached) + 1e-6
            results = [component.step(t, target - t) for component, t in zip(self.both, reached, strict=True)]
            if any(result.early or result.event for result in results):
                return False
            reached = (target, target)
        self.t = reached[0]
        return True

    def walk(self):
        while self.t < END - 1e-9:
            chance = self.rng.random()
            if chance < 0.2:
                self.set()
            elif chance < 0.35:
                self.compare()
            elif chance < 0.4:
                self.rates()
            elif chance < 0.48:
                t = self.t
                self.save_or_move()
                self.t = t
            elif chance < 0.53 and self.has_events:
                self.event()
            elif not self.step():
                break
        self.compare()
        for component in self.both:
            component.free()


def test_random_calls_in_parts_and_as_one(binaries):
    pairs = [Pair(binaries("3.0"), seed) for seed in range(11)]
    for pair in pairs:
        pair.walk()
    assert sum(pair.updates for pair in pairs) > 200
    assert sum(pair.forecasts for pair in pairs) > 100


@pytest.mark.long
@pytest.mark.parametrize("fmi", SETTINGS)
def test_many_random_calls_in_parts_and_as_one(fmi, binaries):
    for seed in range(100, 400):
        Pair(binaries(fmi), seed).walk()


def test_the_same_events_as_the_network_in_this_process(exported):
    """By the announced times alone, without a communication point elsewhere."""
    network = parts_network()
    component = Component(Binary(exported(network)), logging=True, events=True, early=True)
    update, t = component.begin(t_stop=END), 0.0
    while t < END:
        step = component.step(t, min(update.next_time, END) - t)
        assert not step.early
        t = min(update.next_time, END)
        if t < END or step.event:
            update = component.handle_event()
    events = hm.simulate_network(network, END).events
    parts = list(network.parts.items())
    names = [f"{parts[k][0]}.{parts[k][1].jumps[jump].name}" for k, jump in zip(events.part, events.jump, strict=True)]
    assert len(names) > 100
    assert [name for name, _ in component.jumps] == names
    near([time for _, time in component.jumps], events.t, 1e-12)
    component.free()


def test_a_run_in_parts_is_the_same_bit_by_bit_whoever_else_runs_and_wherever_its_states_are_moved(exported):
    """What parts share with each other is made anew where a state comes to another instance."""
    binary = Binary(exported(parts_network()))

    def instance():
        component = Component(binary, logging=True, events=True)
        return component, component.begin(t_stop=END)

    (still, update), (moved, _) = instance(), instance()
    t, moves = 0.0, 0
    while t < END:
        target = min(update.next_time, END)
        for component in (still, moved):
            assert not component.step(t, target - t).early
        t = target
        if t < END:
            update = still.handle_event()
            assert moved.handle_event() == update
        if len(still.jumps) // 10 > moves:
            moves += 1
            state = moved.bytes()
            moved.free()
            moved = Component(binary, logging=True, events=True)
            status, pointer = moved.deserialize(state)
            assert status == OK
            moved.load(pointer)
            moved.forget(pointer)
    assert moves > 10
    assert moved.bytes() == still.bytes()
    for component in (still, moved):
        component.free()


def test_states_saved_after_a_reset_keep_the_start_values(binaries):
    """What was computed from the whole before, such as derivatives, leaves nothing behind."""

    def run(component, save):
        assert component.enter_initialization() == OK
        component.set("p2.x", 0.7)
        if save:
            component.bytes()
        component.do("ExitInitializationMode")
        component.step(0.0, 0.5)
        return component.bytes()

    component = Component(binaries("3.0")[0])
    first = run(component, save=False)
    status, _ = component.derivative("GetDirectionalDerivative", ["p0.level"], ["p0.push"], [1.0])
    assert status == OK
    component.do("Reset")
    assert run(component, save=True) == first
    component.free()


class Weight(hm.HybridAutomaton):
    """Falls, and is thrown up again from the ground: more states than jump sets, and a flow set."""

    heard = hm.Input(0.0, discrete=True)
    x = hm.State([1.0, 0.0], shape=2, output=True)
    sent = hm.DiscreteState(0, integer=True, output=True)

    def flow_map(self, s):
        return {"x": [s.x[1], -9.81 + 0.01 * s.heard]}

    def flow_set(self, s):
        return s.x[0] + 1.0

    transitions = (
        hm.Jump(
            "bounce",
            lambda self, s: np.minimum(-s.x[0], -s.x[1] - 0.5),
            lambda self, s: {"x": [0.0, -0.9 * s.x[1]], "sent": s.sent + 1},
        ),
    )


def test_the_margins_are_those_of_the_parts_that_have_them(exported):
    parts = {f"w{k}": Weight(f"w{k}", x=[1.0 + k / 20, 0.0]) for k in range(16)}
    wires = {f"w{k}.heard": f"w{(k + 1) % 16}.sent" for k in range(16)}
    component = Component(Binary(exported(hm.Composition("weights", parts, wires))))
    component.begin()
    for k in range(12):
        component.step(0.07 * k, 0.07)
        values = component.values()
        states = [(values[f"{name}.x[1]"], values[f"{name}.x[2]"]) for name in parts]
        expected = [min(-x, -v - 0.5) for x, v in states]
        near([values[f"margin.{name}.bounce"] for name in parts], expected, 1e-12)
        near([values["margin.flow_set"]], [min(x for x, _ in states) + 1.0], 1e-12)
    assert sum(values[f"{name}.sent"] for name in parts) >= 16
    component.free()


class Echo(hm.HybridAutomaton):
    """Answers what it hears, and for ever once `loud`."""

    heard = hm.Input(0.0, discrete=True)
    loud = hm.Parameter(0.0, tunable=True)
    x = hm.State(0.0)
    mine = hm.DiscreteState(0.0)
    sent = hm.DiscreteState(0.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    transitions = (
        hm.Jump(
            "answer",
            lambda self, s: s.heard - s.mine - 0.5 + s.loud,
            lambda self, s: {"mine": s.heard, "sent": s.heard + 1.0},
        ),
    )


def test_after_the_end_in_event_mode_no_jump_is_shown_that_would_come_next(exported):
    parts = {f"e{k}": Echo(f"e{k}") for k in range(16)}
    wires = {f"e{k}.heard": f"e{(k - 1) % 16}.sent" for k in range(16)}
    component = Component(Binary(exported(hm.Composition("echoes", parts, wires))), events=True)
    component.begin()
    component.do("EnterEventMode")
    component.set("e3.loud", 1.0)
    _, update = component.iterate()
    assert update.terminate
    assert component.get("e3.sent") == 1.0
    assert component.get("e4.sent") == component.get("e4.mine") == 0.0
    component.free()

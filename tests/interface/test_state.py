"""A saved FMU state is the whole instance: get, run, set, run gives the same bits again, from wherever it was taken."""

import ctypes as c
import random

import pytest
from catalogue import cases
from fmu_driver import ERROR, OK, Instance, Library, Walk, advance
from witnesses import Cascade, Mix, Ramps

import hybrid_model as hm
from hybrid_model.models import BouncingBall


@pytest.fixture(scope="module")
def library(exported):
    found = {}

    def load(automaton, key):
        if key not in found:
            found[key] = Library(exported(automaton, key))
        return found[key]

    return load


MODELS = {
    "mix": (Mix, ("push",)),
    "cascade": (Cascade, ()),
    "bouncing_ball": (BouncingBall, ()),
    "agent2_dynamic": (lambda: cases()["agent2_dynamic"].automaton, ("neighbours[1]", "neighbours[2]")),
}
USES = {"early return": (True, True), "events inside": (True, False), "no event mode": (False, False)}


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", range(4))
def test_a_run_branches_bit_equal_from_any_call(name, use, seed, library):
    """Walk; save after a random number of calls; run; come back; run again; compare with a walk that never saved."""
    make, inputs = MODELS[name]
    loaded = library(make(), name)
    events, early = USES[use]
    rng = random.Random(f"{seed} {name} {use}")
    before, seeds = rng.randrange(1, 60), [rng.random() for _ in range(3)]

    def walk():
        instance = Instance(loaded, events=events, early=early)
        instance.initialize()
        return Walk(instance, inputs=inputs)

    straight = walk()
    straight.run(seeds[0], before)
    expected = straight.run(seeds[1], 60)
    saving = walk()
    saving.run(seeds[0], before)
    place, saved = saving.copy_place(), saving.instance.save()
    assert saving.run(seeds[2], 40) is not None
    saving.instance.load(saved)
    saving.return_to(place)
    assert saving.run(seeds[1], 60) == expected
    saving.instance.load(saved)
    saving.return_to(place)
    saving.instance.save(saved)
    assert saving.run(seeds[1], 60) == expected
    saving.instance.do("FreeFMUState", c.byref(saved))
    straight.instance.free()
    saving.instance.free()


def started(library, **starts):
    instance = Instance(library(Ramps(), "ramps"))
    instance.initialize(0.0, 2.0, **starts)
    return instance


def test_between_a_prediction_and_its_event(library):
    """The announced event comes at the announced bits of time, with a state saved on the way and without."""
    results = []
    for restore in (False, True):
        instance = started(library, rate_a=0.7, limit_a=0.53)
        _, update = instance.iterate()
        instance.do("EnterStepMode")
        assert instance.step(0.0, 0.3).status == OK
        if restore:
            saved = instance.save()
            assert instance.step(0.3, 1.2).early
            instance.do("EnterEventMode")
            instance.iterate()
            instance.load(saved)
            instance.do("FreeFMUState", c.byref(saved))
        step = instance.step(0.3, 1.7)
        assert (step.early, step.event, step.time) == (True, True, update.next_time)
        results.append((step, instance.values()))
        instance.free()
    assert results[0] == results[1]


def test_values_are_read_anew_after_coming_back(library):
    """Also where just the same values have been read before: nothing of the state left behind is shown."""
    instance = started(library, limit_a=0.25)
    for _ in range(2):
        initial, saved = instance.values(), instance.save()
        instance.iterate()
        instance.do("EnterStepMode")
        instance.step(0.0, 0.25)
        instance.do("EnterEventMode")
        assert instance.values() != initial
        instance.load(saved)
        assert instance.values() == initial
        instance.do("FreeFMUState", c.byref(saved))
    instance.free()


def test_event_that_pends(library):
    """After an early return, before Event Mode: the event is still there after coming back, with its clocks."""
    instance = started(library, limit_a=0.25)
    instance.iterate()
    instance.do("EnterStepMode")
    step = instance.step(0.0, 1.0)
    saved, results = instance.save(), []
    for _ in range(3):
        instance.do("EnterEventMode")
        results.append((instance.ticks(), instance.iterate(), instance.values()))
        instance.load(saved)
        assert instance.values()["a"] == pytest.approx(0.25, abs=1e-12)
    assert results[0] == results[1] == results[2]
    assert results[0][0] == ("ticks_a", "also_ticks_a")
    # Not handled, it holds up the next step at its very beginning.
    again = instance.step(step.time, 0.1)
    assert (again.event, again.early, again.time) == (True, True, step.time)
    instance.do("FreeFMUState", c.byref(saved))
    instance.free()


def test_in_the_middle_of_event_mode(library):
    instance = Instance(library(Cascade(), "cascade"))
    instance.initialize(links=6.0)
    instance.iterate()
    instance.do("EnterStepMode")
    instance.step(0.0, 1.5)
    instance.do("EnterEventMode")
    for _ in range(3):
        assert instance.update().again
    saved = instance.save()
    first = instance.iterate(), instance.values()
    instance.do("EnterStepMode")
    instance.step(instance.get("time"), 0.3)
    instance.load(saved)
    assert (instance.iterate(), instance.values()) == first
    assert len(first[0][0]) == 4
    instance.do("FreeFMUState", c.byref(saved))
    instance.free()


@pytest.mark.parametrize("mode", ["instantiated", "initialization", "terminated"])
def test_in_modes_without_time(mode, library):
    instance = Instance(library(Ramps(), "ramps"))
    instance.set("a", 0.1)
    if mode != "instantiated":
        instance.enter_initialization(1.0, 2.0)
        instance.set("limit_a", 0.6)
    if mode == "terminated":
        instance.do("ExitInitializationMode")
        instance.do("Terminate")
    saved, before = instance.save(), instance.values()
    instance.do("Reset")
    instance.initialize(5.0, b=0.4)
    instance.load(saved)
    assert instance.values() == before
    legal = {"instantiated": "Reset", "initialization": "ExitInitializationMode", "terminated": "Reset"}
    assert instance.call("EnterStepMode") == ERROR
    instance.do(legal[mode])
    instance.do("FreeFMUState", c.byref(saved))
    instance.free()


@pytest.mark.parametrize("use", USES)
def test_after_a_zeno_stop_an_earlier_state_can_be_taken_up(use, library):
    """The end is part of the state: behind it the run is over, before it the run goes on to the same end."""
    events, early = USES[use]
    instance = Instance(library(BouncingBall(), "bouncing_ball"), events=events, early=early)
    instance.initialize()
    walk = Walk(instance)
    while walk.t < 2.0:
        walk.call(random.Random(1))
    early_place, early_state = walk.copy_place(), instance.save()

    def to_the_end():
        rows = []
        while not walk.over:
            rows.append(walk.call(random.Random(2)))
        return rows

    first = to_the_end()
    message = instance.messages[-1]
    assert "accumulate at t = 2.5586" in message
    late_place, late_state = walk.copy_place(), instance.save()
    ended = instance.values()
    instance.load(early_state)
    walk.return_to(early_place)
    assert to_the_end() == first
    assert instance.messages[-1] == message
    instance.do("Reset")
    instance.load(late_state)
    walk.return_to(late_place)
    assert instance.values() == ended
    if walk.mode == "step":
        assert instance.step(walk.t, 0.1).status == ERROR
        assert "accumulate" in instance.messages[-1]
    else:
        assert instance.update().terminate
    for state in (early_state, late_state):
        instance.do("FreeFMUState", c.byref(state))
    instance.free()


def test_pointers(library):
    """An existing state is overwritten in place; freeing nothing, twice, or through NULL is no fault."""
    instance = started(library, limit_a=0.5)
    saved = instance.save()
    address = saved.value
    instance.iterate()
    instance.do("EnterStepMode")
    instance.step(0.0, 0.125)
    assert instance.save(saved).value == address
    instance.step(0.125, 0.125)
    instance.load(saved)
    assert instance.get("time") == 0.125
    instance.do("FreeFMUState", c.byref(saved))
    assert saved.value is None
    instance.do("FreeFMUState", c.byref(saved))
    instance.do("FreeFMUState", c.c_void_p(None))
    assert instance.call("SetFMUState", c.c_void_p(None)) == ERROR
    assert instance.get("time") == 0.125
    instance.free()


def test_a_state_of_another_model_is_refused(library):
    """Neither taken up nor overwritten: it may be smaller than this model's."""
    instance = started(library)
    other = Instance(library(Mix(), "mix"))
    foreign = other.save()
    assert instance.call("SetFMUState", foreign) == ERROR
    assert instance.call("GetFMUState", c.byref(foreign)) == ERROR
    assert all("not a state of this FMU" in message for message in instance.messages)
    other.load(foreign)
    other.do("FreeFMUState", c.byref(foreign))
    other.free()
    instance.free()


class Wheels(hm.HybridAutomaton):
    """Many wheels that turn for ever; one of them rings now and then."""

    wheels = hm.Dimension()
    a = hm.State(1.0, shape="wheels")
    b = hm.State(0.0, shape="wheels")
    rate = hm.Parameter(1.0, shape="wheels")
    rings = hm.DiscreteState(0, integer=True, output=True)
    bell = hm.Clock("jump")

    def flow_map(self, s):
        return {"a": -s.rate * s.b, "b": s.rate * s.a}

    def jump_set(self, s):
        return s.t - 30.0 * (s.rings + 1)

    def jump_map(self, s):
        return {"rings": s.rings + 1}


@pytest.mark.parametrize("obey", [True, False])
def test_the_look_ahead_of_a_large_model_stops_where_it_costs_too_much(obey, exported):
    """What it announces then is no event, and those that come are found all the same."""
    small, large = Wheels(wheels=2), Wheels(wheels=400)
    found = {}
    for name, automaton in (("small", small), ("large", large)):
        instance = Instance(Library(exported(automaton, f"wheels_{name}")))
        instance.initialize(0.0, 70.0)
        found[name] = instance.iterate()[1].next_time
        instance.do("EnterStepMode")
        instance.do("EnterEventMode")
        record = advance(instance, [0.0, 35.0, 70.0], obey=obey)
        assert [t for t, _ in record.ticks] == pytest.approx([30.0, 60.0], abs=1e-9)
        instance.free()
    assert found["small"] == pytest.approx(30.0, abs=1e-9)
    assert 0.0 < found["large"] < 20.0

"""A saved FMU state is the whole instance: get, run, set, run gives the same bits again, from wherever it was taken."""

import ctypes as c
import random

import pytest
from catalogue import cases
from fmi_driver.binary import ERROR, OK, Binary
from fmi_driver.journey import instance
from fmi_driver.runs import Walk, advance
from witnesses import Cascade, Mix, Ramps

import hybrid_model as hm
from hybrid_model.models import BouncingBall

MODELS = {
    # A model, and its inputs.
    "mix": (Mix, ("push",)),
    "cascade": (Cascade, ()),
    "bouncing_ball": (BouncingBall, ()),
    "agent2_dynamic": (None, ("neighbours[1]", "neighbours[2]")),
}
STEPPING = ["3.0 CS", "3.0 CS, events inside", "3.0 CS without events"]


@pytest.mark.parametrize("label", STEPPING)
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", range(4))
def test_a_run_branches_bit_equal_from_any_call(name, label, seed, binary, exported):
    """Walk; save after a random number of calls; run; come back; run again; compare with a walk that never saved."""
    model, inputs = MODELS[name]
    loaded = binary(model) if model else Binary(exported(cases()[name].automaton, name))
    rng = random.Random(f"{seed} {name} {label}")
    before, seeds = rng.randrange(1, 60), [rng.random() for _ in range(3)]

    def walk():
        component = instance(loaded, label)
        component.initialize()
        return Walk(component, inputs=inputs)

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
    saving.instance.forget(saved)
    straight.instance.free()
    saving.instance.free()


def started(make, **starts):
    component = make(Ramps, "3.0 CS")
    component.initialize(0.0, 2.0, **starts)
    return component


def test_between_a_prediction_and_its_event(make):
    """The announced event comes at the announced bits of time, with a state saved on the way and without."""
    results = []
    for restore in (False, True):
        component = started(make, rate_a=0.7, limit_a=0.53)
        _, update = component.iterate()
        component.do("EnterStepMode")
        assert component.step(0.0, 0.3).status == OK
        if restore:
            saved = component.save()
            assert component.step(0.3, 1.2).early
            component.do("EnterEventMode")
            component.iterate()
            component.load(saved)
            component.forget(saved)
        step = component.step(0.3, 1.7)
        assert (step.early, step.event, step.time) == (True, True, update.next_time)
        results.append((step, component.values()))
    assert results[0] == results[1]


def test_values_are_read_anew_after_coming_back(make):
    """Also where just the same values have been read before: nothing of the state left behind is shown."""
    component = started(make, limit_a=0.25)
    for _ in range(2):
        initial, saved = component.values(), component.save()
        component.iterate()
        component.do("EnterStepMode")
        component.step(0.0, 0.25)
        component.do("EnterEventMode")
        assert component.values() != initial
        component.load(saved)
        assert component.values() == initial
        component.forget(saved)


def test_event_that_pends(make):
    """After an early return, before Event Mode: the event is still there after coming back, with its clocks."""
    component = started(make, limit_a=0.25)
    component.iterate()
    component.do("EnterStepMode")
    step = component.step(0.0, 1.0)
    saved, results = component.save(), []
    for _ in range(3):
        component.do("EnterEventMode")
        results.append((component.ticks(), component.iterate(), component.values()))
        component.load(saved)
        assert component.values()["a"] == pytest.approx(0.25, abs=1e-12)
    assert results[0] == results[1] == results[2]
    assert results[0][0] == ("ticks_a", "also_ticks_a")
    # Not handled, it holds up the next step at its very beginning.
    again = component.step(step.time, 0.1)
    assert (again.event, again.early, again.time) == (True, True, step.time)
    component.forget(saved)


def test_in_the_middle_of_event_mode(make):
    component = make(Cascade, "3.0 CS")
    component.initialize(links=6.0)
    component.iterate()
    component.do("EnterStepMode")
    component.step(0.0, 1.5)
    component.do("EnterEventMode")
    for _ in range(3):
        assert component.update().again
    saved = component.save()
    first = component.iterate(), component.values()
    component.do("EnterStepMode")
    component.step(component.get("time"), 0.3)
    component.load(saved)
    assert (component.iterate(), component.values()) == first
    assert len(first[0][0]) == 4
    component.forget(saved)


@pytest.mark.parametrize("mode", ["instantiated", "initialization", "terminated"])
def test_in_modes_without_time(mode, make):
    component = make(Ramps, "3.0 CS")
    component.set("a", 0.1)
    if mode != "instantiated":
        assert component.enter_initialization(1.0, 2.0) == OK
        component.set("limit_a", 0.6)
    if mode == "terminated":
        component.do("ExitInitializationMode")
        component.do("Terminate")
    saved, before = component.save(), component.values()
    component.do("Reset")
    component.initialize(5.0, b=0.4)
    component.load(saved)
    assert component.values() == before
    legal = {"instantiated": "Reset", "initialization": "ExitInitializationMode", "terminated": "Reset"}
    assert component.call("EnterStepMode") == ERROR
    component.do(legal[mode])
    component.forget(saved)


@pytest.mark.parametrize("label", STEPPING)
def test_after_a_zeno_stop_an_earlier_state_can_be_taken_up(label, make):
    """The end is part of the state: behind it the run is over, before it the run goes on to the same end."""
    component = make(BouncingBall, label)
    component.initialize()
    walk = Walk(component)
    while walk.t < 2.0:
        walk.call(random.Random(1))
    early_place, early_state = walk.copy_place(), component.save()

    def to_the_end():
        rows = []
        while not walk.over:
            rows.append(walk.call(random.Random(2)))
        return rows

    first = to_the_end()
    message = component.errors[-1]
    assert "accumulate at t = 2.5586" in message
    late_place, late_state = walk.copy_place(), component.save()
    ended = component.values()
    component.load(early_state)
    walk.return_to(early_place)
    assert to_the_end() == first
    assert component.errors[-1] == message
    component.do("Reset")
    component.load(late_state)
    walk.return_to(late_place)
    assert component.values() == ended
    if walk.mode == "step":
        assert component.step(walk.t, 0.1).status == ERROR
        assert "accumulate" in component.errors[-1]
    else:
        assert component.update().terminate
    for state in (early_state, late_state):
        component.forget(state)


def test_pointers(make):
    """An existing state is overwritten in place; freeing nothing, twice, or through NULL is no fault."""
    component = started(make, limit_a=0.5)
    saved = component.save()
    address = saved.value
    component.iterate()
    component.do("EnterStepMode")
    component.step(0.0, 0.125)
    assert component.save(saved).value == address
    component.step(0.125, 0.125)
    component.load(saved)
    assert component.get("time") == 0.125
    component.forget(saved)
    assert saved.value is None
    component.forget(saved)
    component.do("FreeFMUState", c.c_void_p(None))
    assert component.call("SetFMUState", c.c_void_p(None)) == ERROR
    assert component.get("time") == 0.125


def test_a_state_of_another_model_is_refused(make):
    """Neither taken up nor overwritten: it may be smaller than this model's."""
    component = started(make)
    other = make(Mix, "3.0 CS")
    foreign = other.save()
    assert component.call("SetFMUState", foreign) == ERROR
    assert component.call("GetFMUState", c.byref(foreign)) == ERROR
    assert all("not a state of this FMU" in message for message in component.errors)
    other.load(foreign)
    other.forget(foreign)


class Wheels(hm.HybridAutomaton):
    """Many wheels that turn for ever; one of them rings now and then."""

    wheels = hm.Dimension()
    a = hm.State(1.0, shape="wheels")
    b = hm.State(0.0, shape="wheels")
    rate = hm.Parameter(20.0, shape="wheels")
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
    small, large = Wheels(wheels=2), Wheels(wheels=60)
    found = {}
    for name, automaton in (("small", small), ("large", large)):
        component = instance(Binary(exported(automaton, f"wheels_{name}")), "3.0 CS")
        component.initialize(0.0, 70.0)
        found[name] = component.iterate()[1].next_time
        component.do("EnterStepMode")
        component.do("EnterEventMode")
        record = advance(component, [0.0, 35.0, 70.0], obey=obey)
        assert [t for t, _ in record.ticks] == pytest.approx([30.0, 60.0], abs=1e-9)
        component.free()
    assert found["small"] == pytest.approx(30.0, abs=1e-9)
    assert 0.0 < found["large"] < 20.0

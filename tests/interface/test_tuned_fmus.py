"""Tunable parameters of FMUs: set at events and communication points, in both versions and in every way of use."""

import itertools
import zipfile

import pytest
from fmi_driver.binary import ERROR, OK, Binary
from fmi_driver.component import Component
from own_importer import exchange, step_through
from tuned import CHANGES, JUMPS, POINTS, T_END, TIMES, Tuned, TunedAndDriven, exact

import hybrid_model as hm
from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity
from hybrid_model.native.networks.network import worth_looping

# The engine locates to the last bits; own_importer integrates Model Exchange to 1e-12 and bisects.
TIME, STATE = 1e-9, 1e-9

NAMES = [name for name in exact(0.0) if name not in ("last", "weight", "rest")]
VERSIONS = pytest.mark.parametrize("fmi", ["2.0", "3.0"])


EVENTS, PLAIN = "3.0 CS", "3.0 CS without events"
STEPPING = pytest.mark.parametrize("label", ["2.0 CS", PLAIN])
KINDS = pytest.mark.parametrize("label", ["2.0 CS", "2.0 ME", EVENTS, "3.0 ME"])


def check_jumps(jumps, tolerance=TIME):
    assert [name for name, _ in jumps] == [name for _, name in JUMPS]
    assert [t for _, t in jumps] == pytest.approx([t for t, _ in JUMPS], abs=tolerance)


def check_values(component, t):
    for name, value in exact(t).items():
        assert component.get(name) == pytest.approx(value, abs=STATE), (name, t)


def gains(fmi):
    """The one array among the parameters, which FMI 2.0 has element by element."""
    return {"gains"} if fmi == "3.0" else {"gains[1]", "gains[2]"}


def tuned_at(t):
    return {name: value for name, rows in CHANGES.items() for at, value in rows if at == t}


WAYS = {
    # Setting, and where parameters are set; an importer that ignores the announced times steps over them.
    "3.0, event mode": (EVENTS, "event"),
    "3.0, event mode, nobody obeys": (EVENTS, "ignore"),
    "3.0, event mode, set in step mode": (EVENTS, "step"),
    "3.0, event mode, no early return": ("3.0 CS, events inside", "step"),
    "3.0, no event mode": (PLAIN, "step"),
    "2.0": ("2.0 CS", "step"),
}


@pytest.mark.parametrize(
    ("way", "model"), [*((way, Tuned) for way in WAYS), *((way, TunedAndDriven) for way in WAYS if way != "2.0")]
)
def test_co_simulation_gives_the_run_in_closed_form(way, model, make):
    label, setting = WAYS[way]
    component = make(model, label, logging=True)
    update = component.begin(0.0, T_END)
    points = sorted({0.0, T_END, *TIMES, *POINTS})
    for start, end in itertools.pairwise(points):
        changes = tuned_at(start)
        if changes and setting in ("event", "ignore"):
            component.do("EnterEventMode")
        for name, value in changes.items():
            component.set(name, value)
            assert component.get(name) == value
        if changes and setting in ("event", "ignore"):
            update = component.settle()
        t = start
        while t < end:
            announced = update.next_time if update and setting == "event" else None
            made = component.step(t, (end if announced is None else min(end, announced)) - t)
            assert made.status == OK, component.log
            t = made.time
            if made.event and component.events:
                update = component.handle_event()
        if end in POINTS:
            check_values(component, end)
    check_jumps(component.jumps)


@VERSIONS
def test_an_importer_of_model_exchange_tunes_at_its_events(fmi, binary):
    run = exchange(binary(Tuned, fmi).fmu, T_END, list(POINTS), steps=CHANGES, names=NAMES)
    check_jumps([(name, t) for t, name in run.jumps], 1e-8)
    for name in NAMES:
        assert run.values[name] == pytest.approx([exact(t)[name] for t in run.times], abs=1e-8)


def test_our_importer_of_version_2_steps_through(binary):
    run = step_through(binary(Tuned, "2.0").fmu, T_END, list(POINTS), steps=CHANGES, names=NAMES)
    check_jumps([(name, t) for t, name in run.jumps])


def test_a_change_in_event_mode_renews_what_was_foretold(make):
    component = make(Tuned, EVENTS)
    assert component.begin(0.0, 5.0).next_time == pytest.approx(0.45)
    for name, value, time in (("period", 0.3, 0.3), ("slope", 4.0, 0.25), ("slope", 1.0, 0.3), ("g", 200.0, 0.09)):
        component.do("EnterEventMode")
        component.set(name, value)
        assert component.settle().next_time == pytest.approx(time, abs=1e-12)


def test_a_guard_that_a_change_makes_true_is_seen_before_it_is_taken(make):
    """In Event Mode outputs and clocks show the jump that comes next at this instant."""
    component = make(Tuned, EVENTS)
    component.begin(0.0, 5.0)
    assert component.step(0.0, 0.4).time == 0.4
    component.do("EnterEventMode")
    assert component.ticks() == ()
    component.set("limit", 0.25)
    assert component.ticks() == ("round_clock",)
    assert (component.get("x"), component.get("rounds"), component.get("rest")) == (0.0, 1, 1.0)
    component.settle()
    assert component.get("rounds") == 1


def test_a_guard_that_a_change_makes_true_ends_the_next_step_where_it_begins(make):
    component = make(Tuned, EVENTS)
    component.begin(0.0, 5.0)
    component.step(0.0, 0.4)
    component.set("limit", 0.25)
    made = component.step(0.4, 0.1)
    assert (made.status, made.event, made.early, made.time) == (OK, True, True, 0.4)


@KINDS
def test_states_hold_the_tuned_values_and_reset_brings_back_the_start_values(label, make):
    component = make(Tuned, label)
    component.begin()
    fresh = component.save()
    if component.starts_in_event_mode:
        component.do("EnterEventMode")
    component.set("limit", 0.25)
    component.set("g", 4.0)
    tuned = component.save()
    data = component.serialize(tuned)
    component.load(fresh)
    assert (component.get("limit"), component.get("weight")) == (1.0, 16.0)
    status, restored = component.deserialize(data)
    assert status == OK
    component.load(restored)
    assert (component.get("limit"), component.get("weight")) == (0.25, 8.0)
    component.do("Reset")
    assert (component.get("limit"), component.get("weight")) == (1.0, 16.0)
    for state in (fresh, tuned, restored):
        component.forget(state)


@KINDS
def test_when_parameters_may_be_set(label, make):
    """Tunable ones at events and communication points, in Continuous-Time Mode never; fixed ones before the start."""
    component = make(Tuned, label)
    assert (component.try_set("limit", 0.9), component.try_set("mass", 1.0)) == (OK, OK)
    component.enter_initialization()
    assert (component.try_set("limit", 0.8), component.try_set("mass", 1.5)) == (OK, OK)
    component.do("ExitInitializationMode")
    assert (component.try_set("limit", 0.7), component.try_set("mass", 1.0)) == (OK, ERROR)
    assert "'mass' cannot be set in the state" in component.errors[-1]
    if component.starts_in_event_mode:
        component.settle()
        assert component.try_set("limit", 0.6) == (OK if component.kind == "cs" else ERROR)
    component.do("Terminate")
    assert component.try_set("limit", 0.5) == ERROR


@STEPPING
def test_elements_of_arrays_are_tuned(label, make):
    component = make(Tuned, label)
    component.begin()
    component.step(0.0, 0.4)
    assert component.get("mix") == pytest.approx(0.4, abs=STATE)
    component.set("gains[1]", 5.0)
    component.set("gains[2]", 2.0)
    assert component.get("mix") == pytest.approx(2.0, abs=STATE)
    component.step(0.4, 0.2)
    # The timer has ticked at 0.55 s.
    assert component.get("mix") == pytest.approx(5.0 * 0.6 + 2.0, abs=STATE)


@STEPPING
def test_values_that_are_no_numbers_are_refused(label, make):
    component = make(Tuned, label)
    component.begin()
    for value in (float("nan"), float("inf")):
        assert component.try_set("limit", value) == ERROR
    assert component.get("limit") == 1.0


def test_an_intermediate_update_is_no_event(make):
    found = []

    def look(environment, time, *flags):
        found.append(component.try_set("limit", 0.25))

    component = make(Tuned, PLAIN, intermediate=look)
    component.begin()
    component.step(0.0, 0.4)
    assert set(found) == {ERROR}
    assert component.get("limit") == 1.0


@STEPPING
def test_derivatives_are_those_at_the_tuned_values(label, make):
    component = make(Tuned, label)
    component.begin()
    component.step(0.0, 0.4)
    component.set("limit", 0.5)
    assert component.derivative("GetDirectionalDerivative", ["rest"], ["x"], [1.0]) == (OK, [-2.0])
    assert component.derivative("GetDirectionalDerivative", ["rest"], ["limit"], [1.0])[1] == pytest.approx([1.6])


@VERSIONS
def test_the_description_says_which_are_tunable(fmi, binary):
    loaded = binary(Tuned, fmi)
    found = {name: v.variability for name, v in loaded.variables.items() if v.causality == "parameter"}
    assert {name for name, variability in found.items() if variability == "tunable"} == {*CHANGES, *gains(fmi)}
    assert found["mass"] == "fixed"
    [output] = [u for u in loaded.description.outputs if u.variable.name == "rest"]
    kinds = {v.name: kind for v, kind in zip(output.dependencies, output.dependenciesKind, strict=True)}
    assert kinds["x"] == "tunable"
    # rest = 1 - x / limit; FMI 2.0 has no parameters among the knowns of a running FMU.
    assert kinds == {"x": "tunable"} | ({"limit": "dependent"} if fmi == "3.0" else {})
    [weight] = [u for u in loaded.description.outputs if u.variable.name == "weight"]
    assert [v.name for v in weight.dependencies] == (["g"] if fmi == "3.0" else [])
    [fall] = [u for u in loaded.description.derivatives if u.variable.name == "der(v)"]
    assert [v.name for v in fall.dependencies] == (["g"] if fmi == "3.0" else [])


@VERSIONS
def test_the_checker_and_the_page_know_them(fmi, binary):
    path = binary(Tuned, fmi).fmu
    assert {finding.severity for finding in check_fmu(path).findings} <= {Severity.NOTE}
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert page.count("tunable parameter") == len(CHANGES) + len(gains(fmi))
    assert "may be set" in page


def network():
    return hm.Composition("TunedChoir", {part: Tuned(part) for part in "abcdefghijklmn"})


def test_each_part_of_a_network_has_its_own(exported):
    """In a large network parts with equal maps share them, as loops over tables."""
    assert worth_looping(network())
    component = Component(Binary(exported(network(), "tuned-choir")), "cs", logging=True)
    component.begin()
    inputs = {"b.limit": hm.Signal(lambda t: 0.25 if t >= 0.4 else 1.0, [0.4])}
    arc = hm.simulate(network(), 1.2, inputs=inputs)
    component.step(0.0, 0.4)
    component.set("b.limit", 0.25)
    component.step(0.4, 0.8)
    assert sorted(component.jumps) == [(j.name, pytest.approx(j.t, abs=TIME)) for j in sorted(arc.jumps, key=by_name)]
    assert [t for name, t in component.jumps if name == "b.round"] == pytest.approx([0.4, 0.65, 0.9, 1.15], abs=TIME)
    assert [t for name, t in component.jumps if name == "c.round"] == pytest.approx([1.0], abs=TIME)
    component.free()


def by_name(jump):
    return jump.name, jump.t

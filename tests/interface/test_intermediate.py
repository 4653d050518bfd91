"""Intermediate updates, the log of events, clocks and Configuration Mode."""

import ctypes as c
import math

import numpy as np
import pytest
from fmi_driver.binary import ERROR, OK, Binary, references
from fmi_driver.calls import TABLE
from fmi_driver.component import Component
from fmi_driver.journey import SETTINGS, Journey
from witnesses import Cascade, Mix, Ramps
from witnesses_driven import Tank

import hybrid_model as hm
from hybrid_model.consensus.weights.gated_sine import GatedSineWeights

PLAIN = "3.0 CS without events"
NOT_YET_KNOWN, UNCHANGED, CHANGED = range(3)
USES = pytest.mark.parametrize(
    ("events", "early"), [(True, True), (True, False), (False, True), (False, False)], ids=str
)


class Watched:
    """An instance whose intermediate updates are recorded, and answered by `answer(time, may end)` if there is one."""

    def __init__(self, make, answer=None, *, act=None, **options):
        self.answer, self.act, self.calls, self.problem = answer, act, [], None
        self.component = make(Tank, PLAIN, intermediate=self.update, logging=True, **options)

    def update(self, environment, time, set_requested, get_allowed, finished, may_end, asked, end):
        try:
            self.calls.append((time, set_requested, get_allowed, finished, may_end))
            if self.act:
                self.act(self.component, time)
            wanted = self.answer(time, may_end) if self.answer else None
            if wanted is not None:
                asked[0], end[0] = True, wanted
        except Exception as error:  # noqa: BLE001 - an exception must not pass through C
            self.problem = error


def level(t, inflow=0.5, drain=0.1):
    return inflow / drain * (1.0 - math.exp(-drain * t))


@USES
def test_the_importer_sees_the_state_on_the_way(events, early, make):
    def look(component, time):
        assert component.get("time") == time
        # The tank's level in closed form; the FMU promises 1e-8.
        assert component.get("level") == pytest.approx(level(time), abs=1e-8)
        assert component.get("rate") == pytest.approx(0.5 - 0.1 * level(time), abs=1e-8)
        status, [slope] = component.rates(["level"])
        assert (status, slope) == (OK, pytest.approx(0.5 - 0.1 * level(time), abs=1e-8))

    watched = Watched(make, events=events, early=early, act=look)
    watched.component.begin()
    for k in range(4):
        found = watched.component.step(k * 0.4, 0.4)
        assert (found.status, found.early) == (OK, False)
    assert watched.problem is None
    times = [time for time, *_ in watched.calls]
    assert len(times) > 8
    assert times == sorted(set(times))
    assert {call[1:] for call in watched.calls} == {(True, True, True, early)}
    assert watched.component.log == []


@USES
def test_being_watched_changes_nothing_but_roundings(events, early, make):
    runs = []
    for watch in (True, False):
        options = {"events": events, "early": early}
        component = Watched(make, **options).component if watch else make(Tank, PLAIN, logging=True, **options)
        journey = Journey(component)
        runs.append([journey.go_to(t)[2]["level"] for t in (0.7, 1.9, 2.6, 5.0)] + [t for _, t in component.jumps])
    assert len(runs[0]) == 6
    np.testing.assert_allclose(runs[0], runs[1], rtol=0, atol=1e-10)


@USES
def test_inputs_set_on_the_way_act_from_there(events, early, make):
    """The inflow is stopped at the first call at or after 0.5: what is in the tank then drains away."""
    stopped = []

    def stop(component, time):
        if time >= 0.5 and not stopped:
            stopped.append(time)
            component.set("inflow", 0.0)

    watched = Watched(make, events=events, early=early, act=stop)
    watched.component.begin()
    assert watched.component.step(0.0, 1.5).status == OK
    assert watched.problem is None
    [moment] = stopped
    expected = level(moment) * math.exp(-0.1 * (1.5 - moment))
    assert watched.component.get("level") == pytest.approx(expected, abs=1e-8)


def test_discrete_inputs_parameters_and_the_step_itself_are_not_for_updates(make):
    forbidden = [row for row in TABLE if TABLE[row].version in (0, 3)
                 and not row.startswith(("Get", "Set", "Ser", "Des", "Free"))]  # fmt: skip
    statuses = {}

    def meddle(component, time):
        if statuses:
            return
        statuses["valve"] = component.try_set("valve", 1.0)
        statuses["drain"] = component.try_set("drain", 1.0)
        statuses["level"] = component.try_set("level", 1.0)
        component.saved, component.saved_bytes = c.c_void_p(), b"0"
        for row in (*forbidden, "GetFMUState", "SetFMUState"):
            if row == "DoStep":
                statuses[row] = component.step(time, 0.1).status
            elif row not in ("EvaluateDiscreteStates", "ActivateModelPartition"):
                arguments = TABLE[row].arguments(component)
                statuses[row] = component.call(row.strip(), *arguments)
        component.binary.functions.fmi3FreeInstance(c.c_void_p(component.handle))

    watched, plain = Watched(make, act=meddle), Watched(make)
    for each in (watched, plain):
        each.component.begin()
        assert each.component.step(0.0, 1.5).status == OK
    assert watched.problem is None
    assert set(statuses.values()) == {ERROR}
    assert len(statuses) > 12
    assert len(watched.component.errors) == len(statuses) + 1
    assert "fmi3FreeInstance" in watched.component.errors[-1]
    assert watched.component.values() == plain.component.values()


@pytest.mark.parametrize("delay", [0.0, 1e-9, 0.013, 10.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("events", [True, False])
def test_early_return_where_the_importer_asks_for_it(events, delay, make):
    asked = []

    def answer(time, may_end):
        assert may_end
        if time >= 0.5:
            asked.append(time)
            return time + delay
        return None

    watched = Watched(make, answer, events=events, early=True)
    watched.component.begin()
    found = watched.component.step(0.0, 1.2)
    assert watched.problem is None
    assert (found.status, found.event, found.terminate) == (OK, False, False)
    if 0.0 <= delay < 1.0 or delay == -1.0:
        # Where it asked for, and never before the time that it was asked at: the FMU does not go back.
        earliest = max(asked[0], asked[-1] + max(delay, 0.0))
        assert found.early
        assert asked[0] <= found.time <= earliest
        assert found.time == pytest.approx(asked[0] + max(delay, 0.0), abs=1e-15) or len(asked) > 1
    else:
        assert (found.early, found.time) == (False, 1.2)
    assert watched.component.get("time") == found.time
    assert watched.component.get("level") == pytest.approx(level(found.time), abs=1e-8)
    # And on from there.
    watched.answer = None
    assert watched.component.step(found.time, 1.5 - found.time).status == OK
    assert watched.component.get("level") == pytest.approx(level(1.5), abs=1e-8)


@pytest.mark.parametrize("events", [True, False])
def test_an_importer_that_always_asks_still_gets_on(events, make):
    watched = Watched(make, lambda time, may_end: time, events=events, early=True)
    watched.component.begin()
    t, n = 0.0, 0
    while t < 1.0:
        found = watched.component.step(t, 1.0 - t)
        assert found.time > t
        t, n = found.time, n + 1
        assert n < 2000
    assert n > 10
    assert watched.component.get("level") == pytest.approx(level(1.0), abs=1e-8)


def test_without_leave_to_return_early_a_wish_is_not_followed(make):
    watched = Watched(make, lambda time, may_end: time, early=False)
    watched.component.begin()
    assert watched.component.step(0.0, 1.0)[:4] == (OK, False, False, False)
    assert watched.component.get("time") == 1.0


def test_intermediate_variables_that_are_none_are_refused(make, binary):
    loaded = binary(Tank)
    component = make(Tank, PLAIN, required=[loaded.reference("level"), len(loaded.variables)])
    assert component.handle is None
    assert str(len(loaded.variables)) in component.errors[0]
    handle = loaded.functions.fmi3InstantiateCoSimulation(
        b"block", loaded.token, None, *[c.c_bool(False)] * 4, None, c.c_size_t(1), None, component.listen, None
    )
    assert handle is None
    assert len(component.errors) == 2
    make(Tank, PLAIN, required=[loaded.reference("level"), loaded.reference("inflow")]).begin()


# The log.


@pytest.mark.parametrize("label", SETTINGS)
@pytest.mark.parametrize("automaton", [Mix, Cascade])
def test_the_log_of_events_is_the_list_of_jumps(label, automaton, make):
    component = make(automaton, label, logging=True)
    journey = Journey(component)
    for t in (0.3, 0.61, 1.05, 2.2):
        journey.go_to(t)
    expected = [jump for jump in hm.simulate(automaton(), 2.2).jumps if jump.name != "switch"]
    assert [jump for jump, _ in component.jumps] == [jump.name for jump in expected]
    np.testing.assert_allclose([t for _, t in component.jumps], [jump.t for jump in expected], rtol=0, atol=1e-7)
    assert len(expected) > 5
    assert {line.status for line in component.log} == {OK}


@pytest.mark.parametrize("label", SETTINGS)
def test_categories(label, make):
    """Errors are told in any case; events only while logging is on, and among the categories asked for."""
    component = make(Ramps, label)
    journey = Journey(component, limit_a=0.25)

    def choose(on, *categories):
        array = (c.c_char_p * max(len(categories), 1))(*categories)
        return component.call("SetDebugLogging", component.binary.boolean(on), c.c_size_t(len(categories)), array)

    counts = []
    for k, (on, categories) in enumerate(
        [(True, ()), (True, (b"logEvents",)), (True, (b"logStatusError",)), (False, ()), (False, (b"logEvents",)),
         (True, (b"logStatusError", b"logEvents"))]
    ):  # fmt: skip
        assert choose(on, *categories) == OK
        journey.go_to((k + 1) * 0.25 + 0.1)
        counts.append(len(component.jumps))
        assert component.call("ExitInitializationMode") == ERROR
        assert len(component.errors) == k + 1
    assert counts == [1, 2, 2, 2, 2, 3]
    assert choose(True, b"logEvents", b"%s%n") == ERROR
    assert "'%s%n'" in component.errors[-1]
    array = (c.c_char_p * 1)(None)
    assert component.call("SetDebugLogging", component.binary.boolean(True), c.c_size_t(1), array) == ERROR


@pytest.mark.parametrize("label", SETTINGS)
def test_without_a_logger_all_is_quiet(label, make):
    for logging in (True, False):
        component = make(Ramps, label, logger=False, logging=logging)
        journey = Journey(component, limit_a=0.25)
        journey.go_to(0.6)
        assert component.call("ExitInitializationMode") == ERROR
        assert component.try_set("limit_a", 1.0) == ERROR
        assert component.try_set("a", math.nan) == ERROR
        assert component.access("Get", component.binary.float_type, [2**32 - 1], [1.0]) == (ERROR, [1.0])
        component.do("SetDebugLogging", component.binary.boolean(True), c.c_size_t(0), None)
        journey.go_to(1.1)
        assert component.log == []


@pytest.mark.parametrize("label", SETTINGS)
def test_strings_are_copied(label, make, binary):
    """The importer may free name and token as soon as the instance is there; markers in names stay what they are."""
    name = c.create_string_buffer(b"first %s%n")
    token = c.create_string_buffer(binary(Ramps, SETTINGS[label]["fmi"]).token)
    component = make(Ramps, label, name=name, token=token)
    c.memset(name, ord("x"), len(name))
    c.memset(token, ord("x"), len(token))
    assert component.call("ExitInitializationMode") == ERROR
    assert component.errors[0].startswith("first %s%n: fmi")


@pytest.mark.parametrize("label", SETTINGS)
@pytest.mark.parametrize("logger", [True, False])
@pytest.mark.parametrize(
    ("options", "word"),
    [({"token": b"another"}, "another"), ({"token": b""}, "token"), ({"token": b"%s%n%s%n"}, "%s%n%s%n"),
     ({"name": b""}, "name"), ({"name": b" \t\n"}, "name"), ({"name": None}, "name"), ({"token": b"x" * 5000}, "xxx")],
)  # fmt: skip
def test_a_wrong_name_or_token_gives_no_instance(label, logger, options, word, make):
    component = make(Ramps, label, logger=logger, **options)
    assert component.handle is None
    assert len(component.errors) == logger
    assert all(word in text for text in component.errors)


# Clocks.


def interval(component):
    """Status, interval and qualifier of the countdown clock."""
    value, qualifier = c.c_double(math.pi), c.c_int(7)
    clock = references([component.binary.reference("next_event")])
    status = component.call("GetIntervalDecimal", clock, c.c_size_t(1), c.byref(value), c.byref(qualifier))
    return status, value.value, qualifier.value


@pytest.mark.parametrize("label", ["3.0 CS", "3.0 CS, events inside", "3.0 ME"])
def test_the_countdown_clock_tells_how_long_it_is_to_the_next_event(label, make):
    component = make(Ramps, label)
    assert component.enter_initialization(1.0) == OK
    component.set("first", 1.5)
    component.set("period", 0.25)
    assert interval(component)[::2] == (OK, NOT_YET_KNOWN)
    component.do("ExitInitializationMode")
    assert interval(component)[::2] == (OK, NOT_YET_KNOWN)  # not before the first update
    t = 1.0
    for k in range(4):
        update = component.update()
        while update.again:
            update = component.update()
        if component.kind == "me":
            # Guards are the importer's to find, so only time events could be foretold: that is no prediction.
            assert interval(component)[2] in (NOT_YET_KNOWN, CHANGED)
        else:
            expected = 1.5 + k * 0.25 - t
            assert interval(component) == (OK, pytest.approx(expected, abs=1e-12), CHANGED)
            assert interval(component) == (OK, pytest.approx(expected, abs=1e-12), UNCHANGED)
            assert update.next_time == pytest.approx(1.5 + k * 0.25, abs=1e-12)
        component.do("EnterStepMode" if component.kind == "cs" else "EnterContinuousTimeMode")
        assert interval(component)[0] == ERROR
        if component.kind == "cs":
            found = component.step(t, update.next_time - t)
            assert (found.status, found.event) == (OK, True)
        else:
            component.do("SetTime", c.c_double(update.next_time))
        t = update.next_time
        component.do("EnterEventMode")
        # The importer activates the clock; the event comes by its time in any case.
        tick = (c.c_bool * 1)(k % 2 == 0)
        clock = references([component.binary.reference("next_event")])
        assert component.call("SetClock", clock, c.c_size_t(1), tick) == OK
        assert component.ticks() == ("ticks_timer",)
    assert component.get("rounds") == 4  # the view of Event Mode: with the event that is due
    assert len(component.log) == 4  # the refusals outside Event Mode


class Filling(hm.HybridAutomaton):
    """Rises to one at a rate that is given at events: without it no event is foreseen."""

    x = hm.State(0.0, output=True)
    rate = hm.Input(0.0, discrete=True)

    def flow_map(self, s):
        return {"x": s.rate}

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": 0.0}


def settled(component):
    """Out of the updates of Event Mode; where the countdown clock then is."""
    while component.update().again:
        pass
    return interval(component)


def test_an_interval_that_was_told_stays_known_until_the_clock_ticks(make):
    """FMI 3.0.2, fmi3GetInterval: not yet known is for clocks of which no interval was told since they ticked."""
    component = make(Filling, "3.0 CS")
    assert component.enter_initialization(0.0) == OK
    component.do("ExitInitializationMode")
    assert settled(component)[::2] == (OK, NOT_YET_KNOWN)
    component.set("rate", 1.0)
    assert settled(component) == (OK, pytest.approx(1.0, abs=1e-12), CHANGED)
    component.do("EnterStepMode")
    component.step(0.0, 0.25)
    component.do("EnterEventMode")
    component.set("rate", 0.0)
    status, quiet, qualifier = settled(component)
    assert (status, qualifier) == (OK, CHANGED)
    assert quiet > 0.75  # a time at which nothing happens; the event that was told of will not come
    component.set("rate", 3.0)
    assert settled(component) == (OK, pytest.approx(0.25, abs=1e-12), CHANGED)
    component.set("rate", 0.0)
    clock = references([component.binary.reference("next_event")])
    component.do("SetClock", clock, c.c_size_t(1), (c.c_bool * 1)(True))
    assert settled(component)[::2] == (OK, NOT_YET_KNOWN)


def test_a_tick_too_early_does_nothing(make):
    component = make(Ramps, "3.0 CS")
    component.begin(limit_a=0.5)
    component.step(0.0, 0.25)
    component.do("EnterEventMode")
    clock = references([component.binary.reference("next_event")])
    component.do("SetClock", clock, c.c_size_t(1), (c.c_bool * 1)(True))
    assert component.ticks() == ()
    update = component.update()
    assert (update.again, update.next_time) == (False, pytest.approx(0.5, abs=1e-12))
    assert interval(component) == (OK, pytest.approx(0.25, abs=1e-12), CHANGED)
    assert component.get("count_a") == 0


def test_clocks_that_are_none_or_outputs_are_refused(make):
    component = make(Ramps, "3.0 CS")
    component.initialize()
    for name in ("a", "ticks_a"):
        reference, array = references([component.binary.reference(name)]), (c.c_bool * 1)(True)
        assert component.call("SetClock", reference, c.c_size_t(1), array) == ERROR
        value, qualifier = c.c_double(math.pi), c.c_int(7)
        status = component.call("GetIntervalDecimal", reference, c.c_size_t(1), c.byref(value), c.byref(qualifier))
        assert (status, value.value, qualifier.value) == (ERROR, math.pi, 7)
    both = references([component.binary.reference("next_event"), component.binary.reference("a")])
    values, qualifiers = (c.c_double * 2)(7.0, 7.0), (c.c_int * 2)(7, 7)
    assert component.call("GetIntervalDecimal", both, c.c_size_t(2), values, qualifiers) == ERROR
    assert (list(values), list(qualifiers)) == ([7.0, 7.0], [7, 7]), "a part was written"


# Structural parameters.


def test_structural_parameters_are_what_they_are(exported):
    binary = Binary(exported(GatedSineWeights(duty_percent=[20.0, 35.0]), "gated_sine"))
    [name] = [name for name, v in binary.variables.items() if v.causality == "structuralParameter"]
    component = Component(binary, "cs")
    reference = [binary.reference(name)]
    assert component.access("Get", "UInt64", reference, [0]) == (OK, [2])
    assert component.access("Set", "UInt64", reference, [2])[0] == ERROR  # not outside its mode
    component.do("EnterConfigurationMode")
    assert component.access("Set", "UInt64", reference, [2])[0] == OK
    for wrong in (0, 1, 3, 2**64 - 1):
        assert component.access("Set", "UInt64", reference, [wrong])[0] == ERROR
        assert f"'{name}' is 2" in component.errors[-1]
    for other in binary.variables.values():
        if other.causality in ("input", "parameter"):
            assert component.whole("Set", other.name)[0] == ERROR
    component.do("ExitConfigurationMode")
    component.begin()
    assert component.step(0.0, 0.1).status == OK
    component.free()

"""Steps of Co-Simulation: where they end and what they say; output derivatives; the guards against bad arguments."""

import ctypes as c
import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from fmi_driver.binary import DISCARD, ERROR, OK
from fmi_driver.journey import SETTINGS, Journey
from witnesses import Mix, Ramps
from witnesses_ends import Pole

import hybrid_model as hm
from hybrid_model.models import BouncingBall

TIME_TOLERANCE = 1e-7  # the project's limit
ACCUMULATION = np.sqrt(2 / 9.81) * 1.7 / 0.3
STEPPING = [label for label, setting in SETTINGS.items() if setting["kind"] == "cs"]
LABELS = pytest.mark.parametrize("label", STEPPING)


# FMI 2.0: a step that ends at an event.


def stopping(make, automaton, **start):
    component = make(automaton, "2.0 CS", logging=True)
    component.begin(stop_at_events=1, **start)
    return component


def follow(component, points):
    """Step from point to point, from event to event; the times of the events, and how many steps it took."""
    t, events = points[0], []
    for n_steps in itertools.count():
        target = next((point for point in points if point > t), None)
        if target is None:
            return events, n_steps
        found = component.step(t, target - t)
        if found.status == OK:
            assert component.last_time() == pytest.approx(target, abs=1e-15)
            assert not component.is_over()
            t = target
            continue
        assert (found.status, found.terminate) == (DISCARD, False)
        assert t < found.time < target, "no progress"
        t = found.time
        assert component.get("time") == t
        events.append(t)


def test_discarded_steps_end_at_the_events(make):
    component = stopping(make, Mix)
    points = [0.0, 0.37, 0.5, 1.7]
    events, n_steps = follow(component, points)
    arc = hm.simulate(Mix(), 1.7)
    expected = [jump.t for jump in arc.jumps if jump.name != "switch"]
    np.testing.assert_allclose(events, expected, rtol=0, atol=TIME_TOLERANCE)
    assert [name for name, _ in component.jumps] == [jump.name for jump in arc.jumps if jump.name != "switch"]
    assert n_steps == len(points) - 1 + len(events)
    assert component.errors == []


def test_events_at_one_instant_are_one_discard_and_one_at_a_point_is_none(make):
    component = stopping(make, Ramps, limit_a=0.25, limit_b=0.5, first=0.5)
    # Straight lines: only roundings are left.
    assert follow(component, [0.0, 0.3, 0.5, 0.6, 0.8])[0] == pytest.approx([0.25, 0.75], abs=1e-15)
    # At 0.5, a point of the importer: all three, in their order, inside the step that ends there.
    assert [name for name, _ in component.jumps] == ["a", "a", "timer", "b", "a"]
    assert [t for _, t in component.jumps] == pytest.approx([0.25, 0.5, 0.5, 0.5, 0.75], abs=1e-15)


def test_without_the_option_events_are_inside(make):
    component = make(Ramps, "2.0 CS", logging=True)
    component.begin(limit_a=0.25)
    assert follow(component, [0.0, 0.3, 0.8]) == ([], 2)
    assert [t for _, t in component.jumps] == pytest.approx([0.25, 0.5, 0.75], abs=1e-12)


@pytest.mark.parametrize("option", [0, 1])
def test_accumulating_jumps_end_in_a_discard_that_says_so(option, make):
    component = make(BouncingBall, "2.0 CS")
    component.begin(stop_at_events=option)
    t, lowest = 0.0, 0.0
    for _ in range(200):
        found = component.step(t, 0.1)
        t, lowest = found.time, min(lowest, component.get("h"))
        if found.terminate:
            break
    assert (found.status, found.terminate) == (DISCARD, True)
    assert t == pytest.approx(ACCUMULATION, abs=1e-5)
    assert lowest >= -1e-9
    [message] = component.errors
    assert "accumulate at t = 2.5586" in message
    # The run is over, and stays so; nothing has been lost.
    values = component.values()
    assert component.step(t, 0.1).status == ERROR
    assert component.values() == values
    assert component.last_time() == t
    assert component.is_over()
    component.do("Reset")
    component.begin()
    assert component.step(0.0, 0.1).status == OK
    assert not component.is_over()


def test_there_are_two_statuses(make):
    component = stopping(make, Ramps)
    component.step(0.0, 0.25)
    real, text, number = c.c_double(7.0), c.c_char_p(), c.c_int(7)
    for function, kind, place in (
        ("GetStatus", 0, number), ("GetStringStatus", 1, text), ("GetIntegerStatus", 0, number),
        ("GetRealStatus", 0, real), ("GetRealStatus", 3, real), ("GetBooleanStatus", 2, number),
    ):  # fmt: skip
        component.log.clear()
        assert component.call(function, kind, c.byref(place)) == DISCARD
        assert f"fmi2{function}" in component.errors[0]
    assert (real.value, text.value, number.value) == (7.0, None, 7)


def test_version_2_messages_are_arguments_of_a_fixed_format(make):
    component = make(Ramps, "2.0 CS", name=b"%s%n", logging=True)
    assert component.call("DoStep", c.c_double(0.0), c.c_double(0.1), 1) == ERROR
    assert component.last_format == b"%s"
    assert component.errors[0].startswith("%s%n: fmi2DoStep")


# Times.


@LABELS
@pytest.mark.parametrize("period", [Fraction(1, 3), Fraction(1, 60), Fraction(1, 10), Fraction(1, 7), Fraction(1)])
@pytest.mark.parametrize("start", [0.0, 1000.0])
def test_grids_reach_the_stop_time_however_their_times_are_computed(label, period, start, make):
    """By index, by adding, and by subtracting from the end: roundings are let pass, and no step beyond the stop is."""
    n = int(2 / period)
    h, stop = float(period), float(Fraction(start) + n * period)
    grids = [[start + k * h for k in range(n + 1)], list(itertools.accumulate([start] + [h] * n)),
             [float(Fraction(start) + k * period) for k in range(n + 1)]]  # fmt: skip
    for points in grids:
        component = make(Ramps, label)
        component.begin(start, stop)
        for t in points[:-1]:
            found = component.step(t, h)
            assert (found.status, found.early) == (OK, False), component.log
        # t from the argument: no drift, to the last bit.
        assert component.get("time") == points[-2] + h
        assert component.step(points[-1], h).status == ERROR
        assert "stop time" in component.errors[-1]


@LABELS
def test_times_that_cannot_be_are_refused_and_change_nothing(label, make):
    component = make(Mix, label)
    component.begin(0.0, 2.0)
    assert component.step(0.0, 0.1).status == OK
    pointer = component.save()
    before = component.serialize(pointer)
    for t, h in itertools.product(
        [0.1, 0.0, 0.2, 0.1 - 1e-9, 0.1 + 1e-9, -1.0, math.nan, math.inf, -math.inf, 1e308],
        [0.1, 0.0, -0.0, -0.1, 1.9 + 1e-9, 1.95, 1e308, math.nan, math.inf, -math.inf],
    ):
        if (t, h) == (0.1, 0.1):
            continue
        component.log.clear()
        found = component.step(t, h)
        assert found[:4] == (ERROR, False, False, False)
        assert found.time == 0.1 or component.binary.version == 2  # which does not say
        assert len(component.log) == 1
        again = component.save()
        assert component.serialize(again) == before
        component.forget(again)
    # Of a gap both times are told.
    component.step(0.2, 0.1)
    assert "at 0.2" in component.errors[-1].replace("0.20000000000000001", "0.2")
    assert "0.10000000000000001" in component.errors[-1]
    assert component.step(0.1, 5e-324).status == OK  # below the rounding of the time: nothing to do, and no hang
    assert component.step(0.1, 0.1).status == OK
    component.forget(pointer)


@LABELS
@pytest.mark.parametrize("h", [0.001, 1 / 3])
def test_time_is_that_of_the_arguments(label, h, make):
    """By index: no drift, to the last bit."""
    component = make(Ramps, label)
    component.begin()
    for k in range(20000):
        t = k * h
        assert component.step(t, h).status == OK
        if k % 1000 == 999:
            assert component.get("time") == t + h
            assert component.get("a") == pytest.approx(t + h, rel=1e-12)


@pytest.mark.parametrize("h", [5e-324, 1e-300, 1e-17])
def test_steps_of_almost_nothing_are_steps(h, make):
    component = make(Ramps, "3.0 CS")
    component.begin(0.0, 1.0, limit_a=0.25)
    for k in range(5):
        assert component.step(k * h, h).status == OK
    step = component.step(5 * h, 0.5)
    assert step.event
    assert step.time == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize("label", ["2.0 CS", "3.0 CS without events"])
@pytest.mark.parametrize(("stop", "n"), [(1 / 3, 1000), (1 / 3, 30000), (1.1, 11000), (1e4 / 7, 7000)])
def test_an_importer_that_adds_up_its_steps_arrives_at_the_stop_time(label, stop, n, make):
    component = make(Ramps, label)
    component.begin(0.0, stop)
    t = 0.0
    for _ in range(n):
        assert component.step(t, stop / n).status == OK
        t += stop / n
    assert component.step(t, stop / n).status == ERROR


@LABELS
@pytest.mark.parametrize(
    ("start", "stop", "tolerance", "word"),
    [(math.nan, None, None, "start"), (math.inf, None, None, "start"), (1.0, 0.5, None, "stop"),
     (0.0, math.nan, None, "stop"), (0.0, math.inf, None, "stop"), (0.0, None, 0.0, "tolerance"),
     (0.0, None, -1.0, "tolerance"), (0.0, None, math.nan, "tolerance"), (0.0, None, math.inf, "tolerance")],
)  # fmt: skip
def test_experiments_that_cannot_be_are_refused(label, start, stop, tolerance, word, make):
    component = make(Ramps, label)
    assert component.enter_initialization(start, stop, tolerance) == ERROR
    assert word in component.errors[0]
    component.begin(0.0, 1.0)
    assert component.step(0.0, 0.5).status == OK


def extremes():
    """With rates of 1e300 a step takes all that the solver may, seconds, unless it ends at the first event."""
    for label, push in itertools.product(STEPPING, [1e300, -1e300, 1e308, 5e-324, -0.0]):
        slow = push == 1e300 and label != "3.0 CS"
        yield pytest.param(label, push, marks=pytest.mark.long if slow else ())


@pytest.mark.parametrize(("label", "push"), list(extremes()))
def test_extreme_inputs_are_survived(label, push, make):
    """A refusal or numbers, soon; and afterwards a reset instance is as new."""
    component = make(Mix, label)
    fresh = Journey(make(Mix, label))
    expected = fresh.go_to(0.5)
    journey = Journey(component)
    journey.set_inputs(push=push)
    if not journey.over:
        found = component.step(0.0, 0.1)
        assert found.status in (OK, DISCARD, ERROR)
        if found.status == OK and not found.terminate:
            for name in ("x[1]", "x[2]", "total"):
                whole, index = component.binary.elements[name]
                status, values = component.whole("Get", whole)
                assert math.isfinite(values[index]) if status == OK else f"'{name}' is" in component.errors[-1]
        else:
            assert component.errors or found.early
    component.do("Reset")
    assert Journey(component).go_to(0.5) == expected


# Output derivatives.


@LABELS
def test_output_derivatives_are_those_of_a_run(label, make):
    component = make(Mix, label)
    journey = Journey(component, push=0.3)
    names = ["total", "x[1]", "x[2]"]
    for t in (0.1, 0.37, 0.8, 1.13):
        journey.go_to(t)
        status, rates = component.rates(names)
        assert status == OK
        saved, place, values = component.save(), journey.place(), []
        h = 1e-4
        for k in (-1, 1):
            values.append([component.get(name) for name in names])
            journey.go_to(t + h * max(k, 0) * 2)
        later = [component.get(name) for name in names]
        journey.go_to_place(place)
        component.load(saved)
        journey.go_to(t + h)
        middle = [component.get(name) for name in names]
        # One-sided, of second order: the third derivative is some 100, and rounding 1e-16 over the step.
        expected = (-3 * np.array(values[0]) + 4 * np.array(middle) - np.array(later)) / (2 * h)
        np.testing.assert_allclose(rates, expected, rtol=0, atol=1e-5)
        component.load(saved)
        journey.go_to_place(place)
        component.forget(saved)


@LABELS
def test_what_has_no_output_derivative_is_refused(label, make):
    component = make(Mix, label)
    component.begin()
    for names, order, word in ((["total"], 2, "order 2"), (["total"], 0, "order 0"), (["push"], 1, "'push'"),
                               (["count[1]"], 1, "'count[1]'"), (["total"], -1, "order -1")):  # fmt: skip
        component.log.clear()
        status, values = component.rates(names, order)
        assert (status, values) == (ERROR, [math.pi])
        assert word in component.errors[0]
    assert component.rates([])[0] == OK


def test_a_derivative_that_is_infinite_is_not_given(make):
    component = make(Pole, "3.0 CS without events")
    component.initialize(x=0.99999)
    assert component.rates(["y"])[0] == OK
    component.do("Reset")
    component.initialize(x=1.5 - 0.5)
    assert component.rates(["y"]) == (ERROR, [math.pi])

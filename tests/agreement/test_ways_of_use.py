"""An exported FMU gives the same run however an importer uses it, and that run is the automaton's.

Every way is driven through the plain C functions. The reference is `simulate` (another solver, another location of
events), and for the witnesses the run in closed form.
"""

import itertools

import numpy as np
import pytest
from catalogue import cases
from fmi_driver.binary import OK, Binary
from fmi_driver.component import Component, Step
from fmi_driver.runs import advance
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from witnesses import Cascade, FlowFirst, Hill, Mix, Ramps, Timers, random_automaton

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, element_names
from hybrid_model.models import BouncingBall, Thermostat

STATE_TOLERANCE = 1e-8  # the project's limit for states
TIME_TOLERANCE = 1e-7  # and for times of events
EXACT = 1e-12  # where flows are straight lines, only rounding is left

WAYS = {
    "next event time obeyed": {"events": True, "early": True, "obey": True},
    "next event time ignored": {"events": True, "early": True},
    "events inside steps": {"events": True, "early": False},
    "no event mode": {"events": False, "early": False},
    "no event mode, random steps": {"events": False, "early": False, "random": True},
    "no event mode, one step": {"events": False, "early": False, "once": True},
}
TIMED = ("next event time obeyed", "next event time ignored")  # the ways that show the time of each jump


def communication_points(way, t_start, t_end, n, needed=(), seed=0):
    """Points of a way of use: a grid, or random ones, or just the ends; and those that are needed in any case."""
    if WAYS[way].get("once"):
        grid = np.array([t_start, t_end])
    elif WAYS[way].get("random"):
        grid = np.concatenate([[t_start, t_end], np.random.default_rng(seed).uniform(t_start, t_end, n)])
    else:
        grid = t_start + (t_end - t_start) * np.arange(n + 1) / n
    return sorted({float(t) for t in grid} | {float(t) for t in needed})


def run(loaded, way, points, *, start=None, changes=(), stop=True):
    use = WAYS[way]
    instance = Component(loaded, events=use["events"], early=use["early"])
    instance.initialize(points[0], points[-1] if stop else None, **(start or {}))
    record = advance(instance, points, obey=use.get("obey", False), changes=changes)
    instance.free()
    return record


def flat(record):
    """Single ticks, (time, clock), in order; the clocks of one jump in the order of declaration."""
    return [(t, clock) for t, clocks in record.ticks for clock in clocks]


def compare(automaton, arc, record, outputs, way, changes=()):
    expected = [(jump.t, clock.name) for jump in arc.jumps for clock in automaton.clocks if clock.jump == jump.index]
    if way in TIMED:
        assert [clock for _, clock in flat(record)] == [clock for _, clock in expected]
        np.testing.assert_allclose([t for t, _ in flat(record)], [t for t, _ in expected], rtol=0, atol=TIME_TOLERANCE)
    elif WAYS[way]["events"]:
        assert {clock for _, clock in flat(record)} == {clock for _, clock in expected}
    assert not record.terminated
    # At the instant of a jump both sides are right: rounding decides on which side of it the point lies.
    jumps = np.array([jump.t for jump in arc.jumps])
    times = [t for t, _ in record.samples]
    changed = {t for t, _, _ in changes}
    kept = [k for k, t in enumerate(times) if t not in changed and not (np.abs(jumps - t) < 1e-9).any()]
    assert len(kept) >= min(len(times), 2) - 1
    for column, name in enumerate(outputs):
        base, _, index = name.partition("[")
        values = arc.at(base, [times[k] for k in kept])
        if index:
            values = values[(slice(None), *(int(i) - 1 for i in index.rstrip("]").split(",")))]
        got = [record.samples[k][1][column] for k in kept]
        np.testing.assert_allclose(got, values, rtol=0, atol=STATE_TOLERANCE, err_msg=f"{name}, {way}")


def signals(automaton, steps):
    """Step inputs of a case as signals for `simulate`."""
    inputs = {}
    for variable in automaton.of_kind(Kind.INPUT):
        names = element_names(variable)

        def value(t, names=names, variable=variable):
            starts = variable.start.ravel()
            rows = [
                [start, *(v for at, v in steps.get(name, ()) if at <= t)][-1]
                for name, start in zip(names, starts, strict=True)
            ]
            return np.reshape(rows, variable.shape)

        if any(name in steps for name in names):
            inputs[variable.name] = hm.Signal(value, sorted({t for name in names for t, _ in steps.get(name, ())}))
    return inputs


# Every model of the repository.


@pytest.fixture(scope="module")
def references():
    runs = {}

    def reference(name):
        if name not in runs:
            case = cases()[name]
            runs[name] = hm.simulate(case.automaton, case.t_end, inputs=signals(case.automaton, case.steps))
        return runs[name]

    return reference


@pytest.mark.parametrize("name", list(cases()))
def test_every_model_in_every_way(name, exported, references):
    case, arc = cases()[name], references(name)
    loaded = Binary(exported(case.automaton, name))
    changes = [(t, port, value) for port, rows in case.steps.items() for t, value in rows]
    for way in WAYS:
        points = communication_points(way, 0.0, case.t_end, 37, [t for t, _, _ in changes])
        record = run(loaded, way, points, changes=changes)
        compare(case.automaton, arc, record, loaded.outputs, way, changes)
        if way == "next event time obeyed" and not case.automaton.of_kind(Kind.INPUT):
            # No step was cut short: one for each point and for each instant with events between points.
            instants = {jump.t for jump in arc.jumps}
            assert record.n_steps <= len(points) - 1 + len(instants)


# Random parameters of an automaton that has everything.

UNIT = st.floats(0.0, 1.0)


@settings(max_examples=25, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(data=st.data())
def test_random_automata_in_every_way(data, binary):
    draw = lambda low, high: low + (high - low) * data.draw(UNIT)  # noqa: E731
    pairs = {
        "drive": (1.0, 3.0),
        "decay": (0.0, 0.4),
        "wave": (0.0, 0.3),
        "speed": (0.5, 9.0),
        "limit": (0.5, 1.5),
        "keep": (-0.5, 0.3),
    }
    values = {name: [draw(*ends), draw(*ends)] for name, ends in pairs.items()}
    values |= {"period": draw(0.1, 0.7), "dwell": draw(0.05, 0.5), "x": [draw(-0.2, 0.4), draw(-0.2, 0.4)]}
    automaton = Mix(**values)
    step = 0.2 + 0.6 * data.draw(UNIT), draw(0.0, 0.3)
    t_end = 1.3
    arc = hm.simulate(automaton, t_end, inputs=signals(automaton, {"push": [step]}))
    # Events that are almost simultaneous may rightly be taken in either order: this is not about them.
    visible = [jump.t for jump in arc.jumps if jump.name != "switch"]
    assume(all(b - a > 1e-6 for a, b in itertools.pairwise([*visible, t_end])))
    assume(all(abs(t - step[0]) > 1e-6 for t in visible))
    loaded = binary(Mix)
    start = {
        element: float(value)
        for variable in automaton.variables
        if variable.kind in (Kind.PARAMETER, Kind.STATE)
        for element, value in zip(element_names(variable), variable.start.ravel(), strict=True)
    }
    change = [(step[0], "push", step[1])]
    for way in WAYS:
        points = communication_points(way, 0.0, t_end, 9, [step[0]], seed=data.draw(st.integers(0, 99)))
        compare(automaton, arc, run(loaded, way, points, start=start, changes=change), loaded.outputs, way, change)


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.long) for k in range(4, 40))])
def test_random_structures_in_every_way(seed, exported):
    automaton = random_automaton(seed)
    loaded = Binary(exported(automaton))
    t_end = 2.0
    arc = hm.simulate(automaton, t_end)
    times = [jump.t for jump in arc.jumps if not automaton.jumps[jump.index].internal]
    assert len(times) >= 2
    if any(b - a < 1e-6 for a, b in itertools.pairwise([*times, t_end])):
        pytest.skip("events of this automaton are almost simultaneous: either order is right")
    for way in WAYS:
        record = run(loaded, way, communication_points(way, 0.0, t_end, 11, seed=seed))
        compare(automaton, arc, record, loaded.outputs, way)


# Witnesses with known runs: each in every way.


def ramps(binary, way, points, **start):
    loaded = binary(Ramps)
    record = run(loaded, way, points, start=start)
    return record, dict(zip(loaded.outputs, record.samples[-1][1], strict=True))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("third", [1.0 / 3.0, 0.1, 0.7])
def test_two_guards_at_the_same_mathematical_time_jump_in_order(way, third, binary):
    """a = t and b = 3 t reach `third` and 3 `third` at one time; in floats the crossings differ by rounding."""
    points = communication_points(way, 0.0, 0.75, 4)
    starts = {"rate_a": 1.0, "limit_a": third, "rate_b": 3.0, "limit_b": 3.0 * third}
    record, end = ramps(binary, way, points, **starts)
    crossings = int(0.75 / third)
    assert end["order"] == float("12" * crossings)
    if way in TIMED:
        ticks = flat(record)
        # Two clocks tick with the jump a, and both do so once.
        assert [clock for _, clock in ticks] == ["ticks_a", "also_ticks_a", "ticks_b"] * crossings
        for k in range(crossings):
            times = {t for t, _ in ticks[3 * k : 3 * k + 3]}
            assert len(times) == 1
            assert times.pop() == pytest.approx((k + 1) * third, abs=EXACT)


@pytest.mark.parametrize("way", WAYS)
def test_guards_timer_and_communication_point_at_one_time(way, binary):
    """At 0.5 and at 1.0, which are points, a and b reach their limits and the timer is due; each jumps once.

    The flow ends exactly at the timer, and the guards are crossed there or a rounding behind it: in either case all
    three are due, and come in the order of declaration.
    """
    points = communication_points(way, 0.0, 1.25, 5)
    starts = {"rate_a": 2.0, "limit_a": 1.0, "rate_b": 0.3, "limit_b": 0.15, "first": 0.5, "period": 0.5}
    record, end = ramps(binary, way, points, **starts)
    order = f"{end['order']:.0f}"
    assert {order[:3], order[3:]} == {"132"}
    assert (end["count_a"], end["count_b"], end["rounds"]) == (2, 2, 2)
    assert end["a"] == pytest.approx(0.5, abs=EXACT)
    if way in TIMED:
        assert [t for t, _ in record.ticks] == pytest.approx([0.5] * 3 + [1.0] * 3, abs=EXACT)
        assert [t for t, clocks in record.ticks if "ticks_timer" in clocks] == [0.5, 1.0]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("h", [0.25, 0.1, 1.0 / 3.0])
def test_event_at_every_communication_point_happens_once(way, h, binary):
    """a reaches h at every k h, the points of the importer."""
    points = [k * h for k in range(7)] + [6.5 * h]
    record, end = ramps(binary, way, points[:: 7 if WAYS[way].get("once") else 1], limit_a=h)
    assert end["count_a"] == 6
    assert end["a"] == pytest.approx(0.5 * h, abs=EXACT)
    if way in TIMED:
        times = [t for t, clocks in record.ticks if "ticks_a" in clocks]
        assert times == pytest.approx([(k + 1) * h for k in range(6)], abs=EXACT)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("shift", "count"), [(-1e-12, 1), (0.0, 1), (1e-12, 1), (1e-8, 0)])
def test_guard_crossed_at_the_stop_time(way, shift, count, binary):
    """Up to the tolerance of 1e-9 s behind the stop time it counts, once: rounding does not decide (rule 6)."""
    for t_stop in (0.5, 1.0, 0.7):
        points = communication_points(way, 0.0, t_stop, 3)
        _, end = ramps(binary, way, points, limit_a=t_stop + shift)
        assert end["count_a"] == count


@pytest.mark.parametrize("way", WAYS)
def test_timer_at_the_stop_time_happens(way, binary):
    points = communication_points(way, 0.0, 0.75, 3)
    _, end = ramps(binary, way, points, first=0.25, period=0.25)
    assert end["rounds"] == 3


@pytest.mark.parametrize("way", WAYS)
def test_timer_just_behind_the_stop_time_has_its_own_time(way, binary):
    """8e-11 s are less than the tolerance of guards: a time event is not moved by it."""
    points = communication_points(way, 0.0, 0.75, 3)
    _, end = ramps(binary, way, points, first=0.25, period=0.25 + 4e-11)
    assert end["rounds"] == 2


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("t_start", [0.0, 5.0, -3.0])
def test_events_at_the_start_and_a_start_time_that_is_not_zero(way, t_start, binary):
    """a and b begin at their limits and the timer is due at the start: all jump there, once, in order."""
    points = communication_points(way, t_start, t_start + 0.9, 3)
    starts = {"a": 0.5, "limit_a": 0.5, "b": 1.0, "limit_b": 1.0, "first": t_start, "period": 0.7}
    record, end = ramps(binary, way, points, **starts)
    assert end["order"] == 13213.0
    assert end["b"] == pytest.approx(0.9, abs=EXACT)
    if way in TIMED:
        assert [t for t, _ in record.ticks] == pytest.approx([t_start] * 3 + [t_start + 0.5, t_start + 0.7], abs=EXACT)


@pytest.mark.parametrize("way", WAYS)
def test_guard_that_falls_is_not_fired(way, binary):
    """From above its limit downwards: enabled at the start only, never by the crossing."""
    points = communication_points(way, 0.0, 2.0, 4)
    _, end = ramps(binary, way, points, a=0.7, rate_a=-1.0, limit_a=0.7, b=0.0, rate_b=-1.0, limit_b=0.5)
    assert (end["count_a"], end["count_b"]) == (1, 0)
    assert end["a"] == pytest.approx(-2.0, abs=EXACT)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("begin", "end"), [(0.4, 0.6), (0.4, 0.41), (0.7, 0.7 + 1e-4), (3.0 + 1e-3, 3.0 + 2e-3)])
def test_two_crossings_within_a_step_are_found(way, begin, end, binary):
    points = communication_points(way, 0.0, 4.0, 2)
    loaded = binary(Hill)
    record = run(loaded, way, points, start={"begin": begin, "end": end})
    last = dict(zip(loaded.outputs, record.samples[-1][1], strict=True))
    assert last["count"] == 1
    assert last["seen"] == pytest.approx(begin, abs=1e-11)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("links", [0, 1, 4, 300])
def test_cascades_are_taken_link_by_link(way, links, binary):
    loaded = binary(Cascade)
    points = communication_points(way, 0.0, 2.5, 5)
    record = run(loaded, way, points, start={"links": links, "order": 0.0})
    end = dict(zip(loaded.outputs, record.samples[-1][1], strict=True))
    assert end["total"] == 2 * links
    assert end["x"] == pytest.approx(0.5, abs=EXACT)
    if links == 4:
        assert end["order"] == 12323.0
    if way in TIMED:
        names = ["ticks_start"] + [("ticks_even", "ticks_odd")[k % 2] for k in range(links, 0, -1)]
        assert [clock for _, clock in flat(record)] == 2 * names
        assert [t for t, _ in record.ticks] == pytest.approx([1.0] * (links + 1) + [2.0] * (links + 1), abs=EXACT)


@pytest.mark.parametrize("way", WAYS)
def test_automaton_without_continuous_states(way, binary):
    """Timer, hidden breakpoint at the same times, a guard on the time, and an input that is obeyed at its change."""
    automaton, loaded = Timers(), binary(Timers)
    change = (0.8, "command", 3.0)
    points = communication_points(way, 0.0, 1.3, 5, [0.8])
    record = run(loaded, way, points, changes=[change])
    arc = hm.simulate(automaton, 1.3, inputs=signals(automaton, {"command": [change[::2]]}))
    compare(automaton, arc, record, loaded.outputs, way, [change])
    end = dict(zip(loaded.outputs, record.samples[-1][1], strict=True))
    assert (end["k"], end["mode"], end["rung"], end["obeyed"]) == (5, 5, 1, 3.0)
    assert end["saw"] == 4.0  # the tick is declared before the breakpoint, so it still sees the mode before
    assert end["now"] == 1.3 + 3.0
    if way in TIMED:
        expected = [(0.25, "ticks"), (0.5, "ticks"), (0.75, "ticks"), (0.8, "obeys"), (1.0, "ticks")]
        assert flat(record) == [*expected, (1.1, "rings"), (1.25, "ticks")]


def test_visible_time_events_are_announced_and_hidden_ones_are_not(make):
    instance = make(Timers, "3.0 CS")
    instance.initialize(0.0, 10.0, period=0.5, hidden=0.2)
    _, update = instance.iterate()
    assert update.next_time == 0.5
    instance.do("EnterStepMode")
    assert instance.step(0.0, 0.5) == Step(OK, True, False, False, 0.5)
    instance.do("EnterEventMode")
    assert instance.ticks() == ("ticks",)
    assert instance.get("saw") == 2  # what the pending jump will give is shown from the beginning of Event Mode
    _, update = instance.iterate()
    assert update.next_time == 1.0
    assert instance.get("mode") == instance.get("saw") == 2


def test_an_input_set_between_steps_counts_from_then_on(make):
    """Although an event has been announced: that announcement was made for another input."""
    automaton, change = Mix(), (0.1, "push", 1.0)
    instance = make(Mix, "3.0 CS")
    instance.initialize(0.0, 1.0)
    _, update = instance.iterate()
    instance.do("EnterStepMode")
    instance.step(0.0, 0.1)
    instance.set("push", 1.0)
    step = instance.step(0.1, 0.9)
    arc = hm.simulate(automaton, 1.0, inputs=signals(automaton, {"push": [change[::2]]}))
    first = next(jump for jump in arc.jumps if jump.name == "second")
    assert step.early
    assert step.time == pytest.approx(first.t, abs=1e-9)
    assert step.time < update.next_time - 1e-3


def test_an_input_that_enables_a_jump_between_steps_holds_up_the_next_one(make):
    instance = make(Timers, "3.0 CS")
    instance.initialize(0.0, 1.0)
    instance.iterate()
    instance.do("EnterStepMode")
    instance.step(0.0, 0.1)
    instance.set("command", 2.0)
    assert instance.step(0.1, 0.1) == Step(OK, True, False, True, 0.1)
    instance.do("EnterEventMode")
    found, update = instance.iterate()
    assert found == [("obeys",)]
    assert update.next_time == 0.25


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("rate", [1.0, 0.3, -0.3, 7.0])
def test_flow_priority_jumps_only_where_flow_ends(way, rate, binary):
    automaton = FlowFirst(rate=rate)
    loaded = binary(FlowFirst)
    points = communication_points(way, 0.0, 5.2, 8)
    record = run(loaded, way, points, start={"rate": rate})
    compare(automaton, hm.simulate(automaton, 5.2), record, loaded.outputs, way)
    end = dict(zip(loaded.outputs, record.samples[-1][1], strict=True))
    # With a negative rate the flow cannot begin at zero, so it turns there first.
    assert end["turns"] == int(5.2 * abs(rate)) + (rate < 0)
    if way in TIMED and rate > 0:
        turns = [(k + 1) / rate for k in range(end["turns"])]
        assert [t for t, _ in record.ticks] == pytest.approx(turns, abs=1e-11)


# The models of the library against their closed forms.


@pytest.mark.parametrize("way", WAYS)
def test_bouncing_ball_against_its_closed_form(way, binary):
    g, e = 9.81, 0.7
    fall = np.sqrt(2.0 / g)
    impacts = fall * (1.0 + 2.0 * np.cumsum([0.0, *(e**k for k in range(1, 8))]))
    points = communication_points(way, 0.0, 2.4, 16)
    loaded = binary(BouncingBall)
    record = run(loaded, way, points)
    if way in TIMED:
        before = impacts[impacts < 2.4]
        assert [t for t, _ in record.ticks] == pytest.approx(before, abs=1e-10)
    for t, (h, v) in record.samples:
        k = int(np.searchsorted(impacts, t))
        s = t if k == 0 else t - impacts[k - 1]
        up = e**k * g * fall if k else 0.0
        assert h == pytest.approx(up * s - 0.5 * g * s**2 + (k == 0), abs=1e-9)
        assert v == pytest.approx(up - g * s, abs=1e-9)


def test_thermostat_against_its_closed_form(make):
    instance = make(Thermostat, "3.0 CS")
    instance.initialize()
    record_times, t = [], 0.0
    _, update = instance.iterate()
    instance.do("EnterStepMode")
    for _ in range(6):
        step = instance.step(t, update.next_time - t)
        assert step.event
        t = step.time if step.early else update.next_time
        record_times.append(t)
        instance.do("EnterEventMode")
        _, update = instance.iterate()
        instance.do("EnterStepMode")
    heat, cool = 100.0 * np.log((35.0 - 19.0) / (35.0 - 21.0)), 100.0 * np.log((21.0 - 5.0) / (19.0 - 5.0))
    first = 100.0 * np.log((35.0 - 20.0) / (35.0 - 21.0))
    assert record_times == pytest.approx(first + np.cumsum([0.0, cool, heat, cool, heat, cool]), abs=1e-9)

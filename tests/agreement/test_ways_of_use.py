"""An exported FMU gives the same run however an importer uses it, and that run is the automaton's.

Every way is driven through the plain C functions. The reference is `simulate` (another solver, another location of
events), and for the witnesses the run in closed form.
"""

import itertools

import numpy as np
import pytest
from catalogue import Case, cases
from drawing import examples
from executions import python_run, reference, values_of
from fmi_driver.binary import OK, Binary
from fmi_driver.component import Component, Step
from fmi_driver.runs import advance
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from witnesses import Mix, Timers, random_automaton

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, element_names

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
        values = values_of(arc, name, [times[k] for k in kept])
        got = [record.samples[k][1][column] for k in kept]
        np.testing.assert_allclose(got, values, rtol=0, atol=STATE_TOLERANCE, err_msg=f"{name}, {way}")


# Every model of the repository.


@pytest.mark.parametrize("name", list(cases()))
def test_every_model_in_every_way(name, exported):
    case, arc = cases()[name], reference(name)
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


@settings(examples(8, 25), phases=[Phase.explicit, Phase.generate])
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
    arc = python_run(Case(automaton, t_end, {"push": [step]}))
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


# What an FMU announces, and what inputs do to it.


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
    arc = python_run(Case(automaton, 1.0, {"push": [change[::2]]}))
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

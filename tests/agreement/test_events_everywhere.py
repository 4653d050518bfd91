"""Events in every version and kind and however an importer steps: the jumps of the closed form, in order, in time.

Which jump is taken when is read from the log of events, which all versions and kinds have.
"""

import itertools
import math

import numpy as np
import pytest
from fmi_driver.binary import ERROR, OK
from fmi_driver.exchange import STEP
from fmi_driver.journey import SETTINGS, Journey
from witnesses import Cascade, FlowFirst, Hill, Ramps, Timers
from witnesses_ends import Agreed, Stuck

from hybrid_model.models import BouncingBall, Thermostat

LABELS = pytest.mark.parametrize("label", SETTINGS)
WAYS = {
    # Of stepping: a setting, and what the importer does in it beyond stepping from point to point.
    **{label: (label, None) for label in SETTINGS},
    "3.0 CS, obeying": ("3.0 CS", "obey"),
    "3.0 CS without events, random steps": ("3.0 CS without events", "random"),
    "3.0 CS without events, one step": ("3.0 CS without events", "once"),
}
EVERY_WAY = pytest.mark.parametrize("way", WAYS)
STEPPING = pytest.mark.parametrize("way", [way for way in WAYS if not way.endswith("ME")])
EXACT = 1e-12  # flows are straight lines: only roundings are left


def points_of(way, points):
    """The points of an importer between the first and the last of those of a test, in any case at those."""
    if WAYS[way][1] == "once":
        return points[:1] + points[-1:]
    if WAYS[way][1] == "random":
        more = np.random.default_rng(len(points)).uniform(points[0], points[-1], 2 * len(points))
        return sorted([points[0], points[-1], *map(float, more)])
    return points


def travel(make, automaton, way, points, stop=None, **start):
    """A journey through points; the first is the start time."""
    label, habit = WAYS[way]
    component = make(automaton, label, logging=True)
    journey = Journey(component, points[0], stop, obey=habit == "obey", **start)
    for point in points_of(way, points)[1:]:
        journey.go_to(point)
    assert not journey.over
    assert component.errors == []
    return journey


def jumps(make, automaton, way, points, stop=None, **start):
    """The jumps of a run through points, and the values at its end."""
    component = travel(make, automaton, way, points, stop, **start).component
    return component.jumps, component.values()


def check(found, expected):
    assert [name for name, _ in found] == [name for name, _ in expected]
    assert [t for _, t in found] == pytest.approx([t for _, t in expected], rel=0, abs=EXACT)


def integrates(way):
    return WAYS[way][0].endswith("ME")


# Straight lines: two guards, a timer.


@EVERY_WAY
@pytest.mark.parametrize(
    ("h", "limit"), [(0.5, 0.5), (0.25, 0.5), (0.1, 0.5), (1.5, 0.5), (0.25, 0.25), (0.1, 0.1), (1 / 3, 1 / 3)]
)
def test_a_crossing_at_communication_points_fires_once(way, h, limit, make):
    """Row 28: the limit is reached where steps end, on (t0, t1]."""
    n = round(max(1.5, 6 * h) / h)
    found, values = jumps(make, Ramps, way, [*(k * h for k in range(n + 1)), (n + 0.5) * h], limit_a=limit)
    crossings = int((n + 0.5) * h / limit)
    check(found, [("a", (k + 1) * limit) for k in range(crossings)])
    assert values["count_a"] == crossings
    assert values["a"] == pytest.approx((n + 0.5) * h - crossings * limit, abs=EXACT)


@EVERY_WAY
@pytest.mark.parametrize("t_start", [0.0, 5.0, -3.0])
def test_events_at_the_start_are_taken_once_and_a_guard_that_was_left_is_not(way, t_start, make):
    """Row 29: a and b begin at their limits and the timer is due at the start: all jump there, once, in order."""
    points = [t_start + 0.9 * k / 3 for k in range(4)]
    starts = {"a": 0.5, "limit_a": 0.5, "b": 1.0, "limit_b": 1.0, "first": t_start, "period": 0.7}
    found, values = jumps(make, Ramps, way, points, **starts)
    names = ["a", "timer", "b", "a", "timer"]
    check(found, list(zip(names, [t_start, t_start, t_start, t_start + 0.5, t_start + 0.7], strict=True)))
    assert (values["order"], values["count_a"], values["count_b"], values["rounds"]) == (13213.0, 2, 1, 2)
    assert values["b"] == pytest.approx(0.9, abs=EXACT)


@EVERY_WAY
@pytest.mark.parametrize("above", [True, False])
def test_a_guard_that_falls_does_not_fire(way, above, make):
    """Row 32: from above its limit downwards a is enabled at the start only; b never comes to its limit from below."""
    starts = {"a": 0.7, "rate_a": -1.0, "limit_a": 0.7} if above else {"a": -1.5, "limit_a": 0.7}
    found, values = jumps(make, Ramps, way, [0.0, 0.5, 1.0, 2.0], b=-0.5, rate_b=-1.0, limit_b=0.5, **starts)
    check(found, [("a", 0.0)] if above else [])
    assert values["a"] == pytest.approx(-2.0 if above else 0.5, abs=EXACT)


@EVERY_WAY
@pytest.mark.parametrize("which", [w for n in (2, 3) for w in itertools.combinations(["a", "timer", "b"], n)])
def test_simultaneous_events_are_all_taken_in_the_fixed_order(way, which, make):
    """Row 31: in the order of declaration, whatever the roundings of 0.3 and 3 * 0.1 say."""
    start = {"a": {"limit_a": 0.3}, "timer": {"first": 3 * 0.1}, "b": {"rate_b": 3.0, "limit_b": 0.9}}
    chosen = {key: value for name in which for key, value in start[name].items()}
    found, values = jumps(make, Ramps, way, [0.0, 0.55], **chosen)
    check(found, [(name, 0.3) for name in which])
    assert values["order"] == float("".join({"a": "1", "b": "2", "timer": "3"}[name] for name in which))


@EVERY_WAY
@pytest.mark.parametrize("third", [1.0 / 3.0, 0.1, 0.7])
def test_two_guards_at_the_same_mathematical_time_jump_in_order(way, third, make):
    """a = t and b = 3 t reach `third` and 3 `third` at one time; in floats the crossings differ by rounding."""
    starts = {"rate_a": 1.0, "limit_a": third, "rate_b": 3.0, "limit_b": 3.0 * third}
    found, values = jumps(make, Ramps, way, [0.0, 0.1875, 0.375, 0.5625, 0.75], **starts)
    crossings = int(0.75 / third)
    check(found, [(name, (k + 1) * third) for k in range(crossings) for name in "ab"])
    assert values["order"] == float("12" * crossings)
    if not integrates(way):  # whose importer may find two roundings of one time
        assert len({t for _, t in found}) == crossings


@EVERY_WAY
def test_guards_timer_and_communication_point_at_one_time(way, make):
    """At 0.5 and at 1.0, which are points, a and b reach their limits and the timer is due; each jumps once.

    The flow ends exactly at the timer, and the guards are crossed there or a rounding behind it: in either case all
    three are due, and come in the order of declaration.
    """
    starts = {"rate_a": 2.0, "limit_a": 1.0, "rate_b": 0.3, "limit_b": 0.15, "first": 0.5, "period": 0.5}
    found, values = jumps(make, Ramps, way, [0.25 * k for k in range(6)], **starts)
    check(found, [(name, t) for t in (0.5, 1.0) for name in ("a", "timer", "b")])
    assert [t for name, t in found if name == "timer"] == [0.5, 1.0]
    assert (values["count_a"], values["count_b"], values["rounds"]) == (2, 2, 2)
    assert values["a"] == pytest.approx(0.5, abs=EXACT)


# At the stop time, which who steps knows.


@STEPPING
@pytest.mark.parametrize(("shift", "count"), [(-1e-12, 1), (0.0, 1), (1e-12, 1), (1e-8, 0)])
def test_guard_crossed_at_the_stop_time(way, shift, count, make):
    """Up to the tolerance behind the stop time it counts, once: rounding does not decide (rule 6)."""
    for t_stop in (0.5, 1.0, 0.7):
        points = [t_stop * k / 3 for k in range(3)] + [t_stop]
        _, values = jumps(make, Ramps, way, points, t_stop, limit_a=t_stop + shift)
        assert values["count_a"] == count


@STEPPING
@pytest.mark.parametrize(("late", "rounds"), [(0.0, 3), (4e-11, 2)])
def test_a_timer_at_the_stop_time_happens_and_one_just_behind_it_has_its_own_time(way, late, rounds, make):
    """8e-11 s are less than the tolerance of guards: a time event is not moved by it."""
    points = [0.0, 0.25, 0.5, 0.75]
    _, values = jumps(make, Ramps, way, points, 0.75, first=0.25, period=0.25 + late)
    assert values["rounds"] == rounds


# Other witnesses.


@EVERY_WAY
@pytest.mark.parametrize(
    ("begin", "width", "end"),
    [(0.4, 0.2, 1.0), (0.4, 1e-3, 1.0), (0.4, 1e-6, 1.0), (0.4, 0.2, 4.0), (0.4, 0.01, 4.0), (0.7, 1e-4, 4.0),
     (3.001, 1e-3, 4.0)],
)  # fmt: skip
def test_an_even_number_of_crossings_in_a_step_is_found(way, begin, width, end, make):
    """Row 30: the guard rises and falls again, inside one step of whoever integrates."""
    # An importer looks at indicators where its steps end, so what is narrower than its steps is not for it to find.
    width = max(width, 2 * STEP) if integrates(way) else width
    found, values = jumps(make, Hill, way, [0.0, end / 2, end], begin=begin, end=begin + width)
    assert [name for name, _ in found] == ["jump"]
    # The slope at the crossing is the width.
    assert found[0][1] == pytest.approx(begin, abs=1e-15 * (1 + begin) / width + EXACT)
    assert (values["count"], values["seen"]) == (1, pytest.approx(begin, abs=1e-11))


@EVERY_WAY
@pytest.mark.parametrize("links", [0, 1, 4, 5, 300])
def test_a_cascade_at_one_instant_is_taken_link_by_link(way, links, make):
    found, values = jumps(make, Cascade, way, [0.0, 0.4, 1.5, 2.5], links=float(links))
    names = ["start", *(("even", "odd")[k % 2] for k in range(links, 0, -1))]
    check(found, [(name, t) for t in (1.0, 2.0) for name in names])
    assert values["total"] == 2 * links
    assert values["x"] == pytest.approx(0.5, abs=EXACT)
    if links == 4:
        assert values["order"] == 12323.0


@EVERY_WAY
def test_without_continuous_states_timers_a_hidden_breakpoint_and_an_input_are_obeyed(way, make):
    """A breakpoint at the times of a timer has its place in the order, and an input acts at its change."""
    journey = travel(make, Timers, way, [0.0, 0.3, 0.8])
    journey.set_inputs(command=3.0)
    journey.go_to(1.3)
    ticks = [("tick", 0.25 * k) for k in range(1, 6)]
    check(journey.component.jumps, sorted([*ticks, ("obey", 0.8), ("alarm", 1.1)], key=lambda jump: jump[1]))
    values = journey.component.values()
    assert (values["k"], values["mode"], values["rung"], values["obeyed"]) == (5, 5, 1, 3.0)
    assert values["saw"] == 4.0  # the tick is declared before the breakpoint, so it still sees the mode before
    assert values["now"] == 1.3 + 3.0


@EVERY_WAY
@pytest.mark.parametrize("rate", [1.0, 0.3, -0.3, 7.0])
def test_flow_priority_jumps_only_where_flow_ends(way, rate, make):
    # Half the way for an importer that integrates with small steps.
    legs, turns, x = (4, 2, 0.6) if integrates(way) else (8, 5, 0.8)
    points = [0.65 * k / abs(rate) for k in range(legs + 1)]
    found, values = jumps(make, FlowFirst, way, points, points[-1], rate=rate)
    # With a negative rate the flow cannot begin at zero, so it turns there first.
    expected = [k / abs(rate) for k in range(rate > 0, turns + 1)]
    # An importer finds the border by its indicator, and only behind it may the jump be taken.
    late = 3 * STEP * len(expected) if integrates(way) else 1e-10
    assert [t for _, t in found] == pytest.approx(expected, abs=late)
    assert values["turns"] == len(expected)
    assert values["x"] == pytest.approx(x, abs=abs(rate) * late + 1e-8)


# The models of the library against their closed forms.


@EVERY_WAY
def test_bouncing_ball_against_its_closed_form(way, make):
    g, e = 9.81, 0.7
    fall = math.sqrt(2.0 / g)
    impacts = fall * (1.0 + 2.0 * np.cumsum([0.0, *(e**k for k in range(1, 8))]))
    journey = travel(make, BouncingBall, way, [0.0])
    for t in points_of(way, [0.15 * k for k in range(17)]):
        journey.go_to(t)
        k = int(np.searchsorted(impacts, t))
        s = t if k == 0 else t - impacts[k - 1]
        up = e**k * g * fall if k else 0.0
        assert journey.component.get("h") == pytest.approx(up * s - 0.5 * g * s**2 + (k == 0), abs=1e-9)
        assert journey.component.get("v") == pytest.approx(up - g * s, abs=1e-9)
    assert [t for _, t in journey.component.jumps] == pytest.approx(impacts[impacts < 2.4], abs=1e-10)


@STEPPING
def test_thermostat_against_its_closed_form(way, make):
    heat, cool = 100.0 * math.log((35.0 - 19.0) / (35.0 - 21.0)), 100.0 * math.log((21.0 - 5.0) / (19.0 - 5.0))
    first = 100.0 * math.log((35.0 - 20.0) / (35.0 - 21.0))
    found, _ = jumps(make, Thermostat, way, [10.0 * k for k in range(8)])
    expected = first + np.cumsum([0.0, cool, heat, cool, heat, cool])
    expected = expected[expected < 70.0]
    assert len(expected) > 4
    assert [t for _, t in found] == pytest.approx(expected, abs=1e-9)


# Ends.


def ended(make, automaton, label, point, **start):
    component = make(automaton, label, logging=True)
    journey = Journey(component, 0.0, **start)
    journey.go_to(point)
    assert journey.over
    return journey


@LABELS
def test_a_blocked_run_ends_with_the_values(label, make):
    """Row 36."""
    journey = ended(make, Stuck, label, 1.0)
    [message] = journey.component.errors
    assert "Blocked" in message
    assert "x = 0.4" in message
    late = STEP if SETTINGS[label]["kind"] == "me" else 1e-9
    assert 0.4 - 1e-9 <= journey.component.get("x") <= 0.4 + late + 1e-12
    if SETTINGS[label]["kind"] == "cs":
        assert journey.component.step(journey.t, 0.1).status == ERROR
    journey.component.do("Terminate")


@LABELS
def test_a_trigger_at_consensus_ends_with_a_remedy(label, make):
    """Row 35: zero is not above zero, but at or above it: a jump that leaves its state where it is."""
    journey = ended(make, Agreed, label, 1.0)
    assert "is zero together with its error fires for ever" in journey.component.errors[-1]
    assert len(journey.component.jumps) <= 1001
    assert journey.component.get("time") == pytest.approx(0.5, abs=1e-9)
    journey.component.do("Reset")
    again = Journey(journey.component, 0.0, begin=5.0)
    again.go_to(1.0)
    assert not again.over


# Life.


@LABELS
@pytest.mark.parametrize("order", [1, -1])
def test_interleaved_instances_are_independent(label, order, make):
    """Row 8: two at a time, with other starts, freed in either order, are as if alone."""
    starts = [
        {"limit_a": 0.3, "first": 0.45, "period": 0.2},
        {"a": 0.1, "limit_a": 0.17, "rate_b": 5.0, "limit_b": 0.9},
    ]
    points = [0.13 * k for k in range(1, 9)]

    def begin(start):
        return Journey(make(Ramps, label, logging=True), 0.0, **start)

    alone = []
    for start in starts:
        journey = begin(start)
        alone.append(([journey.go_to(t) for t in points], journey.component.jumps))
    both = [begin(start) for start in starts]
    rows = [[journey.go_to(t) for journey in both] for t in points]
    assert [(list(r), j.component.jumps) for r, j in zip(zip(*rows, strict=True), both, strict=True)] == alone
    for journey in both[::order]:
        assert journey.component.call("Terminate") == OK
        journey.component.free()

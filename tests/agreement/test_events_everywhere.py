"""Events as every version and kind takes them: the same jumps in the same order at the times of the closed form.

Which jump is taken when is read from the log of events, which all versions and kinds have.
"""

import itertools

import pytest
from fmi_driver.binary import ERROR, OK
from fmi_driver.exchange import STEP
from fmi_driver.journey import SETTINGS, Journey
from witnesses import Cascade, FlowFirst, Hill, Ramps, Timers
from witnesses_ends import Agreed, Stuck

LABELS = pytest.mark.parametrize("label", SETTINGS)
EXACT = 1e-12  # flows are straight lines: only roundings are left
MODELS = {"ramps": Ramps, "hill": Hill, "cascade": Cascade, "timers": Timers, "flow_first": FlowFirst,
          "stuck": Stuck, "agreed": Agreed}  # fmt: skip


def jumps(make, automaton, label, points, **start):
    """The jumps of a run through points, and the values at its end."""
    component = make(automaton, label, logging=True)
    journey = Journey(component, points[0], **start)
    for point in points[1:]:
        journey.go_to(point)
    values = component.values()
    assert not journey.over
    assert component.errors == []
    found = component.jumps
    return found, values


def check(found, expected):
    assert [name for name, _ in found] == [name for name, _ in expected]
    assert [t for _, t in found] == pytest.approx([t for _, t in expected], rel=0, abs=EXACT)


@LABELS
@pytest.mark.parametrize("h", [0.5, 0.25, 0.1, 1.5])
def test_a_crossing_at_communication_points_fires_once(label, h, make):
    """Row 28: the limit is reached where steps end, on (t0, t1]."""
    points = [k * h for k in range(round(1.5 / h) + 1)]
    found, values = jumps(make, Ramps, label, [*points, 1.6], limit_a=0.5)
    check(found, [("a", 0.5), ("a", 1.0), ("a", 1.5)])
    assert values["a"] == pytest.approx(0.1, abs=EXACT)


@LABELS
def test_an_event_at_the_start_is_taken_once_and_a_guard_that_was_left_is_not(label, make):
    """Row 29."""
    found, values = jumps(make, Ramps, label, [0.0, 0.3, 0.7], a=0.5, limit_a=0.5, first=0.0)
    check(found, [("a", 0.0), ("timer", 0.0), ("a", 0.5)])
    assert (values["count_a"], values["rounds"]) == (2, 1)


@LABELS
@pytest.mark.parametrize("width", [0.2, 1e-3, 1e-6])
def test_an_even_number_of_crossings_in_a_step_is_found(label, width, make):
    """Row 30: the guard rises at 0.4 and falls again, inside one step of whoever integrates."""
    # An importer looks at indicators where its steps end, so what is narrower than its steps is not for it to find.
    if SETTINGS[label]["kind"] == "me" and width < 2 * STEP:
        width = 2 * STEP
    found, values = jumps(make, Hill, label, [0.0, 1.0], begin=0.4, end=0.4 + width)
    assert [name for name, _ in found] == ["jump"]
    # The slope at the crossing is the width.
    assert found[0][1] == pytest.approx(0.4, abs=1e-15 / width + EXACT)
    assert values["count"] == 1


@LABELS
def test_a_guard_that_falls_does_not_fire(label, make):
    """Row 32: b starts above its limit's far side and never comes to it from below."""
    found, _ = jumps(make, Ramps, label, [0.0, 1.0], a=-1.0, b=-0.5, rate_b=-1.0, limit_a=0.5, limit_b=0.5)
    check(found, [])


@LABELS
@pytest.mark.parametrize("which", [w for n in (2, 3) for w in itertools.combinations(["a", "timer", "b"], n)])
def test_simultaneous_events_are_all_taken_in_the_fixed_order(label, which, make):
    """Row 31: in the order of declaration, whatever the roundings of 0.3 and 3 * 0.1 say."""
    start = {"a": {"limit_a": 0.3}, "timer": {"first": 3 * 0.1}, "b": {"rate_b": 3.0, "limit_b": 0.9}}
    chosen = {key: value for name in which for key, value in start[name].items()}
    found, values = jumps(make, Ramps, label, [0.0, 0.55], **chosen)
    check(found, [(name, 0.3) for name in which])
    assert values["order"] == float("".join({"a": "1", "b": "2", "timer": "3"}[name] for name in which))


@LABELS
def test_a_cascade_at_one_instant(label, make):
    found, values = jumps(make, Cascade, label, [0.0, 0.4, 2.5], links=5.0)
    links = ["start", "odd", "even", "odd", "even", "odd"]
    check(found, [(name, t) for t in (1.0, 2.0) for name in links])
    assert values["total"] == 10


@LABELS
def test_a_breakpoint_at_the_time_of_an_event_has_its_place_in_the_order(label, make):
    found, values = jumps(make, Timers, label, [0.0, 0.6, 1.2], hidden=0.25)
    check(found, [*(("tick", 0.25 * k) for k in (1, 2, 3, 4)), ("alarm", 1.1)])
    # The tick is declared before the switch: it sees the mode from before.
    assert (values["saw"], values["mode"]) == (3.0, 4)


@LABELS
def test_flow_first(label, make):
    found, values = jumps(make, FlowFirst, label, [0.0, 0.7, 2.5])
    assert [name for name, _ in found] == ["jump", "jump"]
    # An importer finds the border by its indicator, and only behind it may the jump be taken.
    tolerance = 3 * STEP if SETTINGS[label]["kind"] == "me" else 1e-8
    assert [t for _, t in found] == pytest.approx([1.0, 2.0], abs=tolerance)
    assert values["turns"] == 2


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
    assert "unless its inequality is strict" in journey.component.errors[-1]
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

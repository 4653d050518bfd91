"""Model Exchange, seen by an importer that integrates: events where they are, in both versions, and how runs end."""

import ctypes as c
import math

import numpy as np
import pytest
from fmi_driver.binary import DISCARD, ERROR, OK, doubles
from fmi_driver.exchange import STEP, Exchange
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from witnesses import Mix, PatientBall, Ramps, Timers
from witnesses_ends import Agreed, Pole, Stuck

import hybrid_model as hm
from hybrid_model.models import BouncingBall

STATE_TOLERANCE, TIME_TOLERANCE = 1e-8, 1e-7  # the project's limits
ACCUMULATION = np.sqrt(2 / 9.81) * 1.7 / 0.3
VERSIONS = pytest.mark.parametrize("fmi", ["2.0", "3.0"])


@pytest.fixture
def exchanging(make):
    """An instance for Model Exchange in a version."""
    return lambda automaton, fmi: make(automaton, f"{fmi} ME", logging=True)


def check_jumps(component, arc, outside=()):
    visible = [jump for jump in arc.jumps if jump.name not in outside]
    assert [name for name, _ in component.jumps] == [jump.name for jump in visible]
    np.testing.assert_allclose(
        [t for _, t in component.jumps], [jump.t for jump in visible], rtol=0, atol=TIME_TOLERANCE
    )


@VERSIONS
@pytest.mark.parametrize("short", [0.0, 1e-10, 9e-10])
def test_a_run_with_everything_is_that_of_the_automaton(fmi, short, exchanging):
    """Time events, breakpoints that nobody sees, guards, an input; also if guards are not quite reached."""
    component = exchanging(Mix, fmi)
    exchange = Exchange(component, short=short)
    update = component.begin()
    record = exchange.run([0.0, 0.4, 0.8, 1.0, 1.7], update, changes=[(0.8, "push", 0.25)])
    assert not record.ended
    arc = hm.simulate(Mix(), 1.7, inputs={"push": hm.Signal(lambda t: 0.25 * (t >= 0.8), [0.8])})
    check_jumps(component, arc, outside=("switch",))
    for t, x in record.samples:
        np.testing.assert_allclose(x, arc.at("x", t), rtol=0, atol=STATE_TOLERANCE)
    assert component.errors == []


@VERSIONS
def test_states_may_be_set_by_name(fmi, exchanging):
    """The same bits as with all states at once: nothing of the state before is left in a cache or a prediction."""
    runs = []
    for by_name in (False, True):
        component = exchanging(Mix, fmi)
        exchange = Exchange(component, by_name=by_name)
        record = exchange.run([0.0, 0.6, 1.2], component.begin())
        runs.append(([x.tolist() for _, x in record.samples], component.jumps, component.values()))
    assert runs[0] == runs[1]
    assert len(runs[0][1]) > 3


@VERSIONS
def test_a_state_set_by_name_renews_rates_outputs_and_indicators(fmi, exchanging):
    component = exchanging(BouncingBall, fmi)
    component.begin()
    assert component.vector("GetContinuousStateDerivatives", 2) == (OK, [0.0, -9.81])
    below, above = component.vector("GetEventIndicators", 2)[1]
    assert above == -below == 1.0
    component.set("v", -3.0)
    component.set("h", 0.25)
    assert component.vector("GetContinuousStates", 2) == (OK, [0.25, -3.0])
    assert component.vector("GetContinuousStateDerivatives", 2) == (OK, [-3.0, -9.81])
    assert component.vector("GetEventIndicators", 2) == (OK, [-0.25, 0.25])
    assert component.get("h") == 0.25
    assert component.completed() == (OK, False, False)
    component.set("h", 0.0)
    assert component.completed() == (OK, True, False)


@VERSIONS
def test_a_state_set_by_name_is_not_taken_for_one_that_has_reached_a_guard(fmi, exchanging):
    """A guard that counts as reached, since an event was told within the tolerance before it, does so there only."""
    component = exchanging(Ramps, fmi)
    component.begin(limit_a=0.3)
    component.do("SetTime", c.c_double(0.1))
    component.set("a", 0.3 - 5e-11)
    component.do("EnterEventMode")
    component.do("EnterContinuousTimeMode")
    assert component.completed() == (OK, True, False)
    component.set("a", 0.3 - 4e-11)
    assert component.completed() == (OK, False, False)


BORDERS = {
    # A guard, and one that is the border of the flow set under flow priority: its time, the states, start values.
    Ramps: (0.3, lambda t: [t, 0.1], {"limit_a": 0.3}),
    PatientBall: (np.sqrt(2.0 / 9.81), lambda t: [1.0 - 9.81 / 2 * t**2, -9.81 * t], {}),
}


@VERSIONS
@pytest.mark.parametrize("automaton", BORDERS)
@pytest.mark.parametrize(("ahead", "n"), [(1e-6, 0), (1e-8, 0), (2e-10, 1), (1e-15, 1)])
def test_a_guard_is_reached_a_little_before_it_and_not_far_before_it(fmi, automaton, ahead, n, exchanging):
    time, states, start = BORDERS[automaton]
    component = exchanging(automaton, fmi)
    component.begin(**start)
    component.be_at(time - ahead, states(time - ahead))
    component.handle_event()
    assert len(component.jumps) == n


@VERSIONS
def test_an_importer_that_does_not_watch_is_told_after_its_step(fmi, exchanging):
    component = exchanging(Ramps, fmi)
    exchange = Exchange(component, watch=False)
    record = exchange.run([0.0, 1.0], component.begin(limit_a=0.3, limit_b=0.7005, rate_b=1.0))
    assert [name for name, _ in component.jumps] == ["a", "a", "b", "a"]
    late = np.array([t for _, t in component.jumps]) - [0.3, 0.6, 0.7005, 0.9]
    # Each restart of a is late by up to a step; the next one comes the later.
    assert (late >= -1e-12).all()
    assert (late <= 3 * STEP + 1e-12).all()
    assert record.idle == []


@VERSIONS
def test_time_events_are_announced_at_their_exact_times(fmi, exchanging):
    component = exchanging(Ramps, fmi)
    update = component.begin(first=0.45, period=0.1)
    for k in range(40):
        assert update.next_time == 0.45 + k * 0.1
        # An importer's own arithmetic may come out beside it by a rounding.
        component.do("SetTime", c.c_double(update.next_time - (k % 3) * math.ulp(update.next_time)))
        update = component.handle_event()
    assert [name for name, _ in component.jumps] == ["timer"] * 40
    assert component.get("rounds") == 40


@VERSIONS
def test_states_count_as_changed_only_where_a_jump_gives_them_another_value(fmi, exchanging):
    """The standards forbid to say so elsewhere, also for a jump that changes what the flow map depends on."""
    component = exchanging(Mix, fmi)
    update, told = component.begin(), {}
    for _ in range(3):
        component.do("SetTime", c.c_double(update.next_time))
        before = component.vector("GetContinuousStates", 2)[1]
        update = component.handle_event()
        told[round(component.get("time"), 9)] = update.states_changed
        assert update.states_changed == (component.vector("GetContinuousStates", 2)[1] != before)
    # The switch of 0.3 and 0.6 s changes the speed of the flow, the timer of 0.45 s a state.
    assert told == {0.3: False, 0.45: True, 0.6: False}


@VERSIONS
def test_breakpoints_of_the_flow_are_announced_too(fmi, exchanging):
    """An integrator must not step over the kinks of a flow, although no variable shows them."""
    component = exchanging(Mix, fmi)
    update, found = component.begin(**{"drive[1]": 0.1, "drive[2]": 0.1}), []
    while update.next_time < 1.0:
        found.append(update.next_time)
        component.do("SetTime", c.c_double(update.next_time))
        update = component.handle_event()
    # 3 * 0.3 and 2 * 0.45 differ by a rounding: that is one time.
    assert found == [0.3, 0.45, 0.6, 0.9]


@VERSIONS
def test_without_continuous_states_time_is_all(fmi, exchanging):
    component = exchanging(Timers, fmi)
    exchange = Exchange(component)
    assert exchange.n == 0
    update = component.begin()
    component.do("GetContinuousStates", None, c.c_size_t(0))
    exchange.run([0.0, 0.6, 1.3], update, changes=[(0.6, "command", 2.0)])
    names = [name for name, _ in component.jumps]
    assert names == ["tick", "tick", "obey", "tick", "tick", "alarm", "tick"][: len(names)]
    np.testing.assert_allclose([t for n, t in component.jumps if n == "alarm"], [1.1], rtol=0, atol=1e-12)
    assert component.get("now") == 1.3 + 2.0


# Event indicators.


@VERSIONS
@settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))
@given(a=st.floats(-3.0, 3.0), b=st.floats(-3.0, 3.0), limits=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)))
def test_indicators_are_the_margins(fmi, a, b, limits, exchanging):
    component = exchanging(Ramps, fmi)
    component.begin(limit_a=5.0, limit_b=6.0)
    component.do("SetContinuousStates", doubles([a, b]), c.c_size_t(2))
    expected = [a - 5.0, b - 6.0]
    assert component.vector("GetEventIndicators", 2) == (OK, expected)
    if fmi == "3.0":
        assert [component.get(f"margin.{name}") for name in "ab"] == expected


@VERSIONS
def test_indicators_go_through_zero_with_their_slope(fmi, exchanging):
    """A root finder needs a slope: the values at distances from the crossing are those of a smooth function."""
    component = exchanging(Mix, fmi)
    exchange = Exchange(component)
    update = component.begin()
    record = exchange.run([0.0, 0.7], update)
    crossing, jump = next((t, name) for name, t in component.jumps if name in ("first", "second"))
    assert record.events
    again = exchanging(Mix, fmi)
    exchange = Exchange(again)
    before = crossing - 4e-3
    [_, (t, x)] = exchange.run([0.0, before], again.begin()).samples
    k1, row = exchange.flow(t, x), ("first", "second").index(jump)
    distances = np.linspace(-4e-3, 4e-3, 17)
    z = [exchange.indicators(crossing + d, exchange.reach(x, k1, crossing + d - t))[row] for d in distances]
    slopes = np.diff(z) / np.diff(distances)
    assert (slopes > 0.1).all()
    # The flow's rate changes by less than a hundredth of 4 in 4 ms, times some ten.
    assert np.ptp(slopes) < 0.2
    assert abs(z[8]) < 1e-10


@VERSIONS
def test_an_event_leaves_no_indicator_that_asks_for_another(fmi, exchanging):
    """After an event the guards are on their other side; entering Event Mode once more changes nothing."""
    component = exchanging(Ramps, fmi)
    component.begin(limit_a=0.3)
    component.be_at(0.3, [0.3, 0.3])
    assert component.completed() == (OK, True, False)
    component.handle_event()
    assert component.vector("GetEventIndicators", 2)[1][0] == pytest.approx(-0.3)
    assert component.completed() == (OK, False, False)
    before = component.values()
    component.handle_event()
    assert component.values() == before
    assert len(component.jumps) == 1


# How runs end.


def ended_well(component, word):
    """The reason is in the log; what there is can still be read; terminate, reset and a new run work."""
    assert word in component.errors[-1]
    values = component.values()
    assert all(math.isfinite(value) for value in values.values())
    component.do("Terminate")
    assert component.values() == values
    component.do("Reset")
    component.begin()


@VERSIONS
def test_accumulating_impacts_end_the_run_above_the_floor(fmi, exchanging):
    component = exchanging(BouncingBall, fmi)
    record = Exchange(component).run([0.05 * k for k in range(100)], component.begin())
    assert record.ended
    assert record.events[-1] == pytest.approx(ACCUMULATION, abs=1e-5)
    assert min(x[0] for _, x in record.samples) >= -1e-9
    assert len(record.events) < 60
    ended_well(component, "accumulate at t = 2.5586")


@VERSIONS
def test_a_run_that_leaves_the_flow_set_ends(fmi, exchanging):
    component = exchanging(Stuck, fmi)
    record = Exchange(component).run([0.0, 0.2, 1.0], component.begin())
    assert record.ended
    # Found where the border is; there the state still counts as inside. It is outside after one more step.
    assert record.idle == pytest.approx([0.4], abs=1e-12)
    assert 0.4 < component.get("x") <= 0.4 + STEP + 1e-12
    ended_well(component, "Blocked")


@VERSIONS
def test_a_state_outside_that_is_on_its_way_back_may_flow(fmi, exchanging):
    """Importers that locate events roughly go too far; after the jump the ball is below the floor, and rises."""
    component = exchanging(BouncingBall, fmi)
    component.begin()
    for height, velocity in ((-1e-3, 2.0), (-1e-3, 0.0), (0.2, -1.0), (-1e-3, -2.0)):
        component.do("SetContinuousStates", doubles([height, velocity]), c.c_size_t(2))
        assert component.completed() == (OK, velocity <= 0.0 and height <= 0.0, False)
    assert component.errors == []


@VERSIONS
def test_a_trigger_that_fires_for_ever_ends_the_run(fmi, exchanging):
    component = exchanging(Agreed, fmi)
    record = Exchange(component).run([0.0, 1.0], component.begin())
    assert record.ended
    assert len(component.jumps) <= 1001
    ended_well(component, "is zero together with its error fires for ever")


# What cannot be.


@VERSIONS
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_times_and_states_that_are_no_numbers_are_refused(fmi, value, exchanging):
    component = exchanging(Ramps, fmi)
    component.begin()
    before = component.values()
    assert component.call("SetTime", c.c_double(value)) == ERROR
    assert component.call("SetContinuousStates", doubles([0.1, value]), c.c_size_t(2)) == ERROR
    assert component.try_set("b", value) == ERROR
    assert ["'b'" in text for text in component.errors] == [False, True, True]
    assert component.values() == before


@VERSIONS
@pytest.mark.parametrize("value", [1e308, -1e308, 5e-324, -0.0, 1e-320])
def test_extreme_states_give_numbers_or_a_refusal(fmi, value, exchanging):
    component = exchanging(Mix, fmi)
    component.begin()
    component.do("SetContinuousStates", doubles([value, -value]), c.c_size_t(2))
    for function in ("GetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators"):
        status, got = component.vector(function, 2)
        assert all(map(math.isfinite, got)) if status == OK else status == DISCARD
    status, _, _ = component.completed()
    assert status == OK


@VERSIONS
def test_wrong_lengths_are_refused(fmi, exchanging):
    component = exchanging(Ramps, fmi)
    component.begin()
    for function in ("GetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators",
                     "GetNominalsOfContinuousStates"):  # fmt: skip
        for n in (0, 1, 3, 2**40):
            array = doubles([7.0] * 4)
            assert component.call(function, array, c.c_size_t(n)) == ERROR
            assert list(array) == [7.0] * 4
    assert component.call("SetContinuousStates", doubles([1.0] * 3), c.c_size_t(3)) == ERROR
    assert component.vector("GetNominalsOfContinuousStates", 2) == (OK, [1.0, 1.0])


@VERSIONS
def test_at_a_pole_the_importer_may_try_a_smaller_step(fmi, exchanging):
    component = exchanging(Pole, fmi)
    component.begin()
    component.do("SetContinuousStates", doubles([1.0]), c.c_size_t(1))
    assert component.vector("GetContinuousStateDerivatives", 1) == (DISCARD, [math.pi])
    assert "'x' is inf" in component.errors[-1]
    component.do("SetContinuousStates", doubles([1.5]), c.c_size_t(1))
    assert component.whole("Get", "y")[0] == ERROR
    assert "'y'" in component.errors[-1]
    component.do("SetContinuousStates", doubles([0.5]), c.c_size_t(1))
    assert component.vector("GetContinuousStateDerivatives", 1) == (OK, [2.0])

"""Parts of hybrid arcs: restriction, hybrid time (t, j), resampling, flow lengths and gaps between events."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid_model as hm
from hybrid_model.models import BouncingBall

G = 9.81
FIRST = np.sqrt(2.0 / G)
# A few operations near 1, as in tests/models/test_bouncing_ball.py.
ROUNDING = 1e-12


class Cascade(hm.HybridAutomaton):
    """Counts from 3 to 0 in three jumps at t = 1; rises at the rate of its count."""

    n = hm.DiscreteState(3, integer=True)
    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": s.n + 1.0}

    def jump_set(self, s):
        return hm.least(s.n - 0.5, s.t - 1.0)

    def jump_map(self, s):
        return {"n": s.n - 1}


class Switched(hm.HybridAutomaton):
    """Integrates an input between ticks of a clock; an output with a kink."""

    x = hm.State(0.0)
    k = hm.DiscreteState(0, integer=True)
    u = hm.Input(0.5)
    y = hm.Output()
    transitions = (
        hm.TimeEvent("tick", lambda self, s: 1.0 + s.k, lambda self, s: {"k": s.k + 1}),
        hm.TimeEvent("hidden", lambda self, s: np.where(s.k < 2, 1.5, np.inf), lambda self, s: {"k": 2}, internal=True),
    )

    def flow_map(self, s):
        return {"x": s.u}

    def outputs(self, s):
        return {"y": abs(s.x - 0.6) + s.u}


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 2.0)


@pytest.fixture(scope="module")
def cascade():
    return hm.simulate(Cascade(), 2.0)


@pytest.fixture(scope="module")
def switched():
    return hm.simulate(Switched(), 3.5, inputs={"u": hm.Signal(lambda t: np.sin(3.0 * t) + (t >= 0.8), [0.8])})


# Restriction.


def test_a_restriction_in_time_keeps_hybrid_time_and_cuts_flows_by_the_dense_output(ball):
    a, b = 0.3, 0.9
    part = ball.restrict(t=(a, b))
    assert (part.t[0], part.t[-1]) == (a, b)
    assert (part.j[0], part.j[-1]) == (0, 1)
    assert part["h"][0] == ball.at("h", a) == pytest.approx(1.0 - G / 2 * a**2, abs=ROUNDING)
    assert part["v"][-1] == ball.at("v", b)
    assert part.jumps == ball.jumps[:1]
    grid = np.linspace(a, b, 50)
    np.testing.assert_array_equal(part.at("h", grid), ball.at("h", grid))
    with pytest.raises(hm.DeclarationError, match=r"which covers \[0.3, 0.9\] s"):
        part.at("h", 0.2)


def test_jumps_at_the_ends_of_the_interval_belong_to_it_with_both_sides(ball):
    t1, t2 = (jump.t for jump in ball.jumps[:2])
    part = ball.restrict(t=(t1, t2))
    assert (part.j[0], part.j[-1]) == (0, 2)
    assert part.jumps == ball.jumps[:2]
    np.testing.assert_array_equal(part.flow_lengths, [0.0, t2 - t1, 0.0])
    assert part.at("v", t1, before=True) == ball.jumps[0].x_before[1]
    assert part.at("v", t2) == ball.jumps[1].x_after[1]
    assert part.before(ball.jumps[0]).v == ball.before(ball.jumps[0]).v


def test_one_instant_is_an_interval_too(ball, cascade):
    part = ball.restrict(t=(0.2, 0.2))
    assert (len(part.t), part.t[0], part["v"][0]) == (1, 0.2, ball.at("v", 0.2))
    assert len(part.jumps) == 0
    instant = cascade.restrict(t=(1.0, 1.0))
    np.testing.assert_array_equal(instant.j, [0, 1, 2, 3])
    np.testing.assert_array_equal(instant["n"], [3, 2, 1, 0])


def test_a_restriction_in_jumps_keeps_whole_flows(ball):
    part = ball.restrict(j=(1, 3))
    assert part.jumps == ball.jumps[1:3]
    assert (part.t[0], part.t[-1]) == (ball.jumps[0].t, ball.jumps[3].t)
    np.testing.assert_array_equal(part.j, ball.j[(ball.j >= 1) & (ball.j <= 3)])
    np.testing.assert_array_equal(part["h"], ball["h"][(ball.j >= 1) & (ball.j <= 3)])
    np.testing.assert_array_equal(part.flow_lengths, ball.flow_lengths[1:4])
    assert part.after(ball.jumps[2]).v == ball.jumps[2].x_after[1]
    with pytest.raises(hm.DeclarationError, match="no jump count j = 4: it covers 1 to 3"):
        part.after(ball.jumps[3])


def test_both_intervals_together_and_a_restriction_of_a_restriction(ball):
    both = ball.restrict(t=(0.3, 1.6), j=(1, np.inf))
    np.testing.assert_array_equal(both.t, ball.restrict(t=(0.3, 1.6)).restrict(j=(1, 10)).t)
    assert (both.t[0], both.t[-1], both.j[0]) == (ball.jumps[0].t, 1.6, 1)
    whole = ball.restrict(t=(-np.inf, np.inf), j=(0, 10**9))
    np.testing.assert_array_equal(whole["h"], ball["h"])
    assert (whole.stop, whole.message, whole.event_tolerance) == (ball.stop, ball.message, ball.event_tolerance)


@settings(deadline=None)
@given(ends=st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)).map(sorted), now=st.floats(0.0, 1.0))
def test_any_part_agrees_with_the_whole(ball, ends, now):
    part = ball.restrict(t=tuple(ends))
    t = min(max(ends[0] + now * (ends[1] - ends[0]), ends[0]), ends[1])
    for before in (False, True):
        assert part.at("v", t, before=before) == ball.at("v", t, before=before)
    assert np.sum(part.flow_lengths) == pytest.approx(ends[1] - ends[0], abs=1e-15)
    assert part.flow_lengths.size == len(part.jumps) + 1 == part.j[-1] - part.j[0] + 1


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"t": (1.0, 0.5)}, r"the interval t = \(1.0, 0.5\) is empty: give its start first"),
        ({"t": (np.nan, 0.5)}, "give its start first"),
        ({"j": (3, 2)}, r"the interval j = \(3, 2\) is empty"),
        (
            {"t": (2.5, 3.0)},
            r"nothing of the run lies in t = \[2.5, 3\] s and j = \[-inf, inf\]: it covers t = \[0, 2\]",
        ),
        ({"t": (0.0, 0.1), "j": (4, 5)}, "nothing of the run lies"),
    ],
)
def test_intervals_without_anything_in_them_are_refused(ball, asked, message):
    with pytest.raises(hm.DeclarationError, match=message):
        ball.restrict(**asked)


# Hybrid time.


def test_every_side_of_every_jump_of_a_cascade_can_be_had(cascade):
    np.testing.assert_array_equal(cascade.at("n", 1.0, j=[0, 1, 2, 3]), [3, 2, 1, 0])
    assert (cascade.at("n", 1.0, before=True), cascade.at("n", 1.0)) == (3.0, 0.0)
    # x' = n + 1: 4 before the cascade, 1 after it.
    assert cascade.at("x", [0.5, 1.5], j=[0, 3]) == pytest.approx([2.0, 4.5], abs=ROUNDING)


def test_hybrid_times_broadcast_and_keep_their_shape(ball):
    jump = ball.jumps[0]
    np.testing.assert_array_equal(ball.at("v", jump.t, j=[[0], [1]]), [[jump.x_before[1]], [jump.x_after[1]]])


@pytest.mark.parametrize(
    ("t", "j", "message"),
    [
        (0.2, 1, r"hybrid time \(t, j\) = \(0.2 s, 1\) lies outside the run: at j = 1 it covers \[0.45152"),
        (np.nan, 0, "lies outside the run"),
        (0.2, -1, r"no jump count j = -1: it covers 0 to"),
        (0.2, 99, "no jump count j = 99"),
        (0.2, 0.5, "no jump count j = 0.5"),
    ],
)
def test_hybrid_times_outside_the_run_are_refused(ball, t, j, message):
    with pytest.raises(hm.DeclarationError, match=message):
        ball.at("v", t, j=j)


# Resampling.


def test_resampling_gives_the_value_after_all_jumps(ball, cascade):
    grid = np.linspace(0.0, 2.0, 41)
    found = ball.resample(grid)
    np.testing.assert_array_equal(found.t, grid)
    np.testing.assert_array_equal(found["h"], ball.at("h", grid))
    np.testing.assert_array_equal(found.j, np.searchsorted([jump.t for jump in ball.jumps], grid, side="right"))
    assert set(found.values) == {"h", "v"}
    at_cascade = cascade.resample([0.5, 1.0, 2.0], ["n"])
    np.testing.assert_array_equal(at_cascade["n"], [3, 0, 0])
    np.testing.assert_array_equal(at_cascade.j, [0, 3, 3])


def test_resampling_can_give_both_sides(cascade):
    found = cascade.resample([0.0, 1.0, 1.5], both_sides=True)
    np.testing.assert_array_equal(found.t, [0.0, 1.0, 1.0, 1.5])
    np.testing.assert_array_equal(found.j, [0, 0, 3, 3])
    np.testing.assert_array_equal(found["n"], [3, 3, 0, 0])


def test_resampling_at_jumps_agrees_with_single_values(ball):
    times = np.sort([0.0, *(jump.t for jump in ball.jumps), 1.0, 2.0])
    found = ball.resample(times, ["v"], both_sides=True)
    expected = [
        value
        for t in times
        for value in ([ball.at("v", t, before=True)] if t in ball.event_times("jump") else []) + [ball.at("v", t)]
    ]
    np.testing.assert_array_equal(found["v"], expected)


def test_resampling_outside_the_run_and_of_unknown_names_is_refused(ball):
    with pytest.raises(hm.DeclarationError, match="lies outside the run"):
        ball.resample([0.5, 2.1])
    with pytest.raises(hm.DeclarationError, match="no variable 'w'"):
        ball.resample([0.5], ["w"])


# Lengths and gaps.


def test_flow_lengths_are_the_flights_of_the_ball(ball):
    # Thrown back with v the ball flies 2 v/g; e = 0.7.
    flights = [FIRST, *(2.0 * FIRST * 0.7 ** np.arange(1, len(ball.jumps)))]
    assert ball.flow_lengths[:-1] == pytest.approx(flights, abs=ROUNDING)
    assert np.sum(ball.flow_lengths) == pytest.approx(2.0, abs=ROUNDING)
    np.testing.assert_array_equal(ball.inter_event_times(), np.diff(ball.event_times("jump")))


def test_flow_lengths_in_a_cascade_are_zero(cascade):
    np.testing.assert_array_equal(cascade.flow_lengths, [1.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(cascade.inter_event_times("jump"), [0.0, 0.0])


def test_gaps_between_events_leave_out_internal_jumps_unless_named(switched):
    assert [jump.name for jump in switched.jumps] == ["tick", "hidden", "tick"]
    np.testing.assert_array_equal(switched.inter_event_times(), [2.0])
    assert switched.event_times().size == 2
    assert switched.event_times("hidden").size == 1
    assert switched.inter_event_times("hidden").size == 0
    with pytest.raises(hm.DeclarationError, match="no jump 'tock'"):
        switched.inter_event_times("tock")


def test_a_variable_can_be_looked_up(ball):
    assert (ball.variable("h").unit, ball.variable("h").shape) == ("m", ())
    with pytest.raises(hm.DeclarationError, match="no variable 'w'"):
        ball.variable("w")
    # The dense output itself is what a run is read by.
    assert ball.interpolation_error("h") == 0.0

"""Newton's cradle: momentum passes through the row at one instant; times and states in closed form."""

import itertools

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import NewtonsCradle

RATE = 10.0
SWING = 0.05
# Contact is counted from 1e-14 m: at relative speeds from 0.2 m/s on (swings times the rate) that is 5e-14 s early, at
# each of the ten collisions of a test, where the balls are displaced by what the collisions before left: 55 * 5e-14.
EARLY = 3e-12


def let_go(balls, k):
    """A row of balls at rest, k of them displaced to the left together."""
    return NewtonsCradle(x=[-SWING] * k + [0.0] * (balls - k), rate=RATE)


def collisions(arc):
    """The jumps grouped by instants: crossings closer than the event tolerance are one."""
    groups = []
    for jump in arc.jumps:
        if groups and jump.t - groups[-1][0].t < 1e-9:
            groups[-1].append(jump)
        else:
            groups.append([jump])
    return groups


@pytest.mark.parametrize(("balls", "k"), [(2, 1), (5, 1), (5, 2), (5, 3), (5, 4), (8, 3)])
def test_k_balls_in_k_balls_out(balls, k):
    arc = hm.simulate(let_go(balls, k), 10.0 * np.pi / RATE)
    groups = collisions(arc)
    assert [group[0].t for group in groups] == pytest.approx((np.arange(10) + 0.5) * np.pi / RATE, abs=EARLY)
    for n, group in enumerate(groups):
        # A cascade: one t, and k (n - k) impacts.
        assert {jump.t for jump in group} == {group[0].t}
        assert len(group) == k * (balls - k)
        before, after = group[0].x_before[balls:], group[-1].x_after[balls:]
        speed = SWING * RATE
        moving = np.zeros(balls)
        if n % 2 == 0:
            moving[balls - k :] = speed
        else:
            moving[:k] = -speed
        assert after == pytest.approx(moving, abs=RATE * EARLY)
        # As many come in on one side as go out on the other: k balls of the same speed.
        assert before == pytest.approx(moving[::-1], abs=RATE * EARLY)


def test_balls_at_rest_that_touch_do_not_hit():
    arc = hm.simulate(NewtonsCradle(balls=5), 30.0)
    assert arc.stop is hm.Stop.HORIZON
    assert not arc.jumps
    # Together, without a gap, they swing without a hit as well.
    together = hm.simulate(NewtonsCradle(x=[0.03] * 4), 5.0)
    assert together.stop is hm.Stop.HORIZON
    assert not together.jumps


def sorted_cascade(velocities):
    """The impacts of a row in contact: the leftmost pair that approaches exchanges its velocities, until none does."""
    v = list(velocities)
    pairs = []
    while True:
        due = [i for i, (a, b) in enumerate(itertools.pairwise(v)) if a > b]
        if not due:
            return v, pairs
        i = due[0]
        v[i], v[i + 1] = v[i + 1], v[i]
        pairs.append(i)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_the_cascade_takes_the_leftmost_pair_first(k):
    arc = hm.simulate(let_go(5, k), 2.0 * np.pi / RATE)
    for group in collisions(arc):
        # Rounding of the balls that swing together is not an approach.
        _, expected = sorted_cascade(np.round(group[0].x_before[5:], 9))
        taken = [int(np.flatnonzero(jump.x_after[5:] != jump.x_before[5:])[0]) for jump in group]
        assert taken == expected


@pytest.mark.parametrize(
    "start", [[-0.05, 0.0, 0.0, 0.0, 0.03], [-0.04, 0.0, 0.0, 0.04], [-0.05, -0.03, 0.0, 0.02], [-0.06, -0.02, 0.01]]
)
def test_unequal_swings_against_the_closed_form(start):
    """All balls pass their rest positions together; a collision sorts the velocities, and sines lie between."""
    arc = hm.simulate(NewtonsCradle(x=start, rate=RATE), 6.0 * np.pi / RATE)
    v = np.sort(-RATE * np.array(start))
    for n, group in enumerate(collisions(arc)):
        at = (n + 0.5) * np.pi / RATE
        assert group[0].t == pytest.approx(at, abs=EARLY)
        t = np.linspace(at + 1e-6, at + np.pi / RATE - 1e-6, 50)
        t = t[t < arc.t[-1]]
        # The error of a time, times speeds below 1 m/s and accelerations below 10 m/s2.
        assert arc.at("x", t) == pytest.approx(np.outer(np.sin(RATE * (t - at)), v) / RATE, abs=EARLY)
        assert arc.at("v", t) == pytest.approx(np.outer(np.cos(RATE * (t - at)), v), abs=10 * EARLY)
        v = np.sort(-v)
    assert len(collisions(arc)) == 6


def test_energy_is_kept_and_momentum_over_every_impact():
    arc = hm.simulate(let_go(5, 2), 10.0 * np.pi / RATE)
    energy = np.sum(arc["v"] ** 2 + RATE**2 * arc["x"] ** 2, axis=1) / 2.0
    # The integrator's relative tolerance, 1e-13 a step, over some hundred steps.
    assert energy == pytest.approx(RATE**2 * SWING**2, rel=1e-11)
    for jump in arc.jumps:
        # An impact exchanges two velocities: not even rounding changes.
        assert sorted(jump.x_after[5:]) == sorted(jump.x_before[5:])
        assert np.array_equal(jump.x_after[:5], jump.x_before[:5])


def test_balls_do_not_overlap():
    arc = hm.simulate(let_go(5, 2), 10.0 * np.pi / RATE)
    # A collision leaves balls displaced by the distance that counts as contact, 1e-14 m, one to the left and one to the
    # right; rounding adds less.
    assert np.diff(arc["x"], axis=1).min() > -3e-14

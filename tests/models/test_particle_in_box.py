"""The particle in a box against its unfolded straight line; corners, where two walls are hit at one instant."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import ParticleInBox

# The flow is a straight line, exact up to rounding; ten to fifty hits at times up to 20 s, each located to a few ulp.
ROUNDING = 1e-12
WALLS = {("x", 0): "left", ("x", 1): "right", ("y", 0): "bottom", ("y", 1): "top"}


def folded(unfolded, length):
    """Triangle wave: the place of an unfolded coordinate in the box."""
    return length - np.abs(np.mod(unfolded, 2.0 * length) - length)


def hits(coordinate, start, velocity, length, t_end):
    """Hits of one pair of walls: where the unfolded coordinate is a whole multiple k of the length."""
    end = start + velocity * t_end
    ks = np.arange(np.ceil(min(start, end) / length), np.floor(max(start, end) / length) + 1)
    return [((k * length - start) / velocity, WALLS[coordinate, int(k) % 2]) for k in ks]


class ReversedBox(ParticleInBox):
    """The same box with its walls declared in the opposite order."""

    transitions = tuple(reversed(ParticleInBox.transitions))


def drawn_starts():
    rng = np.random.default_rng(7)
    for _ in range(8):
        width, height = rng.uniform(0.5, 3.0, 2)
        x, y = rng.uniform(0.05, 0.95, 2) * (width, height)
        vx, vy = rng.uniform(0.2, 3.0, 2) * rng.choice([-1.0, 1.0], 2)
        yield {"x": x, "y": y, "vx": vx, "vy": vy, "width": width, "height": height}


@pytest.mark.parametrize("start", list(drawn_starts()))
def test_hits_and_positions_are_those_of_the_unfolded_line(start):
    arc = hm.simulate(ParticleInBox(**start), 9.0)
    expected = sorted(
        hits("x", start["x"], start["vx"], start["width"], 9.0)
        + hits("y", start["y"], start["vy"], start["height"], 9.0)
    )
    assert [jump.name for jump in arc.jumps] == [name for _, name in expected]
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _ in expected], abs=ROUNDING)
    t = np.linspace(0.0, 9.0, 200)
    for axis, length in (("x", "width"), ("y", "height")):
        unfolded = start[axis] + start[f"v{axis}"] * t
        # 3 m/s at most, times the error of the time.
        assert arc.at(axis, t) == pytest.approx(folded(unfolded, start[length]), abs=3 * ROUNDING)
    # Reflections copy the speeds exactly.
    assert set(np.abs(arc["vx"])) == {abs(start["vx"])}
    assert set(np.abs(arc["vy"])) == {abs(start["vy"])}


@pytest.mark.parametrize("box", [ParticleInBox, ReversedBox])
@pytest.mark.parametrize("speed", [1.0, 0.3, 1.7])
def test_a_corner_is_two_hits_at_one_instant_in_the_order_of_declaration(box, speed):
    # Along the diagonal; 0.3 and 1.7 put the crossings of the two walls a rounding apart.
    arc = hm.simulate(box(x=0.5, y=0.25, vx=speed, vy=speed / 2.0), 8.0 / speed)
    order = [info.name for info in arc.automaton.jumps]
    expected = [(1.5 + 2.0 * k) / speed for k in range(4)]
    assert len(arc.jumps) == 8
    for k, t in enumerate(expected):
        first, second = arc.jumps[2 * k : 2 * k + 2]
        assert first.t == second.t == pytest.approx(t, abs=ROUNDING)
        assert {first.name, second.name} == ({"right", "top"} if k % 2 == 0 else {"left", "bottom"})
        assert order.index(first.name) < order.index(second.name)
        # The path goes back the way it came.
        assert list(second.x_after[2:]) == [-first.x_before[2], -first.x_before[3]]


def test_the_order_of_the_walls_does_not_change_the_run():
    start = {"x": 0.5, "y": 0.25, "vx": -1.3, "vy": -0.65}
    one, other = (hm.simulate(box(**start), 20.0) for box in (ParticleInBox, ReversedBox))
    assert len(one.jumps) == len(other.jumps) == 26
    t = np.linspace(0.0, 20.0, 300)
    for name in ("x", "y", "vx", "vy"):
        assert np.array_equal(one.at(name, t), other.at(name, t)), name


def test_a_start_in_a_corner_turns_at_once():
    arc = hm.simulate(ParticleInBox(x=2.0, y=1.0, vx=1.0, vy=0.5), 1.0)
    assert [(jump.t, jump.name) for jump in arc.jumps] == [(0.0, "right"), (0.0, "top")]
    assert (arc.end.x, arc.end.y) == pytest.approx((1.0, 0.5), abs=ROUNDING)


def test_rational_directions_close():
    # Periods of x and y are 2 width/vx = 4 s and 2 height/vy = 10/3 s: the path closes after 20 s.
    start = {"x": 0.31, "y": 0.42, "vx": 1.0, "vy": 0.6}
    arc = hm.simulate(ParticleInBox(**start), 20.0)
    assert len(arc.jumps) == 2 * 5 + 2 * 6
    assert {name: arc.end[name] for name in start} == pytest.approx(start, abs=ROUNDING)

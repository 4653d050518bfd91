"""The minimum dwell time: what it changes, what it leaves, and how a result shows it."""

import re

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat, TwoTank

G, E, DWELL = 9.81, 0.7, 0.05


def test_jumps_keep_their_distance_and_the_run_goes_on():
    arc = hm.simulate(hm.MinimumDwell(BouncingBall(), DWELL), 4.0)
    times = np.array([jump.t for jump in arc.jumps])
    assert arc.stop is hm.Stop.HORIZON
    # The timer is a state: its crossing is located to rounding.
    assert np.diff(times).min() >= DWELL - 1e-12
    assert len(times) > 30


def test_until_the_first_jump_that_waits_nothing_is_changed():
    speed = np.sqrt(2.0 * G)
    flights = [speed / G, *(2.0 * speed * E ** np.arange(1, 30) / G)]
    free = np.cumsum(flights[: next(k for k, flight in enumerate(flights) if flight < DWELL)])
    arc = hm.simulate(hm.MinimumDwell(BouncingBall(), DWELL), 4.0)
    assert [jump.t for jump in arc.jumps[: len(free)]] == pytest.approx(free, abs=1e-12)
    held = [arc.after(jump).held_jumps for jump in arc.jumps]
    # All later jumps are held back: each comes exactly a dwell time after the one before.
    assert held == [0] * len(free) + list(range(1, len(held) - len(free) + 1))
    assert np.diff([jump.t for jump in arc.jumps[len(free) - 1 :]]) == pytest.approx(DWELL, abs=1e-12)


def test_the_result_tells_that_it_was_regularised():
    arc = hm.simulate(hm.MinimumDwell(BouncingBall(), DWELL), 4.0)
    assert "minimum dwell time 0.05 s" in repr(arc)
    assert "minimum dwell time 0.05 s" in arc.message
    assert arc.end.held_jumps > 0


def test_an_automaton_that_never_jumps_so_fast_is_left_alone():
    plain, regularised = hm.simulate(Thermostat(), 100.0), hm.simulate(hm.MinimumDwell(Thermostat(), 1.0), 100.0)
    # The timer is a state more, so the steps differ.
    assert [jump.t for jump in regularised.jumps] == pytest.approx([jump.t for jump in plain.jumps], abs=1e-10)
    assert regularised.end.held_jumps == 0


def test_a_start_in_the_jump_set_jumps_at_once():
    arc = hm.simulate(hm.MinimumDwell(Thermostat(temperature=25.0), 1.0), 0.5)
    assert [jump.t for jump in arc.jumps] == [0.0]
    assert arc.end.held_jumps == 0


def test_the_volume_of_two_tanks_goes_on_beyond_the_accumulation():
    """Beyond it the volumes chatter around their limits; their sum follows its own equation exactly."""
    tank = TwoTank()
    s = hm.Execution(tank).values()
    arc = hm.simulate(hm.MinimumDwell(tank, 0.01), 3.0)
    assert arc.stop is hm.Stop.HORIZON
    assert arc["x1"] + arc["x2"] == pytest.approx(s.x1 + s.x2 + (s.w - s.v1 - s.v2) * arc.t, abs=1e-10)


def test_one_part_of_a_composition_alone():
    """Of two agents' timers only the wrapped one waits."""
    fast = BouncingBall("fast", h=0.001)
    loop = hm.product("pair", hm.MinimumDwell(fast, 0.02), BouncingBall("high"))
    arc = hm.simulate(loop, 0.6)
    names = [variable.name for variable in loop.variables]
    assert sum("since_jump" in name for name in names) == 1
    high = [jump.t for jump in arc.jumps if jump.name.startswith("high")]
    assert high == pytest.approx([np.sqrt(2.0 / G)], abs=1e-12)


@pytest.mark.parametrize("dwell", [0.0, -1.0, np.nan, np.inf])
def test_a_dwell_time_that_is_not_positive_is_refused(dwell):
    with pytest.raises(hm.DeclarationError, match="give a positive time"):
        hm.MinimumDwell(BouncingBall(), dwell)


def test_a_variable_of_the_same_name_is_refused():
    with pytest.raises(hm.DeclarationError, match=re.escape("has a variable 'held_jumps' already")):
        hm.MinimumDwell(hm.MinimumDwell(BouncingBall(), 0.1), 0.1)

"""The two tanks against rational arithmetic: switches, volumes, and the accumulation time of Johansson et al."""

import re
from fractions import Fraction

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import TwoTank

# Volumes are straight lines, exact up to rounding in a few dozen sums of numbers near 1.
ROUNDING = 1e-13

SYMMETRIC = {"x1": 0, "x2": 1, "w": Fraction(3, 4), "v1": Fraction(1, 2), "v2": Fraction(1, 2), "r1": 0, "r2": 0}
UNEQUAL = {
    "x1": Fraction(1, 2),
    "x2": Fraction(1),
    "w": Fraction(4, 5),
    "v1": Fraction(3, 5),
    "v2": Fraction(2, 5),
    "r1": Fraction(1, 10),
    "r2": Fraction(1, 5),
}


def switches(values, count):
    """Times and volumes at the switches, as fractions: each tank in turn drains to its lower level."""
    t, x1, x2, filled, found = Fraction(0), values["x1"], values["x2"], 1, []
    for _ in range(count):
        if filled == 1:
            tau = (x2 - values["r2"]) / values["v2"]
            x1, x2 = x1 + (values["w"] - values["v1"]) * tau, values["r2"]
        else:
            tau = (x1 - values["r1"]) / values["v1"]
            x1, x2 = values["r1"], x2 + (values["w"] - values["v2"]) * tau
        t, filled = t + tau, 3 - filled
        found.append((t, x1, x2))
    return np.array(found, dtype=float)


def tank(values):
    return TwoTank(**{name: float(value) for name, value in values.items()})


@pytest.mark.parametrize("values", [SYMMETRIC, UNEQUAL])
def test_switching_times_and_volumes(values):
    exact = switches(values, 12)
    arc = hm.simulate(tank(values), exact[-1, 0] + 1e-9)
    assert [jump.name for jump in arc.jumps] == ["fill_second", "fill_first"] * 6
    assert [jump.t for jump in arc.jumps] == pytest.approx(exact[:, 0], abs=ROUNDING)
    assert np.array([jump.x_after for jump in arc.jumps]) == pytest.approx(exact[:, 1:], abs=ROUNDING)


@pytest.mark.parametrize("values", [SYMMETRIC, UNEQUAL])
def test_the_run_ends_with_the_exact_accumulation_time_in_its_message(values):
    total = values["x1"] + values["x2"] - values["r1"] - values["r2"]
    exact = float(total / (values["v1"] + values["v2"] - values["w"]))
    arc = hm.simulate(tank(values), 10.0)
    assert arc.stop is hm.Stop.ZENO
    told = float(re.search(r"accumulate at t = ([0-9.]+) s", arc.message).group(1))
    # The message has 12 digits; the last gap, some 1e-6 s, is known to an ulp of 4 s, so its series is far better.
    assert told == pytest.approx(exact, abs=1e-10)
    # Stopped when the rest of the series is below a millionth of its longest gap.
    longest = max(np.diff(arc.event_times(name)).max() for name in ("fill_first", "fill_second"))
    assert 0.0 < exact - arc.t[-1] <= 1e-6 * longest


def test_the_gaps_shrink_by_the_published_ratio():
    w, v1, v2 = (float(UNEQUAL[name]) for name in ("w", "v1", "v2"))
    arc = hm.simulate(tank(UNEQUAL), 5.99)
    for name in ("fill_first", "fill_second"):
        gaps = np.diff(arc.event_times(name))
        assert len(gaps) > 3
        # Gaps down to 1e-2 s, each to rounding.
        assert gaps[1:] / gaps[:-1] == pytest.approx((w - v1) * (w - v2) / (v1 * v2), rel=1e-10)


def test_total_volume_falls_at_the_net_outflow_and_no_tank_falls_below_its_level():
    arc = hm.simulate(TwoTank(), 3.99)
    assert arc["x1"] + arc["x2"] == pytest.approx(1.0 - 0.25 * arc.t, abs=ROUNDING)
    # A switch is located to a few ulp of t, at the outflow's 0.5 m3/s.
    assert min(arc["x1"].min(), arc["x2"].min()) >= -1e-14


def test_with_more_inflow_than_outflow_the_gaps_grow_and_the_run_reaches_its_end():
    values = {**SYMMETRIC, "w": Fraction(6, 5)}
    exact = switches(values, 8)
    arc = hm.simulate(tank(values), exact[-1, 0] + 1.0)
    assert arc.stop is hm.Stop.HORIZON
    # The times reach some hundreds of seconds.
    assert [jump.t for jump in arc.jumps] == pytest.approx(exact[:, 0], rel=ROUNDING)


def test_with_a_minimum_dwell_time_the_run_goes_on_past_the_accumulation():
    # The temporal regularisation of Johansson et al., section 4: past 4 s the inflow alternates with the dwell time,
    # both tanks sink below their levels, on the average at half the net outflow.
    dwell = 0.05
    arc = hm.simulate(hm.MinimumDwell(TwoTank(), dwell), 8.0)
    assert arc.stop is hm.Stop.HORIZON
    late = np.array([jump.t for jump in arc.jumps if jump.t > 4.0])
    assert np.diff(late) == pytest.approx(dwell, abs=1e-9)
    assert arc["x1"] + arc["x2"] == pytest.approx(1.0 - 0.25 * arc.t, abs=1e-11)
    # Within what flows in during one dwell time.
    assert [arc.end.x1, arc.end.x2] == pytest.approx([-0.5, -0.5], abs=0.75 * dwell)
    assert arc.end.held_jumps >= len(late)

"""The sawtooth timer: expiries at whole multiples of its period, by a guard and by a schedule alike."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import SawtoothTimer, ScheduledSawtoothTimer

# Each expiry is located to a few ulp of t and the next ramp starts there: over 60 expiries up to t = 42, with an ulp
# of 7e-15, that adds up to less than this.
ROUNDING = 1e-12


@pytest.mark.parametrize("period", [0.7, 0.1, 1.0])
def test_the_guard_fires_at_multiples_of_the_period(period):
    arc = hm.simulate(SawtoothTimer(period=period), 60.5 * period)
    assert arc.event_times("expire") == pytest.approx(period * np.arange(1, 61), abs=ROUNDING)
    assert arc.end.expiries == 60


@pytest.mark.parametrize("period", [0.7, 0.1, 1.0])
def test_the_schedule_fires_at_multiples_of_the_period_without_error(period):
    arc = hm.simulate(ScheduledSawtoothTimer(period=period), 60.5 * period)
    assert list(arc.event_times("expire")) == [k * period for k in range(1, 61)]
    assert arc.end.expiries == 60


@pytest.mark.parametrize(("t_start", "elapsed"), [(0.0, 0.0), (0.0, 0.25), (-3.1, 0.4), (100.0, 0.0)])
def test_both_agree_from_any_start(t_start, elapsed):
    by_guard, by_schedule = (
        hm.simulate(model(period=0.6, elapsed=elapsed), t_start + 10.0, t_start=t_start)
        for model in (SawtoothTimer, ScheduledSawtoothTimer)
    )
    expected = t_start + 0.6 * np.arange(1, 17 + (elapsed > 0.2)) - elapsed
    # The ulp of t = 100 is 1.4e-14.
    for arc in (by_guard, by_schedule):
        assert arc.event_times("expire") == pytest.approx(expected, abs=5 * ROUNDING)
    t = np.linspace(t_start, t_start + 10.0, 97)
    # Away from the expiries, where the two differ by a rounding of t and thus by a period.
    far = np.min(np.abs(t[:, None] - expected), axis=1) > 1e-9
    assert by_guard.at("elapsed", t[far]) == pytest.approx(by_schedule.at("elapsed", t[far]), abs=5 * ROUNDING)
    assert by_guard.at("elapsed", t[far]) == pytest.approx(np.mod(t[far] - t_start + elapsed, 0.6), abs=5 * ROUNDING)


@pytest.mark.parametrize("model", [SawtoothTimer, ScheduledSawtoothTimer])
def test_both_sides_of_an_expiry_are_kept(model):
    arc = hm.simulate(model(period=0.7), 5.0)
    assert arc.at("elapsed", arc.event_times("expire"), before=True) == pytest.approx(0.7, abs=ROUNDING)
    assert np.all(arc.at("elapsed", arc.event_times("expire")) == 0.0)

"""The relay loop against its return map in closed form, and against its limit cycle."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import RelayHysteresis

# Binary fractions, so that a start on the switching line lies on it exactly.
A, K, WIDTH = 0.5, 0.25, 0.125
# The flow is a parabola, exact for DOP853 up to rounding; twenty flights of up to 12 s at positions up to 9 m, of which
# each adds an ulp of the position, 2e-15 m, over signals that change by 0.1 m/s at the slowest: a few 1e-12 s seen.
ROUNDING = 1e-11


def returns(v, count):
    """Times and speeds of the switches after one at speed v: (w + kA)^2 = (v - kA)^2 + 4 A width, flight (v + w)/A."""
    times, speeds = [0.0], [v]
    for _ in range(count):
        w = -K * A + np.sqrt((speeds[-1] - K * A) ** 2 + 4 * A * WIDTH)
        times.append(times[-1] + (speeds[-1] + w) / A)
        speeds.append(w)
    return np.array(times), np.array(speeds)


def relay(v):
    return RelayHysteresis(acceleration=A, rate_gain=K, width=WIDTH, x=WIDTH - K * v, v=v)


@pytest.mark.parametrize("v", [0.125, 0.5, 1.5, 3.0])
def test_switches_follow_the_return_map(v):
    times, speeds = returns(v, 20)
    arc = hm.simulate(relay(v), times[-1] + 1e-6)
    assert [jump.name for jump in arc.jumps] == (["turn_up", "turn_down"] * 11)[:21]
    assert [jump.t for jump in arc.jumps] == pytest.approx(times, abs=ROUNDING)
    signs = (-1.0) ** np.arange(21)
    assert [jump.x_after[1] for jump in arc.jumps] == pytest.approx(signs * speeds, abs=ROUNDING)
    # On the switching lines x + K v = width and -width in turn.
    assert [jump.x_after[0] for jump in arc.jumps] == pytest.approx(signs * (WIDTH - K * speeds), abs=ROUNDING)


def test_the_limit_cycle_has_its_period_speed_and_amplitude():
    period, speed, amplitude = 4 * WIDTH / (K * A), WIDTH / K, WIDTH**2 / (2 * K**2 * A)
    assert (period, speed, amplitude) == (4.0, 0.5, 0.25)
    arc = hm.simulate(relay(speed), 10 * period)
    assert np.diff(arc.event_times("turn_up")) == pytest.approx(period, abs=ROUNDING)
    # The turning points lie a quarter of a period after each switch.
    quarter = np.array([jump.t for jump in arc.jumps[:-1]]) + period / 4
    assert np.abs(arc.at("x", quarter)) == pytest.approx(amplitude, abs=ROUNDING)
    t = np.linspace(0.0, 10 * period, 1001)
    assert np.abs(arc.at("x", t)).max() <= amplitude + ROUNDING


@pytest.mark.parametrize("v", [0.125, 3.0])
def test_every_run_approaches_the_limit_cycle(v):
    arc = hm.simulate(relay(v), 200.0)
    gaps = np.diff([jump.t for jump in arc.jumps])
    # Far away the speed falls by 2kA = 0.25 per switch, near the cycle the error by (v - kA)/(v + kA) = 0.6: to 1e-9
    # in less than 12 + 42 switches.
    assert len(gaps) > 54
    assert gaps[-1] == pytest.approx(2.0, abs=1e-9)


def test_the_default_values_are_those_of_the_docstring():
    arc = hm.simulate(RelayHysteresis(v=0.5, relay=1), 8.5)
    assert np.diff(arc.event_times("turn_down")) == pytest.approx(4.0, abs=ROUNDING)
    assert arc.at("x", arc.event_times("turn_up")[0] + 1.0) == pytest.approx(0.25, abs=ROUNDING)

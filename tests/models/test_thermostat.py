"""The thermostat against its closed form: exponentials between the two limits."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import Thermostat

AMBIENT, HOT, TAU, LOWER, UPPER, START = 5.0, 35.0, 100.0, 19.0, 21.0, 20.0
# Ten exponentials in a row, each to 1e-12 by the solver's tolerance, over slopes of 0.14 K/s.
TIME = 1e-9


def switches(count):
    """Switching times: each flight is tau ln((T_inf - T0)/(T_inf - T1))."""
    warm = TAU * np.log((HOT - LOWER) / (HOT - UPPER))
    cool = TAU * np.log((UPPER - AMBIENT) / (LOWER - AMBIENT))
    first = TAU * np.log((HOT - START) / (HOT - UPPER))
    gaps = [first] + [cool if k % 2 == 0 else warm for k in range(count - 1)]
    return np.cumsum(gaps)


def test_switching_times():
    exact = switches(10)
    arc = hm.simulate(Thermostat(), exact[-1] + 1.0)
    assert [jump.name for jump in arc.jumps] == ["off", "on"] * 5
    assert [jump.t for jump in arc.jumps] == pytest.approx(exact, abs=TIME)
    assert arc.event_times("on") == pytest.approx(exact[1::2], abs=TIME)


def test_temperature_between_switches():
    exact = switches(6)
    arc = hm.simulate(Thermostat(), exact[-1])
    t = np.linspace(0.0, exact[-1], 201)[:-1]
    n = np.searchsorted(exact, t, side="right")
    since = t - np.concatenate([[0.0], exact])[n]
    start = np.where(n == 0, START, np.where(n % 2 == 1, UPPER, LOWER))
    level = np.where(n % 2 == 0, HOT, AMBIENT)
    assert arc.at("temperature", t) == pytest.approx(level + (start - level) * np.exp(-since / TAU), abs=1e-9)
    assert np.array_equal(arc.at("heating", t), 1 - n % 2)


def test_the_temperature_stays_between_the_limits():
    temperature = hm.simulate(Thermostat(), 200.0)["temperature"]
    assert temperature[1:].min() >= LOWER - 1e-9
    assert temperature.max() <= UPPER + 1e-9


@pytest.mark.parametrize(("temperature", "heating", "first"), [(25.0, 1, "off"), (10.0, 0, "on")])
def test_a_start_beyond_a_limit_switches_at_once(temperature, heating, first):
    arc = hm.simulate(Thermostat(temperature=temperature, heating=heating), 0.5)
    assert [(jump.name, jump.t) for jump in arc.jumps] == [(first, 0.0)]


@pytest.mark.parametrize("method", [hm.Method.RADAU, hm.Method.BDF, hm.Method.LSODA, hm.Method.RK45])
def test_every_method_switches_alike(method):
    exact = switches(4)
    arc = hm.simulate(Thermostat(), exact[-1] + 1.0, solver=hm.Solver(method=method, rtol=1e-8, atol=1e-8))
    # The tolerance of a step over the slope 0.14 K/s, times the steps of four flights, generously.
    assert [jump.t for jump in arc.jumps] == pytest.approx(exact, abs=1e-3)

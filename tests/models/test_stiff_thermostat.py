"""The stiff thermostat against its two exponentials; explicit and implicit methods, counted in flow maps."""

import math

import pytest
from scipy.optimize import brentq

import hybrid_model as hm
from hybrid_model.models import StiffThermostat

AMBIENT, RISE, TAU, LOWER, UPPER = 5.0, 30.0, 100.0, 19.0, 21.0


def switches(count, lag, temperature=20.0, reading=20.0):
    """Switching times and names, by brentq on the reading's closed form; the states are carried on in closed form."""
    t, heating, found, k = 0.0, 1, [], lag / TAU
    for _ in range(count):
        w = AMBIENT + RISE * heating
        slow = temperature - w
        fast = reading - w - slow / (1.0 - k)

        def shown(tau, w=w, slow=slow, fast=fast):
            return w + slow / (1.0 - k) * math.exp(-tau / TAU) + fast * math.exp(-tau / lag)

        limit = UPPER if heating else LOWER
        # The reading overshoots its limit at first, for some lags: the sought crossing is the one after that.
        tau = brentq(lambda s, limit=limit, shown=shown: shown(s) - limit, 40.0 * lag, TAU, xtol=1e-13)
        t, temperature, reading, heating = t + tau, w + slow * math.exp(-tau / TAU), limit, 1 - heating
        found.append((t, "on" if heating else "off"))
    return found


class Counted(StiffThermostat):
    """Counts how often its flow map is evaluated."""

    calls = 0

    def flow_map(self, s):
        type(self).calls += 1
        return super().flow_map(s)


def run(method, rtol, count, **values):
    """Run past the given number of switches; return the arc and the number of flow maps."""
    lag = values.get("sensor_lag", 1e-4)
    exact = switches(count, lag)
    model = type("Model", (Counted,), {})
    solver = hm.Solver(method=method, rtol=rtol, atol=rtol)
    arc = hm.simulate(model(**values), exact[-1][0] + 0.5, solver=solver, engine="python")
    assert [jump.name for jump in arc.jumps] == [name for _, name in exact]
    error = max(abs(jump.t - t) for jump, (t, _) in zip(arc.jumps, exact, strict=True))
    return arc, model.calls, error


@pytest.mark.parametrize("method", [hm.Method.RADAU, hm.Method.BDF, hm.Method.LSODA])
def test_implicit_methods_switch_at_the_times_of_the_closed_form(method):
    arc, calls, error = run(method, 1e-9, 10)
    # Ten flights of some sixty steps at most, each with 1e-9 of 20 K, over a slope of 0.14 K/s.
    assert error < 6e-5
    # By stability alone an explicit method has 127 s/3.3e-4 s steps to make.
    assert calls < 3000
    assert len(arc.t) < 1000


@pytest.mark.parametrize("method", list(hm.Method))
def test_every_method_switches_alike_where_it_can(method):
    # A sensor of 10 ms: explicit methods still get there. 700 steps with 1e-7 of 20 K, over a slope of 0.14 K/s.
    assert run(method, 1e-7, 2, sensor_lag=1e-2)[2] < 1e-2


@pytest.mark.parametrize("method", [hm.Method.RK45, hm.Method.DOP853])
def test_an_explicit_method_needs_far_more_flow_maps_at_equal_accuracy(method):
    _, radau, radau_error = run(hm.Method.RADAU, 1e-6, 1, sensor_lag=1e-3)
    _, explicit, explicit_error = run(method, 1e-6, 1, sensor_lag=1e-3)
    assert radau_error <= explicit_error
    assert explicit >= 20 * radau


class OutOfBudget(Exception):
    pass


@pytest.mark.parametrize("method", [hm.Method.RK45, hm.Method.DOP853])
def test_at_a_ratio_of_a_million_an_explicit_method_runs_out_of_twenty_times_the_budget(method):
    _, radau, _ = run(hm.Method.RADAU, 1e-9, 1)

    class Limited(Counted):
        def flow_map(self, s):
            if type(self).calls > 20 * radau:
                raise OutOfBudget(f"at {s.t} s")
            return super().flow_map(s)

    with pytest.raises(OutOfBudget) as stopped:
        hm.simulate(Limited(), 7.0, solver=hm.Solver(method=method, rtol=1e-9, atol=1e-9), engine="python")
    # Not even a fifth of the way to the first switch.
    assert float(str(stopped.value).split()[1]) < 7.0 / 5


def test_the_reading_follows_the_room_one_lag_behind():
    lag = 1e-4
    arc = hm.simulate(StiffThermostat(sensor_lag=lag), 6.0, solver=hm.Solver("Radau", rtol=1e-9, atol=1e-9))
    for t in (1.0, 3.0, 6.0):
        slow = -15.0 * math.exp(-t / TAU)
        assert arc.at("temperature", t) == pytest.approx(35.0 + slow, abs=1e-6)
        assert arc.at("temperature", t) - arc.at("reading", t) == pytest.approx(-slow * lag / (TAU - lag), abs=1e-7)

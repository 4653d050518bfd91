"""Stiff flows on the engine: declared so, found so, and denied; event times against closed forms and exact digits."""

import itertools

import pytest
from fmpy import simulate_fmu
from models.test_stiff_thermostat import switches
from stiff_systems import (
    RISES,
    ROBERTSON_AT_END,
    ROBERTSON_END,
    ROBERTSON_HALF,
    Coupled,
    Drawn,
    Hysteresis,
    Robertson,
    coupled_restarts,
    drawn_events,
    hysteresis_events,
    spread_matrix,
)

import hybrid_model as hm
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model.models import StiffThermostat, VanDerPol


class Thermostat(StiffThermostat):
    """With clocks that tell when it switches."""

    goes_off = hm.Clock("off")
    goes_on = hm.Clock("on")


def declared(automaton, stiff):
    return type(f"{automaton.__name__}{stiff}", (automaton,), {"stiff": stiff})


def events(path, t_stop, **parameters):
    """The ticks of a run of an FMU to a time: name of the clock -> times."""
    slave, found = FmuSlave("it", path), {}
    for name, value in parameters.items():
        slave.set(name, value)
    for tick in run_event_exact(System([slave], {}), t_stop).ticks:
        found.setdefault(tick.clock, []).append(tick.t)
    return found


STIFF = pytest.mark.parametrize("stiff", [True, None])


@STIFF
@pytest.mark.parametrize("damping", RISES)
def test_van_der_pol_rises_at_the_exact_times(exported, damping, stiff):
    times = RISES[damping]
    path = exported(declared(VanDerPol, stiff)(), "van_der_pol")
    found = events(path, times[-1] * (1.0 + 1e-4), damping=damping)["rises"]
    # A rounding of x at rest is 2e-16 / 7e-5 s of time, and every period has 2e4 steps.
    assert found == pytest.approx(times, rel=1e-12, abs=1e-9)


@STIFF
@pytest.mark.parametrize("lag", [1e-4, 1e-6])
def test_the_thermostat_switches_at_the_times_of_its_two_exponentials(exported, lag, stiff):
    times = [t for t, _ in switches(6, lag)]
    path = exported(declared(Thermostat, stiff)(), "thermostat")
    found = events(path, times[-1] + 0.5, sensor_lag=lag)
    assert sorted(itertools.chain(*found.values())) == pytest.approx(times, abs=1e-10)


@STIFF
def test_an_event_in_the_fast_transient_after_a_jump(exported, stiff):
    # The passage comes 0.7/rate after the kick: it is as exact as floating-point numbers are there.
    expected = drawn_events(1e6)
    found = events(exported(declared(Drawn, stiff)(), "drawn"), 3.0)
    assert found["zeros"] == pytest.approx([expected["zero"]], abs=1e-11)
    assert found["passes"] == pytest.approx([expected["pass"]], abs=1e-11)
    assert found["passes"][0] - found["zeros"][0] == pytest.approx(expected["pass"] - expected["zero"], abs=1e-14)


@STIFF
def test_modes_that_a_fast_state_switches(exported, stiff):
    times = hysteresis_events(8)
    found = events(exported(declared(Hysteresis, stiff)(), "hysteresis"), times[-1] + 0.1)
    assert found["turns"] == pytest.approx(times[::2], abs=1e-11)
    assert found["returns"] == pytest.approx(times[1::2], abs=1e-11)


@STIFF
@pytest.mark.parametrize("n", [3, 12])
def test_a_full_matrix_with_time_scales_a_million_apart(exported, n, stiff):
    times = coupled_restarts(6, n)
    automaton = declared(Coupled, stiff)(n=n, matrix=spread_matrix(n)[0])
    found = events(exported(automaton, f"coupled{n}"), 1.01 * times[-1])["restarts"]
    assert found == pytest.approx(times, abs=1e-11)


def test_robertsons_reactions_for_three_thousand_years(exported):
    path = exported(declared(Robertson, True)(), "robertson")
    assert events(path, 1e3)["half"] == pytest.approx([ROBERTSON_HALF], abs=1e-9)
    end = simulate_fmu(str(path), stop_time=ROBERTSON_END, output_interval=ROBERTSON_END)
    # Of the first, whose size was 1, 2e-8 is left: absolute tolerances of 1e-14 leave it 5e-7 of that.
    for name, value in ROBERTSON_AT_END.items():
        assert end[name][-1] == pytest.approx(value, rel=5e-7)

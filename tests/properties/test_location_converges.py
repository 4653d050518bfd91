"""Located times against exact ones on the model library: within the event tolerance, and falling with the solver's.

The table names a model, its run and its exact events; another model is one more line. The exact times come from the
closed forms, rational arithmetic and matrix exponentials of the models' own tests.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import catalogue
import numpy as np
import pytest
from executions import step_inputs
from models import test_boost_converter as boost
from models import test_event_triggered_lti_loop as triggered
from models import test_fireflies as fireflies
from models import test_particle_in_box as box
from models import test_relay_hysteresis as relay
from models import test_stiff_thermostat as stiff
from models import test_thermostat as thermostat
from models import test_two_tank as tanks

import hybrid_model as hm
from hybrid_model import models


@dataclass(frozen=True)
class Located:
    """A model, the end of its run, and a function that returns its exact event times, increasing."""

    automaton: hm.Automaton
    t_end: float
    exact: Callable[[], np.ndarray]


def bounces(e, height, count):
    """Impact times of a ball dropped from `height`: flights last 2 v/g, v falls by e each time."""
    speed = math.sqrt(2.0 * 9.81 * height)
    return np.cumsum([speed / 9.81, *(2.0 * speed * e**k / 9.81 for k in range(1, count))])


def flashes(phases, coupling, t_end):
    return np.array([t for t, _ in fireflies.exact_flashes(phases, coupling, t_end)])


def wall_hits(x, y, t_end):
    """Both coordinates of a particle by unfolding; x and y are (start, velocity, length)."""
    return np.sort([t for name, place in (("x", x), ("y", y)) for t, _ in box.hits(name, *place, t_end)])


LIBRARY = {
    "bouncing ball": Located(models.BouncingBall(e=0.8), 3.0, lambda: bounces(0.8, 1.0, 9)),
    "resting ball": Located(models.RestingBall(slowest=0.3), 2.0, lambda: bounces(0.7, 1.0, 6)),
    "thermostat": Located(models.Thermostat(), 140.0, lambda: thermostat.switches(10)),
    "sawtooth timer": Located(models.SawtoothTimer(period=0.3), 5.9, lambda: 0.3 * np.arange(1, 20)),
    "scheduled timer": Located(models.ScheduledSawtoothTimer(period=0.3), 5.9, lambda: 0.3 * np.arange(1, 20)),
    "relay": Located(relay.relay(1.5), 20.0, lambda: relay.returns(1.5, 40)[0]),
    "two tanks": Located(tanks.tank(tanks.UNEQUAL), 5.0, lambda: tanks.switches(tanks.UNEQUAL, 40)[:, 0]),
    "particle in a box": Located(models.ParticleInBox(), 8.0, lambda: wall_hits((0.5, 1.0, 2.0), (0.5, 0.7, 1.0), 8.0)),
    "fireflies": Located(
        models.Fireflies(phase=[0.1, 0.45, 0.8], coupling=0.1), 5.0, lambda: flashes([0.1, 0.45, 0.8], 0.1, 5.0)
    ),
    "boost converter": Located(
        models.BoostConverter(load=20.0, current=4.0, voltage=47.0),
        1.01e-3,
        lambda: np.array([t for t, *_ in boost.periods(20.0, (4.0, 47.0), 25)[0]]),
    ),
    "discontinuous converter": Located(
        models.BoostConverter(load=500.0, current=0.0, voltage=72.0),
        1.01e-3,
        lambda: np.array([t for t, *_ in boost.periods(500.0, (0.0, 72.0), 25)[0]]),
    ),
    "event-triggered loop": Located(
        models.EventTriggeredLtiLoop(start=(1.0, 0.0)), 1.0, lambda: triggered.exact_events((1.0, 0.0), 1.0)[:, 0]
    ),
}


@pytest.mark.parametrize("name", LIBRARY)
def test_every_event_is_located_within_the_event_tolerance(name):
    model = LIBRARY[name]
    exact = model.exact()
    exact = exact[exact <= model.t_end]
    arc = hm.simulate(model.automaton, model.t_end)
    assert len(arc.jumps) == len(exact) > 1
    assert np.abs([jump.t for jump in arc.jumps] - exact).max() <= arc.event_tolerance


# Convergence with the solver's tolerance.

METHODS = [hm.Method.DOP853, hm.Method.RK45, hm.Method.RADAU]
DIGITS = range(4, 13)


class Swing(hm.HybridAutomaton):
    """x = sin(3 t); events where it reaches 1/2 and -1/2 in turn, at (pi/6 + k pi)/3."""

    x, y = hm.State(0.0), hm.State(1.0)
    side = hm.DiscreteState(1, integer=True)

    def flow_map(self, s):
        return {"x": 3.0 * s.y, "y": -3.0 * s.x}

    def jump_set(self, s):
        return s.side * s.x - 0.5

    def jump_map(self, s):
        return {"side": -s.side}


def swings(t_end):
    times = (math.pi / 6 + math.pi * np.arange(100)) / 3.0
    return times[times < t_end]


def location_errors(model, method, digits):
    """Greatest error in s of an event time, for each rtol = atol = 10**-k."""
    exact = model.exact()
    exact = exact[exact <= model.t_end]
    errors = []
    for k in digits:
        arc = hm.simulate(model.automaton, model.t_end, solver=hm.Solver(method, rtol=10.0**-k, atol=10.0**-k))
        assert len(arc.jumps) == len(exact)
        errors.append(np.abs([jump.t for jump in arc.jumps] - exact).max())
    return np.array(errors)


@pytest.mark.parametrize("method", METHODS)
def test_the_error_of_event_times_is_proportional_to_the_tolerance(method):
    errors = location_errors(Located(Swing(), 5.0, lambda: swings(5.0)), method, DIGITS)
    tolerances = 10.0 ** -np.array(DIGITS)
    # The error of a step is held near the tolerance and the flow keeps errors, so they add up: some 10 to 1000 steps,
    # which mostly cancel, over slopes of 3 cos(pi/6). Eight decades leave the slope of the fit little room.
    assert np.all(errors <= 20.0 * tolerances)
    slope = np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0]
    assert 0.85 < slope < 1.3
    # Every decade gains, but for the steps in which the number of steps happens to fit.
    assert np.all(errors[2:] < errors[:-2])


# Model and constant C with error <= C rtol: slopes of the margins are 0.14 K/s at temperatures near 20 degC for the
# first two, whose states are compared with rtol 20 K, and of order one for the loop. The sensor of 50 ms keeps explicit
# methods at the border of stability, where errors are those of that border.
CONVERGING = {
    "thermostat": (Located(models.Thermostat(), 60.0, lambda: thermostat.switches(10)), 1e3),
    "stiff thermostat": (
        Located(
            models.StiffThermostat(sensor_lag=0.05), 22.0, lambda: np.array([t for t, _ in stiff.switches(2, 0.05)])
        ),
        1e5,
    ),
    "event-triggered loop": (
        Located(
            models.EventTriggeredLtiLoop(start=(1.0, 0.0)), 0.3, lambda: triggered.exact_events((1.0, 0.0), 0.3)[:, 0]
        ),
        1e1,
    ),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", CONVERGING)
def test_the_error_of_event_times_falls_with_the_tolerance_on_library_models(name, method):
    model, constant = CONVERGING[name]
    digits = np.array([4, 6, 8, 10, 12])
    errors = location_errors(model, method, digits)
    # Not below some hundred ulp of times up to 60 s, the rounding of the closed forms.
    assert np.all(errors <= constant * 10.0**-digits + 1e-12)
    assert errors[-1] <= 1e-3 * errors[0] + 1e-12 or errors[0] < 1e-7


def library_cases():
    """All runs of the library models in the catalogue."""
    single = {name: case for name, case in catalogue.cases().items() if type(case.automaton).__name__ in models.__all__}
    del single["stiff_thermostat"]  # 20 degC over a slope of 1e-3 K/s: it has a line of its own above
    return single | catalogue.process_cases() | catalogue.mechanics_cases() | catalogue.linear_cases()


@pytest.mark.parametrize("name", list(library_cases()))
def test_on_every_library_model_event_times_converge(name):
    """The run at default tolerances is held to exact times by the model's own tests; coarser runs tend to it."""
    case = library_cases()[name]
    automaton, inputs = case.automaton, step_inputs(case)
    exact = hm.simulate(automaton, case.t_end, inputs=inputs).jumps
    for rtol in (1e-5, 1e-7, 1e-9, 1e-11):
        solver = hm.Solver(rtol=rtol, atol=rtol / 100)
        found = hm.simulate(automaton, case.t_end, inputs=inputs, solver=solver).jumps
        assert [jump.name for jump in found] == [jump.name for jump in exact]
        # Errors of the states, near rtol times the states, over the slopes of the margins, the slowest 0.02 of them.
        # Below 1e-12 s times of some seconds are rounding.
        error = max([abs(a.t - b.t) for a, b in zip(found, exact, strict=True)], default=0.0)
        assert error <= 1e3 * rtol + 1e-12

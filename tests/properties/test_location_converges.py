"""Located times against exact ones on the model library: within the event tolerance, and falling with the solver's.

The table names a model, its run and its exact events; another model is one more line. The exact times come from the
closed forms, rational arithmetic and matrix exponentials of the models' own tests.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
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
    "particle in a box": Located(
        models.ParticleInBox(), 8.0, lambda: wall_hits((0.5, 1.0, 2.0), (0.5, 0.7, 1.0), 8.0)
    ),
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

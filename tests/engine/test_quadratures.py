"""Flows that are quadratures, in exported FMUs: states and events against closed forms."""

import math

import numpy as np
import pytest
from own_importer import step_through

import hybrid_model as hm

# Some hundred roundings of values of size one.
ROUNDING = 2e-14


class Rates(hm.HybridAutomaton):
    """Rates of one kind each: a square of a sine, a chain of three, one with kinks, and one that jumps unannounced."""

    wave = hm.State(0.0, output=True)
    third = hm.State(0.3, output=True)
    second = hm.State(-0.5, output=True)
    first = hm.State(0.7, output=True)
    kinked = hm.State(0.0, output=True)
    stepped = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {
            "wave": 4.0 * np.sin(5.0 * s.t) ** 2,
            "third": s.second,
            "second": s.first,
            "first": 1.0,
            "kinked": np.abs(np.sin(s.t - 0.4)),
            "stepped": np.where(s.t < 1.3, 2.0, -1.0),
        }


def run(automaton, t_end, exported, names, n=37):
    points = [t_end * k / n for k in range(n)] + [t_end]
    found = step_through(exported(automaton, type(automaton).__name__, "2.0"), t_end, points, names=names)
    return np.array(points), {name: np.array(found.values[name]) for name in names}, found


def test_states_are_their_closed_forms_to_rounding(exported):
    t, found, _ = run(Rates(), 3.0, exported, ["wave", "third", "second", "first", "kinked", "stepped"])
    expected = {
        "wave": 2 * t - np.sin(10 * t) / 5,
        "third": 0.3 - 0.5 * t + 0.35 * t**2 + t**3 / 6,
        "second": -0.5 + 0.7 * t + t**2 / 2,
        "first": 0.7 + t,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=0, atol=ROUNDING * np.abs(values).max(), err_msg=name)
    # Across a kink or a step that nobody has declared, steps are halved until they are as short as the tolerance of
    # 1e-13 asks for; its estimate is that of smooth rates, and a kink hides ten times as much from it.
    bend = np.where(t > 0.4, 2 - math.cos(0.4) - np.cos(t - 0.4), np.cos(t - 0.4) - math.cos(0.4))
    np.testing.assert_allclose(found["kinked"], bend, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["stepped"], np.where(t < 1.3, 2 * t, 2.6 - (t - 1.3)), rtol=0, atol=1e-12)


class Fading(hm.HybridAutomaton):
    """A rate that is no number behind the end of the run, and steep before it."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": np.sqrt(2.0 - s.t)}


def test_rates_are_not_asked_for_behind_the_end_of_the_run(exported):
    t, found, _ = run(Fading(), 2.0, exported, ["x"])
    np.testing.assert_allclose(found["x"], (2**1.5 - (2 - t) ** 1.5) / 1.5, rtol=0, atol=1e-12)


class Waves(hm.HybridAutomaton):
    """A phase that grows evenly, and a margin that is a sum of sines of it: steps say nothing of how it swings."""

    phase = hm.State(0.0)
    level = hm.Parameter(1.2)
    rates = hm.Parameter([1.0, 2.3, 5.1])
    sizes = hm.Parameter([1.0, 0.7, 0.4])
    shifts = hm.Parameter([0.0, 1.0, 2.0])
    risen = hm.DiscreteState(0, integer=True, output=True)
    inside = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"phase": 1.0}

    def height(self, s):
        return np.sum(s.sizes * np.sin(s.rates * s.phase + s.shifts)) - s.level

    transitions = (
        hm.Jump(
            "rise",
            lambda self, s: hm.least(self.height(s), 0.5 - s.inside),
            lambda self, s: {"risen": s.risen + 1, "inside": 1},
        ),
        hm.Jump(
            "fall", lambda self, s: hm.least(-1e-8 - self.height(s), s.inside - 0.5), lambda self, s: {"inside": 0}
        ),
    )


@pytest.mark.parametrize("seed", range(6))
def test_no_two_crossings_in_one_step_are_lost(seed, exported):
    """Steps are as long as the run, whose margin crosses many times; peaks just above the level count as all others."""
    rng = np.random.default_rng(seed)
    rates, shifts = rng.uniform(0.5, 6.0, 3), rng.uniform(0, 2 * math.pi, 3)
    sizes = np.array([1.0, 0.7, 0.4])
    t = np.linspace(0.0, 20.0, 400001)
    height = (sizes * np.sin(rates * t[:, None] + shifts)).sum(axis=1)
    peaks = np.sort(height[1:-1][(height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])])
    # A third of the peaks lie above the level, the lowest of them by 1e-6: it is crossed twice within milliseconds.
    level = peaks[2 * len(peaks) // 3] - 1e-6
    above = height >= level
    rises = t[1:][above[1:] & ~above[:-1]]
    assert len(rises) >= 3
    automaton = Waves(level=level, rates=rates, shifts=shifts, name=f"waves{seed}")
    found = step_through(exported(automaton, f"waves{seed}", "2.0"), 20.0, [20.0], names=["risen"])
    times = [time for time, name in found.jumps if name == "rise" and time > 0]
    np.testing.assert_allclose(times, rises, rtol=0, atol=t[1])


class Ripples(hm.HybridAutomaton):
    """Slow rates, and a margin that swings far faster: steps are as long as the rates allow."""

    phase = hm.State(0.0)
    level = hm.Parameter(1.4)
    rate = hm.Parameter(40.0)
    inside = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"phase": 1.0 + 0.3 * np.cos(s.t)}

    def height(self, s):
        return np.sin(s.rate * s.phase) + 0.5 * np.sin(0.9 * s.phase) - s.level

    transitions = (
        hm.Jump("rise", lambda self, s: hm.least(self.height(s), 0.5 - s.inside), lambda self, s: {"inside": 1}),
        hm.Jump(
            "fall", lambda self, s: hm.least(-1e-8 - self.height(s), s.inside - 0.5), lambda self, s: {"inside": 0}
        ),
    )


@pytest.mark.parametrize("rate", [20.0, 100.0, 300.0])
def test_margins_much_faster_than_rates_are_looked_at_in_narrower_parts(rate):
    """The three highest of hundreds of peaks count, the lowest of them by 1e-6."""
    t = np.linspace(0.0, 20.0, 2000001)
    phase = t + 0.3 * np.sin(t)
    height = np.sin(rate * phase) + 0.5 * np.sin(0.9 * phase)
    peaks = np.sort(height[1:-1][(height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])])
    level = peaks[-3] - 1e-6
    above = height >= level
    rises = t[1:][above[1:] & ~above[:-1]]
    arc = hm.simulate(Ripples(level=level, rate=rate), 20.0, engine="native")
    np.testing.assert_allclose(arc.event_times("rise"), rises, rtol=0, atol=t[1])
    # A tenth of what a Runge-Kutta method takes.
    assert arc.statistics.evaluations < 500

"""Many crossings inside one step of a solver: each run finds the closed form, in Python and in the FMU alike.

All flows here are x' = 1, whose solver steps grow tenfold each, to 10 s and more after a second without events.
"""

import re

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from fmu.build.binaries import own_files
from hybrid_model.reference.zero_crossings import DEGREE, HALVINGS, POINTS, TO_BERNSTEIN, TO_TAIL

EXECUTIONS = pytest.mark.parametrize("execution", ["python", "in process", "fmu"])
BELOW = 1e-12
"""How far a margin falls below zero before a bell is armed again; over the slope, an error of the falls' times."""


class Bell(hm.HybridAutomaton):
    """Moves at speed 1; rings where a margin of the place rises to zero, is armed where it falls below."""

    x = hm.State(0.0)
    armed = hm.DiscreteState(1, integer=True)
    rings = hm.Clock("ring")
    arms = hm.Clock("arm")

    def margin(self, x):
        raise NotImplementedError

    def flow_map(self, s):
        return {"x": 1.0}

    def risen(self, s):
        return hm.least(self.margin(s.x), s.armed - 0.5)

    def fallen(self, s):
        return hm.least(-BELOW - self.margin(s.x), 0.5 - s.armed)

    def ring(self, s):
        return {"armed": 0}

    def arm(self, s):
        return {"armed": 1}

    transitions = (hm.Jump("ring", risen, ring), hm.Jump("arm", fallen, arm))

    @classmethod
    def of(cls, margin):
        return type("Bell", (cls,), {"margin": staticmethod(margin)})()


class LateBell(hm.HybridAutomaton):
    """Deaf for `pause` after each ring, then it rings at the next rise of sin(40 x)."""

    x = hm.State(0.0)
    deaf_until = hm.DiscreteState(0.9)
    pause = hm.Parameter(0.9)
    rings = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return hm.least(np.sin(40.0 * s.x), s.x - s.deaf_until)

    def jump_map(self, s):
        return {"deaf_until": s.x + s.pause}


class Gaps(hm.HybridAutomaton):
    """Under flow priority, in a flow set with gaps of 0.022 every pi/2; the jump leads over the gap."""

    priority = hm.Priority.FLOW
    x = hm.State(0.0)
    leaps = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return 0.999 + np.cos(4.0 * s.x)

    def jump_set(self, s):
        return 1.0 + 0.0 * s.x

    def jump_map(self, s):
        return {"x": s.x + 0.05}


def events(execution, automaton, t_end, exported, key):
    """Return the clocks that tick in a run, and their times."""
    if execution == "python":
        arc = hm.simulate(automaton, t_end)
        names = {clock.jump: clock.name for clock in automaton.clocks}
        return [names[jump.index] for jump in arc.jumps], [jump.t for jump in arc.jumps]
    slave = AutomatonSlave("a", automaton) if execution == "in process" else FmuSlave("a", exported(automaton, key))
    result = run_event_exact(System([slave], {}), t_end)
    return [tick.clock for tick in result.ticks], [tick.t for tick in result.ticks]


def check(found, expected, tolerance):
    names, times = found
    assert names == ["rings", "arms"] * (len(expected) // 2) + ["rings"] * (len(expected) % 2)
    np.testing.assert_allclose(times, expected, rtol=0, atol=tolerance)


@EXECUTIONS
def test_every_crossing_of_a_fast_sine(execution, exported):
    found = events(execution, Bell.of(lambda x: np.sin(40.0 * x - 20.0) - 0.5), 2.0, exported, "sine")
    # 40 x - 20 = pi/6 or 5 pi/6, and 2 pi k more, from x = 0 on.
    angles = np.sort(np.add.outer(2.0 * np.pi * np.arange(-4, 10), [np.pi / 6, 5 * np.pi / 6]).ravel())
    places = (angles + 20.0) / 40.0
    # The slope at the crossings is 35; 20 rounding errors of the state (an ulp of 2 for each step between events).
    check(found, places[(places > 0.0) & (places <= 2.0)], BELOW + 1e-14)


@EXECUTIONS
@pytest.mark.parametrize("pause", [0.9, 3.1])
def test_a_crossing_behind_many_others_that_do_not_count(execution, pause, exported):
    """Steps hold 6 to 60 periods of the sine; all but one ring fall into the pause.

    40 pause lies in the falling half of a period, so that the next ring is a rise of the sine, and not of the pause.
    """
    assert np.sin(40.0 * pause) < 0.0
    n = int(np.ceil(40.0 * pause / (2.0 * np.pi)))
    automaton = LateBell(pause=pause, deaf_until=pause)
    names, times = events(execution, automaton, 8.0 * pause, exported, f"late{pause}")
    expected = 2.0 * np.pi * n * np.arange(1, 10) / 40.0
    expected = expected[expected <= 8.0 * pause]
    assert len(names) == len(expected)
    # Rounding of 40 x, up to an ulp of 1024, over the slope 40; and of x itself, by an ulp of 16 a step.
    np.testing.assert_allclose(times, expected, rtol=0, atol=3e-14)


@EXECUTIONS
def test_pairs_of_crossings_a_millionth_apart(execution, exported):
    half, centres = 5e-7, np.array([0.3, 1.7, 4.9, 9.37])
    bell = Bell.of(lambda x: hm.greatest(*(1.0 - ((x - centre) / half) ** 2 for centre in centres)))
    expected = np.sort(np.concatenate([centres - half, centres + half]))
    # The slope at the crossings is 4e6; x is known to a few ulp of 8.
    check(events(execution, bell, 12.0, exported, "pairs"), expected, 2e-14)


POLYNOMIALS = {
    "seven": [1.2, 1.2001, 2.7, 2.71, 5.0, 5.3, 9.0],
    "eight": [3.0, 3.01, 3.2, 3.3, 8.0, 8.1, 8.2, 8.3],
}


@EXECUTIONS
@pytest.mark.parametrize("name", POLYNOMIALS)
def test_polynomials_with_known_roots(execution, name, exported):
    roots = np.array(POLYNOMIALS[name])

    def margin(x):
        return -((-1.0) ** len(roots)) * np.prod(x - roots)

    slopes = [np.prod(np.delete(root - roots, k)) for k, root in enumerate(roots)]
    found = events(execution, Bell.of(margin), 12.0, exported, f"polynomial_{name}")
    # The sign of each factor is exact, so only x has rounding errors: a few ulp of 8.
    check(found, roots, BELOW / np.min(np.abs(slopes)) + 2e-14)


def hat(x, start, end):
    """Zero at `start` and `end`, slopes 1 and -1, a kink between."""
    return hm.least(x - start, end - x)


KINKED = {
    "hats": (
        [1.7, 1.71, 3.0, 3.5, 9.3, 9.3001],
        lambda x: hm.greatest(hat(x, 1.7, 1.71), hat(x, 3.0, 3.5), hat(x, 9.3, 9.3001)),
    ),
    "dip": ([0.7, 6.0, 6.01], lambda x: hm.greatest(hat(x, 0.7, 6.0), x - 6.01)),
    "slopes": ([5.25], lambda x: hm.least(1e3 * (x - 5.0), x - 5.25)),
}


@EXECUTIONS
@pytest.mark.parametrize("name", KINKED)
def test_kinked_margins(execution, name, exported):
    expected, margin = KINKED[name]
    # Slopes are 1 or above at all crossings; a few ulp of x = 8.
    check(events(execution, Bell.of(margin), 12.0, exported, f"kinked_{name}"), expected, BELOW + 2e-14)


@EXECUTIONS
def test_gaps_of_a_flow_set_within_one_step(execution, exported):
    names, times = events(execution, Gaps(), 12.0, exported, "gaps")
    # The flow set is left where 4 x = pi - acos(0.999) + 2 pi k; each jump has advanced x by 0.05 before.
    k = np.arange(8)
    expected = (np.pi - np.arccos(0.999) + 2.0 * np.pi * k) / 4.0 - 0.05 * k
    expected = expected[expected <= 12.0]
    assert names == ["leaps"] * len(expected)
    # 0.999 + cos is rounded to 2e-16, Python leaves it by 1e-15; the slope is 0.18.
    np.testing.assert_allclose(times, expected, rtol=0, atol=2e-14)


def test_steps_hold_many_periods():
    """What the other tests rest on: without an event Python's steps are long too."""
    arc = hm.simulate(LateBell(pause=3.1, deaf_until=3.1), 3.0)
    assert np.max(np.diff(arc.t)) > 5 * 2.0 * np.pi / 40.0


def test_the_tables_of_the_runtime_are_those_of_python():
    text = own_files("rises.c")[0].read_text()

    def table(name, columns):
        body = re.search(rf"{name}[^=]*= \{{(.*?)\}};", text, flags=re.DOTALL)[1]
        numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", body)]
        return np.reshape(numbers, (len(POINTS), columns))

    contribution = table("CONTRIBUTION", len(POINTS) + 2)
    # Python inverts matrices, of condition 200 at most, in floating point.
    np.testing.assert_allclose(table("engine_points", 1)[:, 0], POINTS, rtol=0, atol=1e-15)
    np.testing.assert_allclose(contribution[:, :-2].T, TO_BERNSTEIN, rtol=0, atol=1e-12)
    np.testing.assert_allclose(contribution[:, -2:].T, TO_TAIL, rtol=0, atol=1e-15)
    assert int(re.search(r"SPLITS (\d+)", own_files("search.h")[0].read_text())[1]) == HALVINGS
    # The quick verdicts rest on these bounds of what samples between the ends contribute.
    weights = np.abs(contribution[1:-1])
    bound, tail = weights[:, :-2].sum(axis=0).max(), weights[:, -2:].sum()

    def factor(name):
        return float(re.search(rf"#define {name} (\S+)", text)[1])

    assert bound + tail < factor("BEND_FACTOR")
    assert 4.0 * (2.0 * bound + DEGREE * tail) < factor("BEND_IN_SLOPE")
    assert 28.0 * (4.0 * bound + factor("CURVE_TAILS") * tail) < factor("BEND_IN_CURVE")

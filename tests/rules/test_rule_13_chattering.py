"""Rule 13: a flow that chatters about a jump of its rates ends in a sentence, in both engines alike.

What is smooth, or passes such jumps, goes on.
"""

import re

import numpy as np
import pytest

import hybrid_model as hm
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System


class Relay(hm.HybridAutomaton):
    """x' = speed below the level 1, and -back above it."""

    x = hm.State(0.0, output=True)
    speed = hm.Parameter(1.0)
    back = hm.Parameter(1.0)

    def flow_map(self, s):
        return {"x": np.where(s.x < 1.0, s.speed, -s.back)}


class Friction(hm.HybridAutomaton):
    """A mass on a spring with dry friction, which comes to rest."""

    x = hm.State(1.0, output=True)
    v = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.v, "v": -s.x - 0.3 * np.sign(s.v)}


class SlidingMode(hm.HybridAutomaton):
    """The surface x + v = 0 is that of two states, and another state goes on meanwhile."""

    x = hm.State(1.0, output=True)
    v = hm.State(0.5, output=True)
    clock = hm.State(0.0)

    def flow_map(self, s):
        return {"x": s.v, "v": -np.sign(s.x + s.v), "clock": 1.0}


# Name, automaton, end, state to blame, time at which it begins, and what the rate is on both sides.
CHATTERING = {
    "Relay": (Relay(), 5.0, "x", 1.0, ("1", "-1")),
    "OtherUnits": (Relay(speed=2.0**-20, back=2.0**-20), 5.0 * 2**20, "x", 2.0**20, ("9.53674e-07", "-9.53674e-07")),
    "Uneven": (Relay(back=100.0), 5.0, "x", 1.0, ("1", "-100")),
    "AtOnce": (Relay(x=1.0), 5.0, "x", 0.0, ("1", "-1")),
    # It passes through rest once, at x = -0.4, where the spring is stronger than the friction; at x = -0.2 it sticks.
    "Friction": (Friction(), 20.0, "v", 2.0 * np.pi, None),
    # v = 1/2 - t and x = 1 + t/2 - t^2/2, up to t^2 + t = 3.
    "SlidingMode": (SlidingMode(), 20.0, "v", (np.sqrt(13.0) - 1.0) / 2.0, ("1", "-1")),
}


@pytest.mark.parametrize("name", CHATTERING)
def test_chattering_is_told_with_the_time_the_state_and_the_remedy(name, exported):
    automaton, t_end, state, begin, rates = CHATTERING[name]
    with pytest.raises(hm.SimulationError) as refused:
        hm.simulate(automaton, t_end)
    path = exported(automaton, f"chattering_{name}")
    result = run_event_exact(System([FmuSlave("a", path)], {}), t_end)
    for message in (str(refused.value), result.message):
        told = re.search(r"flow chatters at t = (\S+) s: the rate of '(\w+)' jumps from (\S+) to (\S+) where", message)
        assert told, message
        assert float(told[1]) == pytest.approx(begin, rel=1e-5, abs=1e-6)
        assert told[2] == state
        assert rates is None or set(rates) == {told[3], told[4]}
        assert "from both sides the flow leads back there" in message
        assert "rite what jumps as modes with a switch (hm.ModalAutomaton, hm.Switch)" in message


@pytest.mark.parametrize("method", ["RK45", "Radau", "LSODA"])
def test_other_methods_and_looser_tolerances_tell_it_too(method):
    with pytest.raises(hm.SimulationError, match=r"t = 1(\.0\d+)? s.* the rate of 'x' jumps from -?1 to -?1 "):
        hm.simulate(Relay(), 1e5, solver=hm.Solver(method=method, rtol=1e-9, atol=1e-11))


def test_a_run_that_gets_through_all_the_same_is_let_go_on():
    """With a tolerance of 1e-3 a step of some 1e-3 s passes."""
    arc = hm.simulate(Relay(), 2.0, solver=hm.Solver(method="RK45", rtol=1e-3, atol=1e-3))
    assert arc.end.x == pytest.approx(1.0, abs=1e-2)


def test_where_no_step_is_short_enough_the_jump_is_named():
    """Late in a run that started at rest far from t = 0 the steps end below what floats resolve there."""

    class Late(Relay):
        def flow_map(self, s):
            return {"x": np.where(s.x < 0.0, 1.0, -1.0)}

    with pytest.raises(hm.SimulationError, match=r"the rate of 'x' jumps from .* modes with a switch"):
        hm.simulate(Late(x=-1e-3), 1e6 + 1.0, t_start=1e6)


def falling(power):
    """x' = -x^power has reached zero at 1 / (1 - power)."""

    class Falling(hm.HybridAutomaton):
        x = hm.State(1.0, output=True)

        def flow_map(self, s):
            return {"x": -(abs(s.x) ** power)}

    return Falling(name="Falling")


class Stairs(hm.HybridAutomaton):
    """x' = floor(rate t) / rate, up to a stair every 1/rate s."""

    x = hm.State(0.0, output=True)
    rate = 40.0

    def flow_map(self, s):
        return {"x": np.floor(self.rate * s.t) / self.rate}


class StairsOfState(hm.HybridAutomaton):
    """x' jumps up at each whole number that x passes."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 10.0 + np.floor(s.x)}


class SquareWave(hm.HybridAutomaton):
    """A rate that changes its sign again and again, at times."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": np.sign(np.sin(20.0 * np.pi * s.t))}


class Swing(hm.HybridAutomaton):
    """v' = -sign(x) crosses its surface at speed: by symmetry each half takes 2 sqrt(2)."""

    x = hm.State(1.0, output=True)
    v = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.v, "v": -np.sign(s.x)}


class Steep(hm.HybridAutomaton):
    """x' = -tanh(1e4 (x - 1)) + 1/2 rests where it is smooth, though steep: a stiff flow."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 0.5 - np.tanh(1e4 * (s.x - 1.0))}


class Fast(hm.HybridAutomaton):
    """Some thousand steps of a sine."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 1000.0 * np.cos(1000.0 * s.t)}


GOING_ON = {
    "Stairs": (Stairs(), 1.0, sum(range(40)) / 1600.0, 1e-10),
    # From k to k + 1 in 1 / (10 + k): to 5 in 1/10 + ... + 1/14.
    "StairsOfState": (StairsOfState(), sum(1.0 / k for k in range(10, 15)), 5.0, 1e-10),
    "SquareWave": (SquareWave(), 1.05, 0.05, 1e-12),
    "Swing": (Swing(), 4.0 * np.sqrt(2.0), 1.0, 1e-10),
    "Steep": (Steep(), 2.5, 1.0 + np.arctanh(0.5) / 1e4, 1e-11),
    "Fast": (Fast(), 1.0, np.sin(1000.0), 1e-10),
    "SquareRoot": (falling(0.5), 1.999, (0.5e-3) ** 2, 1e-12),
    "CubeRoot": (falling(1.0 / 3.0), 1.499, (1e-3 * 2.0 / 3.0) ** 1.5, 1e-12),
}


@pytest.mark.parametrize("name", GOING_ON)
def test_what_is_smooth_or_passes_a_jump_goes_on(name, exported):
    """Tolerances: a jump that is passed costs some 1e-13 to 1e-12, since the error of a step is not estimated there."""
    automaton, t_end, exact, within = GOING_ON[name]
    assert hm.simulate(automaton, t_end).end.x == pytest.approx(exact, abs=within)
    path = exported(automaton, f"going_on_{name}")
    assert run_event_exact(System([FmuSlave("a", path)], {}), t_end).final["a.x"] == pytest.approx(exact, abs=within)


class Modes(hm.ModalAutomaton):
    """The relay as the message says: a mode below the level, and one for what stays there."""

    x = hm.State(0.0, output=True)

    def up(self, s):
        return {"x": 1.0}

    def at_the_level(self, s):
        return s.x - 1.0

    modes = (hm.Mode("below", up), hm.Mode("sliding"))
    switches = (hm.Switch("arrive", "below", "sliding", at_the_level),)


def test_the_remedy_is_one():
    arc = hm.simulate(Modes(), 5.0)
    assert arc.event_times("arrive") == pytest.approx([1.0], abs=1e-12)
    assert arc.end.x == pytest.approx(1.0, abs=1e-12)

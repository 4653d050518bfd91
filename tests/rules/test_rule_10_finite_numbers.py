"""Rule 10: nothing that is not finite passes silently; the error names the variable."""

import math
import re

import numpy as np
import pytest
from child_python import run_child
from small_automata import Corridor, Ramp, Timer

import hybrid_model as hm

BAD = [math.nan, math.inf, -math.inf]


class Mass(hm.HybridAutomaton):
    """x' = v, v' = u, and a jump at x = 1: every number in it can be spoilt."""

    x = hm.State(0.0)
    v = hm.State(1.0)
    z = hm.DiscreteState(0.0)
    u = hm.Input(0.0)
    m = hm.Parameter(1.0)

    def flow_map(self, s):
        return {"x": s.v, "v": s.u / s.m}

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": 0.0}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("name", ["x", "v", "z", "u", "m"])
def test_start_values_and_parameters(name, bad):
    with pytest.raises(hm.DeclarationError, match=rf"Mass\.{name} = .*(nan|inf).* is not finite"):
        Mass(**{name: bad})


@pytest.mark.parametrize("bad", BAD)
def test_elements_of_vectors(bad):
    class Vector(hm.HybridAutomaton):
        w = hm.Parameter([1.0, 2.0])

    with pytest.raises(hm.DeclarationError, match=r"Vector\.w"):
        Vector(w=[1.0, bad])


@pytest.mark.parametrize("bad", BAD)
def test_computed_start_values(bad):
    class Computed(Mass):
        y = hm.DiscreteState(computed=True)

        def start_map(self, s):
            return {"y": bad}

    with pytest.raises(hm.SimulationError, match=r"Computed: y = -?(nan|inf) at the start"):
        hm.simulate(Computed(), 1.0)


@pytest.mark.parametrize("bad", BAD)
def test_constant_inputs(bad):
    with pytest.raises(hm.DeclarationError, match=r"Mass\.u"):
        hm.simulate(Mass(), 1.0, inputs={"u": bad})


@pytest.mark.parametrize("bad", BAD)
def test_input_signals(bad):
    with pytest.raises(hm.SimulationError, match=r"input u is .*(nan|inf).* at t = "):
        hm.simulate(Mass(), 0.9, inputs={"u": lambda t: bad if t > 0.5 else 0.0})


@pytest.mark.parametrize("bad", BAD)
def test_breakpoints_of_signals(bad):
    with pytest.raises(hm.DeclarationError, match=r"Signal has the breakpoints .*(nan|inf).*finite times"):
        hm.Signal(lambda t: 0.0, [0.3, bad, 0.1])


@pytest.mark.parametrize("bad", BAD)
def test_resets(bad):
    class Reset(Mass):
        def jump_map(self, s):
            return {"v": bad}

    with pytest.raises(hm.SimulationError, match=r"Reset: v = -?(nan|inf) after jump 'jump' at t = 1 s"):
        hm.simulate(Reset(), 2.0)


@pytest.mark.parametrize("bad", BAD)
def test_resets_of_discrete_states(bad):
    class Reset(Mass):
        def jump_map(self, s):
            return {"x": 0.0, "z": bad}

    with pytest.raises(hm.SimulationError, match=r"Reset: z = -?(nan|inf) after jump"):
        hm.simulate(Reset(), 2.0)


FLOW = """
import hybrid_model as hm

class Spoilt(hm.HybridAutomaton):
    x = hm.State(0.0)
    y = hm.State(0.0)
    when = hm.Parameter(0.0)

    def flow_map(self, s):
        return {"x": 1.0, "y": bad if s.t >= s.when else 1.0}

for method in hm.Method:
    for bad in (float("nan"), float("inf")):
        for when in (0.0, 0.5):
            try:
                hm.simulate(Spoilt(when=when), 1.0, solver=hm.Solver(method=method, rtol=1e-6, atol=1e-9))
            except hm.SimulationError as error:
                print(method.name, error, flush=True)
"""


@pytest.fixture(scope="module")
def told():
    """What is said of each method, in a child with a time limit: some of SciPy's loop for ever on such derivatives."""
    return [line.partition(" ")[::2] for line in run_child(FLOW, seconds=60).splitlines()]


@pytest.mark.parametrize("method", [method.name for method in hm.Method])
def test_flow_maps_end_with_an_error_and_never_hang(method, told):
    of_method = [line for name, line in told if name == method]
    assert len(of_method) == 4
    for line in of_method:
        assert re.match(r"Spoilt: .*\by = (nan|inf) at t = ", line)


def test_a_stepper_may_look_beyond_the_flow_set_and_come_back():
    class Root(hm.HybridAutomaton):
        """x' = -sqrt(x) from 1: x = (1 - t/2)^2, and nothing is defined below zero, which the last steps try."""

        x = hm.State(1.0)
        done = hm.DiscreteState(0)

        def flow_map(self, s):
            return {"x": -np.sqrt(s.x) if s.done < 0.5 else 0.0}

        def jump_set(self, s):
            return hm.least(1e-4 - s.x, 0.5 - s.done)

        def jump_map(self, s):
            return {"done": 1}

    arc = hm.simulate(Root(), 2.0)
    assert [jump.t for jump in arc.jumps] == pytest.approx([2.0 * (1.0 - 1e-2)], abs=1e-9)


def test_a_state_that_explodes():
    class Explosion(hm.HybridAutomaton):
        x = hm.State(1.0)

        def flow_map(self, s):
            return {"x": s.x**2}  # x = 1/(1 - t)

    with pytest.raises(hm.SimulationError, match=r"Explosion: .* t = (0\.999|1)"):
        hm.simulate(Explosion(), 2.0)


def test_jump_margins_along_a_flow():
    class Root(Mass):
        def jump_set(self, s):
            return np.sqrt(0.5 - s.x) - 10.0

    with pytest.raises(hm.SimulationError, match=r"Root: the margin of jump 'jump' is not a number at t = "):
        hm.simulate(Root(), 1.0)


@pytest.mark.parametrize("t_end", [0.0, 1.0])
def test_jump_margins_at_the_start(t_end):
    class Root(Mass):
        def jump_set(self, s):
            return s.x / s.x - 5.0

    with pytest.raises(hm.SimulationError, match=r"margin of jump 'jump' is not a number at t = 0 s"):
        hm.simulate(Root(), t_end)


@pytest.mark.parametrize("priority", list(hm.Priority))
def test_flow_margins(priority):
    class Logarithm(Corridor):
        def flow_set(self, s):
            return np.log(0.5 - s.x)

    Logarithm.priority = priority
    with pytest.raises(hm.SimulationError, match=r"Logarithm: the margin of the flow set is not a number at t = 0 s"):
        hm.simulate(Logarithm(x=0.75), 1.0)


def test_times_of_time_events():
    class Unknown(Timer):
        transitions = (hm.TimeEvent("tick", lambda self, s: s.period * np.nan, Timer.tick),)

    with pytest.raises(hm.SimulationError, match=r"Unknown: the time of jump 'tick' is not a number"):
        hm.simulate(Unknown(), 1.0)


def test_times_that_become_unknown():
    class Unknown(Timer):
        transitions = (hm.TimeEvent("tick", lambda self, s: 1.0 if s.k < 1 else np.nan, Timer.tick),)

    with pytest.raises(hm.SimulationError, match=r"'tick'.* is not a number"):
        hm.simulate(Unknown(), 2.0)


@pytest.mark.parametrize("name", ["rtol", "atol", "max_step", "scan_points", "event_tolerance"])
@pytest.mark.parametrize("bad", [0, -1, math.nan])
def test_solver_options(name, bad):
    with pytest.raises(hm.SimulationError, match=rf"solver option {name} = {bad}: give"):
        hm.Solver(**{name: bad})


def test_scan_points_are_whole():
    with pytest.raises(hm.SimulationError, match=r"scan_points = 2\.5"):
        hm.Solver(scan_points=2.5)


@pytest.mark.parametrize("name", ["rtol", "atol", "event_tolerance"])
def test_tolerances_are_finite(name):
    with pytest.raises(hm.SimulationError, match=rf"{name} = inf"):
        hm.Solver(**{name: math.inf})


def test_a_point_in_time_that_is_not_a_number():
    arc = hm.simulate(Ramp(), 1.0)
    with pytest.raises(hm.DeclarationError, match="nan"):
        arc.at("x", math.nan)


def test_denormal_and_negative_zero_values_are_numbers():
    for value in (5e-324, -0.0, 1e-300):
        arc = hm.simulate(Ramp(x=value), 0.75)
        assert [jump.t for jump in arc.jumps] == pytest.approx([0.5], abs=1e-12)


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning:scipy")
def test_huge_values_are_finite_or_refused():
    arc = hm.simulate(Ramp(x=1e300, rate=1e290, threshold=1e291), 15.0)
    # Floats near 1e300 are 1.5e284 apart: 1.5e-6 s at this rate.
    assert [jump.t for jump in arc.jumps] == pytest.approx([10.0], abs=1.5e-6)
    with pytest.raises(hm.SimulationError, match="x"):
        hm.simulate(Ramp(x=1.7e308, rate=1e308, threshold=1.7e308), 10.0)

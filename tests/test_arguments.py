"""Slips in the arguments of a run are answered by one sentence with the remedy."""

import math
from fractions import Fraction

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (BouncingBall, r"simulate was given the class BouncingBall, but takes an instance: write BouncingBall\(\)\."),
        (hm.Composition, r"the class Composition, but takes an instance: write Composition\(\)\."),
        (int, "simulate was given <class 'int'>, but takes an automaton: give an instance"),
        (
            "ball",
            "simulate was given 'ball', but takes an automaton: give an instance of a HybridAutomaton or a Compos",
        ),
        (None, "simulate was given None, but takes an automaton"),
    ],
)
def test_only_an_instance_of_an_automaton_runs(given, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        hm.simulate(given, 1.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            {"solver": "Radau"},
            r"solver = 'Radau' is no Solver: write solver=Solver\(method='Radau'\), or leave solver out",
        ),
        ({"solver": {"rtol": 1e-6}}, r"solver = {'rtol': 1e-06} is no Solver: write solver=Solver\(\.\.\.\)"),
        ({"solver": hm.Solver}, r"is no Solver: write solver=Solver\(\.\.\.\)"),
        ({"zeno": 500}, r"zeno = 500 is no ZenoGuard: write zeno=ZenoGuard\(max_jumps=500\)"),
        ({"inputs": 1.0}, r"inputs = 1\.0 is no mapping: write inputs={\"name of the input\": value}"),
        ({"t_start": "0"}, "t_start = '0' is not a number: give a number in s"),
        ({"t_start": None}, "t_start = None is not a number"),
    ],
)
def test_options_of_another_type(options, sentence):
    with pytest.raises(hm.SimulationError, match=sentence):
        hm.simulate(BouncingBall(), 1.0, **options)


@pytest.mark.parametrize("t_end", ["1", None, [1.0], np.array([1.0]), 1j, b"1"])
def test_an_end_time_that_is_no_number(t_end):
    with pytest.raises(hm.SimulationError, match=r"^t_end = .* is not a number: give a number in s\.$"):
        hm.simulate(BouncingBall(), t_end)


@pytest.mark.parametrize("half", [0.5, np.float32(0.5), np.array(0.5), Fraction(1, 2)])
def test_numbers_of_every_type_are_times(half):
    # Free fall from 1 m: h = 1 - g t^2 / 2; 1e-12 covers the tolerances of the run.
    assert hm.simulate(BouncingBall(), half / 2).end.h == pytest.approx(1.0 - 9.81 / 32.0, abs=1e-12)


@pytest.mark.parametrize("name", ["jumps_at_once", "jumps_in_window", "max_jumps"])
@pytest.mark.parametrize("wrong", [0, -1, 2.5, math.nan, math.inf, "5", None])
def test_counts_of_the_zeno_guard_are_whole_and_positive(name, wrong):
    with pytest.raises(hm.SimulationError, match=rf"^ZenoGuard option {name} = .*: give a whole number of jumps"):
        hm.ZenoGuard(**{name: wrong})


@pytest.mark.parametrize("name", ["window", "remainder", "spread"])
@pytest.mark.parametrize("wrong", [-1e-9, math.nan, math.inf, "1", None])
def test_limits_of_the_zeno_guard_are_finite_and_not_negative(name, wrong):
    with pytest.raises(hm.SimulationError, match=rf"^ZenoGuard option {name} = .*: give a finite number, 0 or more"):
        hm.ZenoGuard(**{name: wrong})


def test_the_zeno_guard_takes_the_smallest_limits_and_whole_floats():
    guard = hm.ZenoGuard(jumps_at_once=1, jumps_in_window=1e2, max_jumps=np.int64(3), window=0, remainder=0.0)
    assert (guard.jumps_in_window, guard.max_jumps) == (100, 3)
    arc = hm.simulate(Thermostat(), 1e3, zeno=guard)
    assert arc.stop is hm.Stop.JUMPS
    assert len(arc.jumps) == 3

"""Slips in the arguments of a run are answered by one sentence with the remedy."""

import math
import re
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
@pytest.mark.parametrize("wrong", [-1e-9, math.nan, math.inf, "1"])
def test_limits_of_the_zeno_guard_are_finite_and_not_negative(name, wrong):
    with pytest.raises(hm.SimulationError, match=rf"^ZenoGuard option {name} = .*: give a finite number, 0 or more"):
        hm.ZenoGuard(**{name: wrong})


def test_the_zeno_guard_takes_the_smallest_limits_and_whole_floats():
    guard = hm.ZenoGuard(jumps_at_once=1, jumps_in_window=1e2, max_jumps=np.int64(3), window=0, remainder=0.0)
    assert (guard.jumps_in_window, guard.max_jumps) == (100, 3)
    arc = hm.simulate(Thermostat(), 1e3, zeno=guard)
    assert arc.stop is hm.Stop.JUMPS
    assert len(arc.jumps) == 3


class Follower(hm.HybridAutomaton):
    """y' = u - y."""

    u = hm.Input(0.0)
    y = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"y": s.u - s.y}


RUNS = {
    "simulate": lambda *given, **named: hm.simulate(BouncingBall(), *given, **named),
    "simulate_network": lambda *given, **named: hm.simulate_network(
        hm.product("balls", BouncingBall("a"), BouncingBall("b")), *given, **named
    ),
}


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize(
    ("given", "named", "sentence"),
    [
        ((1.0,), {"rtol": 1e-6}, r"has no option 'rtol': write solver=hm\.Solver\(rtol=1e-06\)\."),
        ((1.0,), {"method": "Radau"}, r"has no option 'method': write solver=hm\.Solver\(method='Radau'\)\."),
        ((1.0,), {"max_jumps": 5}, r"has no option 'max_jumps': write zeno=hm\.ZenoGuard\(max_jumps=5\)\."),
        ((1.0,), {"input": {}}, r"has no option 'input': write 'inputs'\."),
        (
            (1.0,),
            {"tolerance": 1},
            r"has no option 'tolerance'; it has t_start, inputs(, starts)?, solver, zeno, engine, (record|events_to, )",
        ),
        ((), {}, r"needs t_end: write {name}\((automaton|network), t_end\)\."),
        (
            (0.0, 1.0),
            {},
            r"takes (automaton|network) and t_end by position, but 3 arguments were given: give the others",
        ),
        ((1.0,), {"t_end": 2.0}, r"was given (automaton|network) twice"),
        (((0.0, 1.0),), {}, None),
    ],
)
def test_arguments_that_a_run_does_not_have(name, given, named, sentence):
    with pytest.raises(hm.SimulationError) as caught:
        RUNS[name](*given, **named)
    if sentence is None:
        assert (
            str(caught.value) == "t_end = (0.0, 1.0) is not a number: give a number in s, and the start by t_start=...."
        )
    else:
        assert re.match(
            f"^{name} {sentence.format(name=name) if '{name}' in sentence else sentence}", str(caught.value)
        )


def test_variables_are_no_options_of_a_run():
    with pytest.raises(hm.SimulationError, match=r"simulate has no option 'u': write inputs={'u': 2\.0}\."):
        hm.simulate(Follower(), 1.0, u=2.0)
    with pytest.raises(
        hm.SimulationError, match=r"'h': values are given when an instance is made, BouncingBall\(h=2\.0\)\."
    ):
        hm.simulate(BouncingBall(), 1.0, h=2.0)
    with pytest.raises(
        hm.SimulationError, match=r"verify has no option 'rtol': write tolerances=hm\.Tolerances\(rtol=0\.1\)"
    ):
        hm.verify(BouncingBall(), hm.simulate(BouncingBall(), 0.1), rtol=0.1)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        (lambda: 1.0, r"input u takes \(\), but is called with \(t\): write lambda t: \.\.\."),
        (lambda t, s: 1.0, r"input u takes \(t, s\), but is called with \(t\)"),
        (lambda t: "on", r"input u is 'on' at t = 0 s: return numbers"),
        (lambda t: None, r"input u is None at t = 0 s: return numbers"),
        (lambda t: 1j, r"input u is 1j, a complex number at t = 0 s: return numbers"),
        ("on", r"Follower\.u = 'on' is not a number"),
        ("1", r"Follower\.u = '1' is not a number"),
        (None, r"Follower\.u = None is not a number"),
    ],
)
def test_values_of_an_input(value, sentence):
    with pytest.raises(hm.HybridModelError, match=f"^{sentence}"):
        hm.simulate(Follower(), 1.0, inputs={"u": value})


def test_a_signal_needs_a_function():
    with pytest.raises(
        hm.DeclarationError, match=r"^value of a Signal is 1\.0, but must be a function: write lambda t: "
    ):
        hm.Signal(1.0, [0.5])


class Unmade(BouncingBall):
    def __init__(self):
        self.colour = "red"


@pytest.mark.parametrize(
    "use",
    [
        lambda: hm.simulate(Unmade(), 1.0),
        lambda: hm.product("balls", Unmade()),
        lambda: hm.MinimumDwell(Unmade(), 0.1),
        lambda: hm.verify(Unmade(), None),
    ],
)
def test_an_own_constructor_must_call_that_of_its_base(use):
    with pytest.raises(hm.DeclarationError, match=r"Unmade has an __init__ that .*: call super\(\).__init__\(\.\.\.\)"):
        use()


@pytest.mark.parametrize(
    ("compose", "sentence"),
    [
        (lambda a, b: hm.product("p", [a, b]), r"^p: a part is \[.*: give automata one after the other, or \*parts"),
        (lambda a, b: hm.product("p", {"a": a}), r"^p: a part is a mapping: .* write hm\.Composition"),
        (lambda a, b: hm.product(a, b), r"^a composition was given .* as its name: give a text first"),
        (lambda a, b: hm.product("p", BouncingBall, b), r"^BouncingBall is a class: make an instance of it"),
        (lambda a, b: hm.series("p", a, [b], {}), r"^p: a part is \["),
        (
            lambda a, b: hm.series("p", a, b, "h"),
            r"^p: the connections are 'h': give a mapping, {'input of b': 'output of",
        ),
        (lambda a, b: hm.feedback("p", a, b, {}, [("u", "y")]), r"^p: the connections are \[\('u', 'y'\)\]"),
        (
            lambda a, b: hm.Composition("p", [a, b]),
            r"^p: the parts are \[.*: give a mapping, .* hm\.product\('p', first",
        ),
        (lambda a, b: hm.Composition({"a": a}, {}), r"^a composition was given .* as its name"),
        (lambda a, b: hm.Composition("p", {1: a}), r"^p: a part has the name 1: give texts"),
        (lambda a, b: hm.Composition("p", {"a": a}, [("a.u", "a.h")]), r"^p: the connections are \[.*: give a mapping"),
        (
            lambda a, b: hm.Composition("p", {"a": a, "f": Follower()}, {"f.u": 1.0}),
            r"^p: f\.u is connected to 1\.0: name",
        ),
        (
            lambda a, b: hm.Composition("p", {"a": a, "f": Follower()}, {"f.u": a}),
            r"^p: f\.u is connected to .*: name an",
        ),
        (
            lambda a, b: hm.Composition("p", {"f": Follower()}, {3: "f.y"}),
            r"^p: 3 is not an input: write 'part\.variable'",
        ),
    ],
)
def test_compositions_of_something_else(compose, sentence):
    with pytest.raises(hm.HybridModelError, match=sentence):
        compose(BouncingBall("a"), BouncingBall("b"))


@pytest.mark.parametrize("dwell", ["1", None, 0.0, math.nan])
def test_a_dwell_time_is_a_number(dwell):
    with pytest.raises(
        hm.DeclarationError, match=r"^the minimum dwell time of BouncingBall is .* s: give a positive time"
    ):
        hm.MinimumDwell(BouncingBall(), dwell)


@pytest.mark.parametrize(
    ("slip", "meant"), [("metod", "solver=hm.Solver(method='RK45')"), ("maxjumps", "zeno=hm.Zeno")]
)
def test_slips_in_the_name_of_an_option_of_an_option(slip, meant):
    with pytest.raises(hm.SimulationError, match=re.escape(f"simulate has no option '{slip}': write {meant}")):
        hm.simulate(BouncingBall(), 1.0, **{slip: "RK45"})

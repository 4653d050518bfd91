"""Which automata share a key, what a snapshot holds on to, and what is left with an automaton."""

import copy
import gc
import pickle
import sys
import types
import weakref
from dataclasses import replace

import numpy as np
import pytest
from notebook import Notebook

import hybrid_model as hm
from hybrid_model.consensus import closed_loop, load_scenario
from hybrid_model.consensus.weights.function import FunctionWeight
from hybrid_model.consensus.weights.kinds import weights_block
from hybrid_model.declare.dwell import MinimumDwell
from hybrid_model.declare.state_space import state_space
from hybrid_model.models import BouncingBall, Fireflies, RestingBall, SwitchedFeedback, Thermostat
from hybrid_model.native.free_values.snapshots import current, snapshot, why_untold

BLOCK = """
class Block(hm.HybridAutomaton):
    x = hm.State(1.0)
    k = hm.Parameter(2.0)
    def flow_map(self, s): return {'x': -s.k * s.x}
"""


def key(automaton):
    found = snapshot(automaton)
    assert found is not None, why_untold(automaton)
    return found.key


def changed(automaton, change):
    then = snapshot(automaton)
    assert then.still_holds()
    change()
    assert not then.still_holds()
    return key(automaton) != then.key


# Instances of one class.


def test_values_of_parameters_and_start_values_are_data():
    assert key(BouncingBall(e=0.5, h=3.0)) == key(BouncingBall(e=0.7))


def test_lengths_are_no_data():
    assert key(Fireflies(phase=[0.1, 0.2])) == key(Fireflies(phase=[0.3, 0.9]))
    assert key(Fireflies(phase=[0.1, 0.2])) != key(Fireflies(phase=[0.1, 0.2, 0.3]))


def test_names_are_no_data():
    assert key(BouncingBall("left")) != key(BouncingBall("right"))


def test_classes_differ():
    assert key(BouncingBall("one")) != key(Thermostat("one"))


def test_the_priority_is_part_of_it():
    ball = type("Ball", (BouncingBall,), {})()
    assert changed(ball, lambda: setattr(type(ball), "priority", hm.Priority.FLOW))


def test_a_cell_that_is_run_again_gives_the_same_class():
    notebook = Notebook(BLOCK)
    then = key(notebook["Block"]())
    notebook.run(BLOCK.replace("2.0", "3.0"))
    assert key(notebook["Block"]()) == then
    notebook.run(BLOCK.replace("-s.k", "s.k"))
    assert key(notebook["Block"]()) != then


def test_two_notebooks_with_other_globals_differ():
    cell = BLOCK.replace("-s.k", "G * s.k")
    one, other, same = Notebook("G = 1.0", cell), Notebook("G = 2.0", cell), Notebook("G = 1.0", cell)
    assert key(one["Block"]()) != key(other["Block"]())
    assert key(one["Block"]()) == key(same["Block"]())


def test_scenarios_with_other_numbers_share_a_key():
    scenario = load_scenario("paper-a")
    other = replace(scenario, network=replace(scenario.network, initial=(1.0, 2.0, 3.0, 4.0)))
    assert key(closed_loop(scenario)) == key(closed_loop(other))


# Jumps, modes, compositions.


def test_a_lambda_in_a_jump_that_reads_a_loop_variable():
    notebook = Notebook(
        """
        def jumps():
            made = []
            for level in (1.0, 2.0):
                made.append(hm.Jump(f"at{level}", lambda self, s: s.x - level, lambda self, s: {"x": 0.0}))
            def move(to):
                nonlocal level
                level = to
            return tuple(made), move
        made, move = jumps()
        class Block(hm.HybridAutomaton):
            x = hm.State(0.0)
            transitions = made
            def flow_map(self, s): return {"x": 1.0}
        block = Block()
        """
    )
    assert changed(notebook["block"], lambda: notebook["move"](3.0))


def test_a_jump_that_the_class_lists_in_the_place_of_another_is_for_new_instances():
    notebook = Notebook(
        """
        def jump(level): return hm.Jump("jump", lambda self, s: s.x - level, lambda self, s: {"x": 0.0})
        class Block(hm.HybridAutomaton):
            x = hm.State(0.0)
            transitions = (jump(1.0),)
            def flow_map(self, s): return {"x": 1.0}
        """
    )
    then = key(notebook["Block"]())
    notebook.run("Block.transitions = (jump(1.0),)")
    assert key(notebook["Block"]()) == then
    notebook.run("Block.transitions = (jump(2.0),)")
    assert key(notebook["Block"]()) != then


MODES = """
G = 1.0
class Heater(hm.ModalAutomaton):
    T = hm.State(20.0)
    modes = (hm.Mode("on", lambda self, s: {"T": G}), hm.Mode("off", lambda self, s: {"T": -1.0}))
    switches = (hm.Switch("stop", "on", "off", lambda self, s: s.T - high()),)
def high(): return 22.0
heater = Heater()
"""


@pytest.mark.parametrize("cell", ["G = 2.0", "def high(): return 23.0"])
def test_modes_and_switches_are_followed(cell):
    notebook = Notebook(MODES)
    assert changed(notebook["heater"], lambda: notebook.run(cell))


def test_maps_of_a_base_class_and_super():
    notebook = Notebook(
        BLOCK.replace("-s.k", "-G * s.k"),
        """
        G = 1.0
        class Doubled(Block):
            def flow_map(self, s): return {"x": 2.0 * super().flow_map(s)["x"]}
        doubled = Doubled()
        """,
    )
    assert changed(notebook["doubled"], lambda: notebook.run("G = 2.0"))


def test_parts_of_a_composition_are_followed():
    notebook = Notebook("G = 1.0", BLOCK.replace("-s.k", "-G * s.k"))
    inner = hm.product("inner", notebook["Block"]("a"), BouncingBall("b"))
    outer = hm.product("outer", inner, BouncingBall("c"))
    assert changed(outer, lambda: notebook.run("G = 2.0"))


def test_a_part_that_is_replaced():
    whole = hm.product("whole", BouncingBall("a"), BouncingBall("b"))
    assert changed(
        whole, lambda: whole.parts.update(a=type("Other", (BouncingBall,), {"flow_set": lambda self, s: 1.0})("a"))
    )


def test_the_wiring_is_part_of_it():
    then = key(SwitchedFeedback())
    whole = SwitchedFeedback()
    assert key(whole) == then
    wires = whole._wires["switch"]
    assert changed(whole, lambda: wires.update(u0=wires["u1"]))


def test_what_is_wrapped_is_followed():
    notebook = Notebook("G = 1.0", BLOCK.replace("-s.k", "-G * s.k"))
    held = MinimumDwell(notebook["Block"](), 0.1)
    assert changed(held, lambda: notebook.run("G = 2.0"))


def test_a_method_of_the_library_that_is_replaced(monkeypatch):
    ball = BouncingBall()
    assert changed(ball, lambda: monkeypatch.setattr(BouncingBall, "flow_set", lambda self, s: 1.0 + s.h))


def test_an_instance_attribute_of_a_library_model():
    ball = RestingBall()
    assert changed(ball, lambda: setattr(ball, "mode_names", ("up", "down")))


def test_a_weight_that_is_a_function_of_time():
    notebook = Notebook("level = [2.0]\ndef weight(t): return level[0] + np.sin(t)")
    weights = weights_block([FunctionWeight(notebook["weight"])])
    assert changed(weights, lambda: notebook.run("level[0] = 3.0"))


def test_an_automaton_that_is_no_hybrid_automaton():
    notebook = Notebook(
        BLOCK,
        """
        from hybrid_model.declare.wrapper import Wrapper
        G = 1.0
        class Faster(Wrapper):
            def derivatives(self, s):
                return {name: G * rate for name, rate in super().derivatives(s).items()}
        faster = Faster(Block())
        """,
    )
    assert changed(notebook["faster"], lambda: notebook.run("G = 2.0"))


def test_a_system_of_matrices_shares_its_key_with_others_of_its_shape():
    def system(gain):
        return state_space([[gain]], [[1.0]], [[1.0]], inputs=["u"], outputs=["y"])

    assert key(system(-1.0)) == key(system(-2.0))


# Modules.


@pytest.fixture
def config(monkeypatch):
    module = types.ModuleType("numbers_of_the_plant")
    module.G = 9.81
    module.H = 1.0
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module


@pytest.mark.parametrize(
    "cells",
    [
        ("import numbers_of_the_plant as config", "config.G"),
        ("import numbers_of_the_plant as config\nalias = [config]", "alias[0].G"),
        ("def g():\n    import numbers_of_the_plant\n    return numbers_of_the_plant.G", "g()"),
        ("def g():\n    from numbers_of_the_plant import G\n    return G", "g()"),
    ],
)
def test_attributes_of_modules(config, cells):
    notebook = Notebook(cells[0], BLOCK.replace("-s.k", f"-{cells[1]} * s.k"))
    block = notebook["Block"]()
    then = key(block)
    config.H = 2.0
    assert key(block) == then
    assert changed(block, lambda: setattr(config, "G", 1.62))


def test_a_module_that_makes_its_attributes(config):
    del config.G
    config.__getattr__ = lambda name: 9.81
    notebook = Notebook("import numbers_of_the_plant as config", BLOCK.replace("-s.k", "-config.G * s.k"))
    assert changed(notebook["Block"](), lambda: setattr(config, "G", 1.62))


@pytest.mark.parametrize(
    "cells",
    [
        ("from numpy import where, sin, pi", "where(True, sin(pi), 1.0)"),
        ("from numpy.linalg import norm", "norm([3.0, 4.0])"),
        ("from math import hypot, pi", "hypot(pi, 1.0)"),
        ("from scipy.linalg import expm", "expm(np.eye(2))[0, 0]"),
        ("from scipy.special import erf", "erf(1.0)"),
        ("from hybrid_model import least", "least(1.0, 2.0)"),
        ("import functools, operator", "functools.reduce(operator.mul, [1.0, 2.0])"),
        ("from fractions import Fraction", "float(Fraction(1, 3))"),
        ("from itertools import pairwise", "sum(b - a for a, b in pairwise([1.0, 2.0]))"),
        ("matrix = np.eye(2, dtype=np.float32)", "matrix[0, 0].astype(np.float64)"),
        ("import enum\nclass Level(enum.IntEnum):\n    HIGH = 2", "Level.HIGH"),
        ("from collections import Counter", "Counter('aab')['a']"),
        ("from dataclasses import dataclass\n@dataclass(slots=True)\nclass P:\n    g: float = 1.0\np = P()", "p.g"),
        ("import abc\nclass Law(abc.ABC):\n    g = 1.0\nclass Own(Law): pass\nlaw = Own()", "law.g"),
        ("from typing import Generic, TypeVar\nT = TypeVar('T')\nclass Law(Generic[T]):\n    g = 1.0", "Law().g"),
        ("huge = 10 ** 5000", "(huge > 1) * 1.0"),
        ("table = {k: float(k) for k in range(1000)}", "table[500]"),
    ],
)
def test_what_is_often_read_can_be_told(cells):
    block = Notebook(cells[0], BLOCK.replace("-s.k", f"-{cells[1]} * s.k"))["Block"]()
    then = snapshot(block)
    assert then is not None, why_untold(block)
    assert then.still_holds()


# What a snapshot holds on to.


def test_a_snapshot_that_is_kept_dies_with_its_automaton():
    block = Notebook(BLOCK.replace("-s.k", "-self.g() * s.k"))["Block"]()
    block.g = types.MethodType(lambda self: 1.0, block)
    assert current(block) is current(block)
    gone = weakref.ref(block)
    del block
    gc.collect()
    assert gone() is None


def test_what_is_kept_is_taken_anew_when_something_has_changed():
    notebook = Notebook("G = 1.0", BLOCK.replace("-s.k", "-G * s.k"))
    block = notebook["Block"]()
    then = current(block)
    notebook.run("G = 2.0")
    assert current(block) is not then
    assert current(block).key != then.key
    notebook.run("G = 1.0")
    assert current(block).key == then.key


@pytest.mark.parametrize("make", [copy.copy, copy.deepcopy, lambda ball: pickle.loads(pickle.dumps(ball))])
def test_a_copy_has_a_snapshot_of_its_own(make):
    ball = BouncingBall()
    then = current(ball)
    other = make(ball)
    assert current(other) is not then
    assert current(other).key == then.key
    assert current(ball).key == then.key
    other.name = "other"
    assert current(other).key != then.key
    assert current(ball).key == then.key


def test_what_is_kept_with_a_composition_is_no_part_of_it():
    whole = SwitchedFeedback()
    then = current(whole)
    for part in whole.parts.values():
        current(part)
    assert current(whole).key == then.key
    assert current(whole) is current(whole)


def test_why_something_cannot_be_told():
    notebook = Notebook("rng = np.random.default_rng(1)", BLOCK.replace("-s.k", "-rng.random() * s.k"))
    assert "Generator" in why_untold(notebook["Block"]())
    assert why_untold(BouncingBall()) is None


def test_an_object_that_no_map_names_may_be_of_any_kind():
    ball = type("Ball", (BouncingBall,), {})()
    ball.stream = iter([1])
    assert snapshot(ball) is not None


def test_arrays_are_compared_by_content():
    notebook = Notebook("table = np.arange(1000.0)", BLOCK.replace("-s.k", "-table[3] * s.k"))
    block = notebook["Block"]()
    then = snapshot(block)
    notebook.run("table[3] = 3.0")
    assert then.still_holds()
    assert changed(block, lambda: notebook.run("table.shape = (10, 100)"))
    assert changed(block, lambda: np.copyto(notebook["table"], 0.0))

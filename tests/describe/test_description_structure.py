"""ModelStructure: dependencies and their kinds, against hand-made analysis and against numbers."""

import itertools

import casadi as ca
import numpy as np
import pytest
from catalogue import cases
from description_cases import BOTH, described
from drawing import examples
from hypothesis import given
from hypothesis import strategies as st

import hybrid_model as hm
from fmu.describe.model_structure import model_structure
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Bank, Fmi
from hybrid_model.models import BouncingBall
from hybrid_model.native.factors import Factor, factors
from hybrid_model.native.networks.network import network_trace
from hybrid_model.native.trace import trace


def by_name(description, unknowns):
    names = description.names
    return {names[u.variable]: dict(zip((names[k] for k in u.dependencies), u.kinds, strict=True)) for u in unknowns}


class Kinds(hm.HybridAutomaton):
    """One dependency of each kind."""

    x = hm.State(1.0)
    y = hm.State(computed=True, output=True)
    mode = hm.DiscreteState(1.0, output=True)
    p = hm.Parameter(2.0)
    u = hm.Input(0.5)
    v = hm.Input(0.5, discrete=True)
    constant = hm.Output()
    fixed = hm.Output()
    switched = hm.Output()
    free = hm.Output()
    stepped = hm.Output()
    clocklike = hm.Output()

    def flow_map(self, s):
        return {"x": s.p * s.u - 3.0 * s.x, "y": s.mode * s.v}

    def start_map(self, s):
        return {"y": 2.0 * s.x + s.p}

    def outputs(self, s):
        return {
            "constant": 2.0 * s.u + s.p + s.mode,
            "fixed": s.p**2 * s.u + s.x**2,
            "switched": np.where(s.mode > 0.5, 2.0, 3.0) * s.u,
            "free": s.u * s.v,
            "stepped": s.u + np.where(s.u > 0.0, 1.0, 0.0) + 4.0 * s.x,
            "clocklike": s.y + np.sin(s.t),
        }


@pytest.mark.parametrize("fmi", BOTH)
def test_kinds_of_dependencies_while_running(fmi):
    description = described(Kinds(), fmi)
    found = by_name(description, description.structure.outputs)
    assert found == {
        "constant": {"u": "constant"},
        "fixed": {"u": "fixed", "x": "dependent"},
        "switched": {"u": "discrete"},
        "free": {"u": "dependent", "v": "dependent"},
        "stepped": {"u": "dependent", "x": "constant"},
        "clocklike": {"time": "dependent", "y": "constant"},
        "y": {"y": "constant"},
        "mode": {},
    }
    assert by_name(description, description.structure.derivatives) == {
        "der(x)": {"u": "fixed", "x": "constant"},
        "der(y)": {"v": "discrete"},
    }


@pytest.mark.parametrize("fmi", BOTH)
def test_dependencies_at_the_start_go_through_computed_states(fmi):
    description = described(Kinds(), fmi)
    found = by_name(description, description.structure.initial)
    assert found == {
        "constant": {"p": "constant", "u": "constant", "mode": "constant"},
        "fixed": {"p": "dependent", "u": "dependent", "x": "dependent"},
        "switched": {"mode": "dependent", "u": "dependent"},
        "free": {"u": "dependent", "v": "dependent"},
        "stepped": {"u": "dependent", "x": "constant"},
        # y starts at 2 x + p.
        "clocklike": {"time": "dependent", "x": "constant", "p": "constant"},
        "y": {"x": "constant", "p": "constant"},
        "der(x)": {"u": "dependent", "p": "dependent", "x": "constant"},
        "der(y)": {"mode": "dependent", "v": "dependent"},
    }


def test_indicators_and_clocks_depend_on_what_their_margins_do():
    description = described(BouncingBall(), Fmi.V3_0)
    assert by_name(description, description.structure.indicators) == {
        "margin.jump": {"h": "dependent", "v": "dependent"},
        "margin.flow_set": {"h": "constant"},
    }
    outputs = by_name(description, description.structure.outputs)
    # The countdown clock, where there is one, contributes to every tick.
    assert {"h", "v"} <= set(outputs["impact"]) <= {"h", "v", "next_event"}


class Watcher(hm.HybridAutomaton):
    """Counts when an input comes near, and remembers another one."""

    near = hm.Input(0.0)
    value = hm.Input(0.0, discrete=True)
    other = hm.Input(0.0)
    level = hm.Parameter(1.0)
    seen = hm.DiscreteState(0.0, output=True)
    ticks = hm.DiscreteState(0, integer=True, output=True)
    still = hm.DiscreteState(0.0, output=True)
    doubled = hm.Output(discrete=True)

    def jump_set(self, s):
        return s.near - s.level - s.ticks

    def jump_map(self, s):
        return {"seen": s.value, "ticks": s.ticks + 1}

    def outputs(self, s):
        return {"doubled": 2.0 * s.seen}


@pytest.mark.parametrize("fmi", BOTH)
def test_discrete_outputs_depend_on_what_decides_about_the_next_jump(fmi):
    """In Event Mode they show its outcome at once: margins decide whether, jump maps what."""
    traced = trace(Watcher())
    variables = fmu_variables(traced, fmi)
    found = {
        variables[u.variable].name: {variables[k].name for k in u.dependencies}
        for u in model_structure(traced, variables).outputs
    }
    found.pop("clock", None)
    assert found == {"seen": {"near", "value"}, "ticks": {"near"}, "still": set(), "doubled": {"near", "value"}}


def test_derivatives_are_in_the_order_of_the_state_vector():
    description = described(Kinds(), Fmi.V3_0)
    variables = description.variables
    indices = [variables[u.variable].index for u in description.structure.derivatives]
    assert indices == sorted(indices)
    assert all(variables[u.variable].bank is Bank.DERIVATIVE for u in description.structure.derivatives)


def test_an_array_depends_as_its_freest_element():
    """In FMI 3.0 an array is one variable: u enters one element by a constant factor and the other squared."""

    class Block(hm.HybridAutomaton):
        n = hm.Dimension()
        x = hm.State(0.0, shape="n")
        u = hm.Input(1.0)
        w = hm.Input(1.0)

        def flow_map(self, s):
            return {"x": np.stack([s.u + s.w, s.u**2])}

    description = described(Block(n=2), Fmi.V3_0)
    assert by_name(description, description.structure.derivatives) == {"der(x)": {"u": "dependent", "w": "constant"}}
    scalar = described(Block(n=2), Fmi.V2_0)
    assert by_name(scalar, scalar.structure.derivatives) == {
        "der(x[1])": {"u": "constant", "w": "constant"},
        "der(x[2])": {"u": "dependent"},
    }


ARGUMENTS = [ca.SX.sym(name, size) for name, size in (("t", 1), ("x", 2), ("z", 1), ("u", 2), ("p", 1))]
SCALARS = [ARGUMENTS[k][i] for k in range(5) for i in range(ARGUMENTS[k].numel())]
OPERATIONS = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "least": ca.fmin,
    "choose": lambda a, b: ca.if_else(a > 0.25, b, 2 * a),
    "sine": lambda a, b: ca.sin(a),
    "floor": lambda a, b: ca.floor(a),
    "sign": lambda a, b: ca.sign(a) * b,
}
LEAVES = st.one_of(st.integers(0, len(SCALARS) - 1), st.sampled_from([2.0, -1.0, 0.5]))
TREES = st.recursive(LEAVES, lambda tree: st.tuples(st.sampled_from(sorted(OPERATIONS)), tree, tree), max_leaves=6)


def grown(tree):
    """A tree of names and numbers as an expression; whole numbers are the places of arguments."""
    if isinstance(tree, tuple):
        return OPERATIONS[tree[0]](grown(tree[1]), grown(tree[2]))
    return SCALARS[tree] if isinstance(tree, int) else ca.SX(tree)


@given(st.lists(TREES, min_size=1, max_size=3), st.integers(0, 2**31))
@examples(25, 100)
def test_kinds_hold_for_numbers(trees, seed):
    """A factor that is called constant is one number at all points, a fixed one at all points with the same p, ..."""
    function = ca.Function("drawn", ARGUMENTS, [ca.vertcat(*map(grown, trees))])
    found = factors(function).toarray()
    random = np.random.default_rng(seed)
    may_change = {
        0: range(7),
        Factor.CONSTANT + 1: range(7),
        Factor.FIXED + 1: range(6),
        Factor.DISCRETE + 1: (0, 1, 2, 4, 5),
    }
    base = random.normal(size=len(SCALARS))
    for row, column in itertools.product(*map(range, found.shape)):
        if found[row, column] == Factor.DEPENDENT + 1:
            continue
        slopes = []
        for _ in range(4):
            point = base.copy()
            free = list(may_change[int(found[row, column])])
            point[free] = random.normal(size=len(free))
            moved = point.copy()
            moved[column] += random.normal()
            change = (_value(function, moved) - _value(function, point))[row]
            slopes.append(change / (moved[column] - point[column]) if found[row, column] else change)
        if found[row, column] == 0:
            assert np.all(np.array(slopes) == 0.0)
        else:
            # Values are of order one; differences of them lose some digits.
            assert np.ptp(slopes) < 1e-6 * (1.0 + np.abs(slopes).max())


def _value(function, point):
    parts = np.split(point, np.cumsum([argument.numel() for argument in ARGUMENTS])[:-1])
    return np.asarray(function(*parts)).ravel()


@pytest.mark.parametrize("name", ["paper_dynamic", "firefly_network", "juggled_ball"])
def test_a_network_of_tables_has_the_structure_of_the_whole(name):
    """The dependencies chained over the wires are those of the composed expressions; only their kinds are not known."""
    automaton = cases()[name].automaton
    whole, tables = trace(automaton), network_trace(automaton)
    for fmi in BOTH:
        variables = fmu_variables(whole, fmi)
        expected, found = model_structure(whole, variables), model_structure(tables, variables)
        for part in ("outputs", "derivatives", "initial", "indicators"):
            assert [(u.variable, u.dependencies) for u in getattr(found, part)] == [
                (u.variable, u.dependencies) for u in getattr(expected, part)
            ]
            assert all(u.kinds is None for u in getattr(found, part))

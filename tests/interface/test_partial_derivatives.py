"""Directional and adjoint derivatives: against CasADi's Jacobian, differences of the FMU itself, and each other."""

import ctypes as c
import math

import casadi as ca
import numpy as np
import pytest
from fmi_driver.binary import DISCARD, ERROR, OK, doubles
from fmi_driver.journey import SETTINGS, Journey
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from witnesses_ends import Pole

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, element_names
from hybrid_model.native.trace import trace

FORWARD, REVERSE = "GetDirectionalDerivative", "GetAdjointDerivative"
MODES = ["initialization", "running"]


class Curved(hm.HybridAutomaton):
    """Nothing is linear; start values are computed from everything that can be set."""

    x = hm.State([0.4, 0.3, 0.7], output=True)
    w = hm.State(computed=True, output=True)
    d = hm.DiscreteState(0.8, output=True)
    e = hm.DiscreteState(computed=True, output=True)
    n = hm.DiscreteState(0, integer=True, output=True)
    a = hm.Parameter([[1.3, 0.6], [0.2, 0.9]])
    gain = hm.Parameter(2.0)
    u = hm.Input(0.5)
    kick = hm.Input([0.1, 0.2], discrete=True)
    y = hm.Output()
    q = hm.Output()

    def start_map(self, s):
        return {"w": np.sin(s.a[0, 1] * s.u) + s.x[0] * s.t + s.d**2, "e": s.gain * s.x[1] * s.kick[1] + s.u**2}

    def flow_map(self, s):
        first = s.gain * np.sin(s.x[1] * s.w) + s.kick[0] * s.u
        return {
            "x": np.stack([first, s.a[1, 0] * s.x[0] ** 2 * s.e, np.exp(-s.a[1, 1] * s.t) * s.x[2]]),
            "w": s.d * s.x[2] - s.u * s.w**2,
        }

    def outputs(self, s):
        return {"y": s.x[0] * s.w + s.u**3 + s.e * s.t, "q": np.cos(s.a[0, 0] * s.d) + s.n * s.x[2] * s.kick[1]}

    def jump_set(self, s):
        return hm.least(s.x[0] - 50.0, 0.5 - s.n)

    def jump_map(self, s):
        return {"n": s.n + 1}


AUTOMATON = Curved()


def scalars(*kinds):
    return [name for kind in kinds for v in AUTOMATON.of_kind(kind) for name in element_names(v)]


STATES, DISCRETES = scalars(Kind.STATE), scalars(Kind.DISCRETE)
INPUTS, PARAMETERS, OUTPUTS = scalars(Kind.INPUT), scalars(Kind.PARAMETER), scalars(Kind.OUTPUT)
COLUMNS = ["time", *STATES, *DISCRETES, *INPUTS, *PARAMETERS]
ROWS = [*(f"der({name})" for name in STATES), *OUTPUTS, *STATES, *DISCRETES]


def jacobians():
    """For each mode, the function (t, x, z, u, p) -> the derivatives of all unknowns to all of these."""
    traced, found = trace(AUTOMATON), {}
    for mode in MODES:
        arguments = [ca.SX.sym(f"a{k}", traced.flow.size1_in(k)) for k in range(5)]
        t, x, z, u, p = arguments
        if mode == "initialization":
            x, z = traced.start(*arguments)
        results = ca.vertcat(traced.flow(t, x, z, u, p), traced.outputs(t, x, z, u, p), x, z)
        found[mode] = ca.Function(mode, arguments, [ca.jacobian(results, ca.vertcat(*arguments))])
    return found


JACOBIANS = jacobians()


def element_key(name):
    """The element of an array of derivatives as an element's derivative: der(x)[2] -> der(x[2])."""
    head, bracket, index = name.partition(")[")
    return f"{head}[{index.rstrip(']')}])" if bracket else name


def variables_for(binary, keys):
    """The names of variables of an FMU, whole arrays in FMI 3.0, that show some scalars and nothing else."""
    wholes = {}
    for element, (whole, _) in binary.elements.items():
        if binary.variables[whole].type == binary.float_type:
            wholes.setdefault(whole, []).append(element_key(element))
    return {name: members for name, members in wholes.items() if set(members) <= set(keys)}


def prepared(make, label, mode, seed=0):
    """An instance in a mode with random values; initialization and running, and the point that it is at."""
    rng = np.random.default_rng(seed)
    component = make(Curved, label)
    assert component.enter_initialization(0.3) == OK
    starts = {name: rng.uniform(0.2, 1.0) for name in [*INPUTS, *PARAMETERS, *STATES, *DISCRETES]
              if name not in ("w", "e", "n")}  # fmt: skip
    for name, value in starts.items():
        component.set(name, value)
    if mode == "running":
        component.do("ExitInitializationMode")
        if component.starts_in_event_mode:
            component.settle()
        if component.kind == "cs":
            assert component.step(0.3, 0.2).status == OK
        else:
            component.do("SetTime", c.c_double(0.5))
            x = rng.uniform(0.2, 1.0, len(STATES))
            component.do("SetContinuousStates", doubles(x), c.c_size_t(len(x)))
    return component


def jacobian(component, mode):
    """The derivatives at the point at which a component is."""
    get = component.get
    # What is computed is not what has been set; the start map does not read it.
    values = [[get(name) for name in names] for names in (["time"], STATES, DISCRETES, INPUTS, PARAMETERS)]
    return np.array(JACOBIANS[mode](*values))


@pytest.mark.parametrize("label", SETTINGS)
@pytest.mark.parametrize("mode", MODES)
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_random_directions(label, mode, data, make):
    """Some unknowns, some knowns, a seed: the products with CasADi's Jacobian, and one transposes the other."""
    component = prepared(make, label, mode, data.draw(st.integers(0, 5)))
    rows, columns = (variables_for(component.binary, keys) for keys in (ROWS, COLUMNS))
    unknowns = data.draw(st.lists(st.sampled_from(sorted(rows)), max_size=5))
    knowns = data.draw(st.lists(st.sampled_from(sorted(columns)), max_size=5))
    row_keys = [key for name in unknowns for key in rows[name]]
    column_keys = [key for name in knowns for key in columns[name]]
    numbers = st.floats(-4.0, 4.0)
    seed = data.draw(st.lists(numbers, min_size=len(column_keys), max_size=len(column_keys)))
    weights = data.draw(st.lists(numbers, min_size=len(row_keys), max_size=len(row_keys)))
    j = jacobian(component, mode)
    j = j[np.ix_([ROWS.index(key) for key in row_keys], [COLUMNS.index(key) for key in column_keys])]
    status, forward = component.derivative(FORWARD, unknowns, knowns, seed)
    assert status == OK, component.log
    # Some ten products of numbers of order 10, in another order.
    np.testing.assert_allclose(forward, j @ np.array(seed), rtol=1e-12, atol=1e-12)
    if component.binary.version == 3:
        status, reverse = component.derivative(REVERSE, unknowns, knowns, weights)
        assert status == OK, component.log
        np.testing.assert_allclose(reverse, j.T @ np.array(weights), rtol=1e-12, atol=1e-12)
        assert np.dot(forward, weights) == pytest.approx(np.dot(seed, reverse), rel=1e-11, abs=1e-11)
    assert component.log == []


@pytest.mark.parametrize("label", ["2.0 CS", "3.0 ME"])
def test_differences_of_what_the_fmu_shows_in_initialisation(label, make):
    component = prepared(make, label, "initialization", 3)
    settable = [n for n in [*INPUTS, *PARAMETERS, *STATES, *DISCRETES] if n not in ("w", "e", "n")]
    shown = {element_key(name): name for name in component.binary.elements}
    h = 1e-6
    j = jacobian(component, "initialization")
    for known in settable:
        value, sides = component.get(known), []
        for side in (-h, h):
            component.set(known, value + side)
            sides.append([component.get(shown[key]) for key in ROWS])
        component.set(known, value)
        # Central differences: rounding 1e-16/h and h^2 times a third derivative of some ten.
        expected = (np.array(sides[1]) - sides[0]) / (2 * h)
        np.testing.assert_allclose(j[:, COLUMNS.index(known)], expected, rtol=0, atol=2e-9)


@pytest.mark.parametrize("label", ["2.0 ME", "3.0 ME"])
def test_differences_of_what_the_fmu_shows_while_running(label, make):
    component = prepared(make, label, "running", 4)
    n, h = len(STATES), 1e-6
    x = np.array(component.vector("GetContinuousStates", n)[1])
    unknowns = sorted(variables_for(component.binary, ROWS[:n]))
    knowns = sorted(variables_for(component.binary, STATES))
    for k, name in enumerate(STATES):
        sides = []
        for side in (-h, h):
            moved = x.copy()
            moved[k] += side
            component.do("SetContinuousStates", doubles(moved), c.c_size_t(n))
            sides.append(component.vector("GetContinuousStateDerivatives", n)[1])
        component.do("SetContinuousStates", doubles(x), c.c_size_t(n))
        members = [key for known in knowns for key in variables_for(component.binary, STATES)[known]]
        status, found = component.derivative(FORWARD, unknowns, knowns, [float(key == name) for key in members])
        assert status == OK
        order = [key for unknown in unknowns for key in variables_for(component.binary, ROWS[:n])[unknown]]
        expected = dict(zip(ROWS[:n], (np.array(sides[1]) - sides[0]) / (2 * h), strict=True))
        np.testing.assert_allclose(found, [expected[key] for key in order], rtol=0, atol=2e-9)


@pytest.mark.parametrize("label", SETTINGS)
@pytest.mark.parametrize("mode", MODES)
def test_what_is_no_unknown_or_no_known_is_refused(label, mode, make):
    component = prepared(make, label, mode)
    functions = [FORWARD] if component.binary.version == 2 else [FORWARD, REVERSE]
    rate = sorted(variables_for(component.binary, ROWS[: len(STATES)]))[-1]
    wrong = [
        (["u"], ["u"], "'u' is none of the unknowns"),
        (["gain"], ["u"], "'gain' is none of the unknowns"),
        (["time"], ["u"], "'time' is none of the unknowns"),
        (["n"], ["u"], "'n' is none of the unknowns"),
        (["y"], ["y"], "'y' is none of the knowns"),
        (["y"], [rate], f"'{rate}' is none of the knowns"),
        (["y"], ["n"], "'n' is none of the knowns"),
    ]
    for function in functions:
        for unknowns, knowns, word in wrong:
            component.log.clear()
            status, result = component.derivative(function, unknowns, knowns, [1.0])
            assert (status, set(result) <= {math.pi}) == (ERROR, True)
            [message] = component.errors
            assert word in message
            assert component.binary.function(function) in message
        for value in (math.nan, math.inf):
            status, result = component.derivative(function, ["y"], ["u"], [value])
            assert (status, result) == (ERROR, [math.pi])
            assert "seed" in component.errors[-1]
        if component.binary.version == 3:
            status, result = component.derivative(function, ["y"], ["u"], [1.0, 1.0])
            assert (status, result) == (ERROR, [math.pi])
            assert "2 values" in component.errors[-1]


@pytest.mark.parametrize("label", ["2.0 CS", "3.0 CS"])
def test_asking_for_derivatives_changes_nothing(label, make):
    one, other = (Journey(make(Curved, label)) for _ in range(2))
    for t in (0.1, 0.35, 0.6):
        assert one.go_to(t) == other.go_to(t)
        for function in [FORWARD] if one.component.binary.version == 2 else [FORWARD, REVERSE]:
            assert one.component.derivative(function, ["y"], ["u"], [1.0])[0] == OK
        before, after = one.component.save(), other.component.save()
        assert one.component.serialize(before) == other.component.serialize(after)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_infinite_derivative_is_not_given(fmi, make):
    component = make(Pole, f"{fmi} ME")
    component.begin()
    component.do("SetContinuousStates", doubles([1.0]), c.c_size_t(1))
    assert component.derivative(FORWARD, ["y"], ["x"], [1.0]) == (DISCARD, [math.pi])
    assert "not finite" in component.errors[0]
    component.do("SetContinuousStates", doubles([0.75]), c.c_size_t(1))
    assert component.derivative(FORWARD, ["y", "der(x)"], ["x"], [1.0]) == (OK, [-1.0, 16.0])


class Clipped(hm.HybridAutomaton):
    """A root of what is cut off at zero: below, the chain rule has infinity times zero, the derivative is zero."""

    h = hm.State(-0.25, output=True)
    gain = hm.Parameter(3.0)
    y = hm.Output()

    def flow_map(self, s):
        return {"h": -s.gain * np.sqrt(np.maximum(s.h, 0.0))}

    def outputs(self, s):
        return {"y": 2.0 * s.h + np.sqrt(np.maximum(s.h, 0.0))}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("h", "slopes"), [(-0.25, (0.0, 2.0)), (-1e-9, (0.0, 2.0)), (0.25, (-3.0, 3.0))])
def test_a_root_of_what_is_cut_off_has_its_derivatives(fmi, h, slopes, make):
    component = make(Clipped, f"{fmi} ME")
    Journey(component, h=h)
    for unknown, slope in zip(("der(h)", "y"), slopes, strict=True):
        # A difference quotient over a millionth of h; the root is straight there up to 1e-6.
        status, found = component.derivative(FORWARD, [unknown], ["h"], [1.0])
        assert (status, found) == (OK, [pytest.approx(slope, rel=1e-9, abs=1e-9)])
        if fmi == "3.0":
            status, found = component.derivative(REVERSE, [unknown], ["h"], [1.0])
            assert (status, found) == (OK, [pytest.approx(slope, rel=1e-9, abs=1e-9)])


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_where_the_two_sides_have_different_slopes_there_is_no_derivative(fmi, make):
    component = make(Clipped, f"{fmi} ME")
    Journey(component, h=0.0)
    assert component.derivative(FORWARD, ["der(h)"], ["h"], [1.0])[0] == DISCARD

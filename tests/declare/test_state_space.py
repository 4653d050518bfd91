"""Linear systems as automata, against matrix exponentials and the recursion of discrete-time systems."""

import numpy as np
import pytest
from scipy.linalg import expm

import hybrid_model as hm
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from hybrid_model.declare.state_space import state_space
from hybrid_model.native.trace import trace

A = [[0.0, 1.0], [-2.0, -0.4]]
B = [[0.5, 0.0], [1.0, -1.0]]
C = [[1.0, 0.0], [1.0, 2.0]]
D = [[0.0, 0.0], [3.0, 0.0]]
NAMES = {"inputs": ["force", "load"], "outputs": ["position", "mixed"]}
# The solver's relative tolerance is 1e-13 a step; states of order 1 over some seconds.
TOLERANCE = 1e-11


def test_continuous_system_with_constant_inputs():
    arc = hm.simulate(state_space(A, B, C, D, **NAMES, start=[1.0, -0.5]), 5.0, inputs={"force": 0.3, "load": -1.1})
    u = np.array([0.3, -1.1])
    drift = np.zeros((4, 4))
    drift[:2] = np.hstack([A, B])
    for t in np.linspace(0.0, 5.0, 23):
        x = (expm(drift * t) @ [1.0, -0.5, *u])[:2]
        assert arc.at("x", t) == pytest.approx(x, abs=TOLERANCE)
        y = np.array(C) @ x + np.array(D) @ u
        assert [arc.at("position", t), arc.at("mixed", t)] == pytest.approx(y, abs=10 * TOLERANCE)


def test_discrete_system_follows_its_recursion():
    """With inputs that change all the time: what counts is their value at each sample."""
    period, x = 0.3, np.array([1.0, -0.5])
    signals = {"force": np.sin, "load": lambda t: t * t}
    a = np.array(A) * 0.4
    arc = hm.simulate(state_space(a, B, C, D, **NAMES, period=period, start=x), 10.0, inputs=signals)
    for k in range(33):
        t = k * period
        u = np.array([np.sin(t), t * t])
        y = np.array(C) @ x + np.array(D) @ u
        x = a @ x + B @ u
        for at in (t, t + 0.99 * period):  # held
            # The recursion is run in floats on both sides: rounding of values up to 100.
            assert [arc.at("position", at), arc.at("mixed", at)] == pytest.approx(y, rel=1e-13, abs=1e-13)
    assert [jump.t for jump in arc.jumps] == [k * period for k in range(34)]


@pytest.mark.parametrize(
    ("t_start", "first"), [(0.0, 0), (0.3, 3), (3 * 0.1, 3), (0.31, 4), (0.6, 6), (0.7, 7), (-0.05, 0), (1e6, 10**7)]
)
def test_the_first_sample_is_the_first_not_before_the_start(t_start, first):
    system = state_space([[1.0]], [[1.0]], [[1.0]], inputs=["u"], outputs=["y"], period=0.1)
    arc = hm.simulate(system, t_start + 0.25, t_start=t_start, inputs={"u": 1.0})
    assert arc.jumps[0].t == pytest.approx(first * 0.1, rel=1e-15)
    assert np.all(np.diff([jump.t for jump in arc.jumps]) > 0.099)


def test_static_gains_have_no_state():
    gain = state_space([], [], [], [[2.0, -1.0]], inputs=["a", "b"], outputs=["y"])
    assert not [variable for variable in gain.variables if variable.name == "x"]
    assert hm.simulate(gain, 1.0, inputs={"a": 3.0, "b": 1.0}).end.a == 3.0
    assert hm.simulate(gain, 1.0, inputs={"a": 3.0, "b": 1.0})["y"][-1] == 5.0
    nothing = state_space([], [], [], [[0.0]], inputs=["a"], outputs=["y"])
    assert hm.simulate(nothing, 1.0, inputs={"a": 3.0})["y"][-1] == 0.0


def test_autonomous_systems_have_no_inputs():
    arc = hm.simulate(state_space([[-1.0]], np.zeros((1, 0)), [[1.0]], inputs=[], outputs=["y"], start=[2.0]), 1.0)
    assert arc["y"][-1] == pytest.approx(2.0 * np.exp(-1.0), abs=TOLERANCE)


def test_only_inputs_with_feedthrough_make_an_algebraic_loop():
    system = state_space(A, B, C, D, **NAMES)
    hm.Composition("loop", {"system": system}, {"system.load": "system.position"})
    with pytest.raises(hm.AlgebraicLoopError, match="system -> system"):
        hm.Composition("loop", {"system": system}, {"system.force": "system.position"})


def test_sampled_systems_make_no_algebraic_loop():
    sampled = state_space([], [], [], [[0.5]], inputs=["u"], outputs=["y"], period=1.0)
    offset = state_space([], [], [], [[1.0, 1.0]], inputs=["a", "b"], outputs=["y"])
    loop = hm.Composition(
        "loop", {"sampled": sampled, "offset": offset}, {"sampled.u": "offset.y", "offset.b": "sampled.y"}
    )
    arc = hm.simulate(loop, 10.5, inputs={"offset.a": 1.0})
    # y[k] = (1 + y[k-1])/2 = 1 - 2^-(k+1)
    assert arc.at("sampled.y", np.arange(11.0)) == pytest.approx(1.0 - 0.5 ** np.arange(1.0, 12.0), abs=1e-15)


def test_matrices_are_parameters_of_the_fmu():
    table = {v.name: v for v in fmu_variables(trace(state_space(A, B, C, D, **NAMES)), Fmi.V2_0)}
    assert table["A[2,1]"].start == (-2.0,)
    assert table["A[2,1]"].causality == "parameter"
    # The column of `force`, the one input with feedthrough.
    assert table["D[2,1]"].start == (3.0,)
    assert "D[2,2]" not in table
    assert table["force"].causality == "input"
    assert table["mixed"].causality == "output"


def test_parameters_can_be_changed_for_one_run():
    """The class belongs to the system; another instance of it takes other matrices of the same shapes."""
    system = state_space([[-1.0]], [[1.0]], [[1.0]], inputs=["u"], outputs=["y"])
    other = type(system)(A=[[-2.0]], B=[[1.0]], C=[[1.0]], x=[1.0])
    assert hm.simulate(other, 1.0)["y"][-1] == pytest.approx(np.exp(-2.0), abs=TOLERANCE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"B": [[1.0]]}, r"\.B has shape \(1, 1\), .* it must be \(2, 2\)"),
        ({"A": [[1.0, 2.0]]}, r"\.A has shape \(1, 2\)"),
        ({"D": [[np.nan, 0.0], [0.0, 0.0]]}, r"\.D = .* is not finite"),
        ({"period": 0.0}, r"the sampling period is 0\.0 s: give a positive number"),
        ({"period": np.inf}, r"the sampling period is inf s"),
        ({"inputs": ["u[0]", "load"]}, r"'u\[0\]', which is no Python identifier: name the signals by inputs="),
        ({"inputs": ["class", "load"]}, "'class', which is no Python identifier"),
        ({"inputs": ["load", "load"]}, "called 'load': rename them by"),
        ({"outputs": ["x", "y"]}, r"called 'x': rename them by .* state='\.\.\.'"),
        ({"outputs": ["A", "y"]}, "called 'A', a name of the block itself: rename it"),
        ({"outputs": ["t", "y"]}, "called 't', a name of the block itself"),
        ({"outputs": ["flow_map", "y"]}, "called 'flow_map', a name of the block itself"),
        ({"start": [1.0, 2.0, 3.0]}, "one length 'order'"),
    ],
)
def test_systems_that_cannot_be_are_refused(change, message):
    with pytest.raises(hm.DeclarationError, match=message):
        state_space(**{"A": A, "B": B, "C": C, "D": D, **NAMES, **change})

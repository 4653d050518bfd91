"""Which values rates are affine in, and what those are factors of."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.native.assembly_code import assembly_code
from hybrid_model.native.held_factors import held_factors
from hybrid_model.native.model_code import model_code
from hybrid_model.native.networks.network import network_trace
from hybrid_model.native.trace import ARGUMENTS, trace


class Heard(hm.HybridAutomaton):
    """A rate that is given; it may use two inputs, two discrete states and a parameter."""

    x = hm.State(0.0)
    u = hm.Input(0.0, discrete=True)
    v = hm.Input(0.0, discrete=True)
    m = hm.DiscreteState(1.0)
    n = hm.DiscreteState(2.0)
    p = hm.Parameter(3.0)


def held_of(rate):
    """Names of the values that a rate is affine in, and of what the rest depends on."""
    traced = trace(type("Heard", (Heard,), {"flow_map": lambda self, s: {"x": rate(s)}})())
    found = held_factors(traced.flow)
    if found is None:
        return None
    names = ["m", "n", "u", "v", "p"]
    sample = [np.array(value) for value in (0.7, [0.2], [1.3, -0.4], [0.9, 2.1], [1.7])]
    (whole,) = (np.array(traced.flow(*sample)).ravel(),)
    constant, factors = (np.array(result).ravel() for result in found.function(*sample))
    values = np.concatenate([sample[ARGUMENTS.index("z")], sample[ARGUMENTS.index("u")]])[list(found.held)]
    total = constant.copy()
    for row, column, factor in zip(found.rows, found.columns, factors, strict=True):
        total[row] += factor * values[column]
    np.testing.assert_allclose(total, whole, rtol=1e-14, err_msg="the parts are not the whole")
    return {names[k] for k in found.held}, {names[k] for k in found.keys}


@pytest.mark.parametrize(
    ("rate", "held", "keys"),
    [
        (lambda s: np.sin(s.p * s.t) * (s.u - s.m), {"u", "m"}, {"p"}),
        (lambda s: 2.0 * s.u + np.cos(s.t), {"u"}, set()),
        (lambda s: s.u / (1.0 + s.t) - s.v * np.floor(s.n), {"u", "v"}, {"n"}),
        # Of a product the discrete state stays out.
        (lambda s: s.m * s.u, {"u"}, {"m"}),
        (lambda s: s.u * s.v + s.m, {"m"}, {"u", "v"}),
        (lambda s: np.sin(s.u) + s.v, {"v"}, {"u"}),
        (lambda s: s.u**2 + s.v, {"v"}, {"u"}),
        (lambda s: s.v / s.u + s.m, {"m", "v"}, {"u"}),
        (lambda s: np.where(s.u > 0.5, s.v, -s.v), {"v"}, {"u"}),
        (lambda s: np.where(s.n > 0.5, s.u, s.v), {"u", "v"}, {"n"}),
        (lambda s: np.maximum(s.u, s.v) + s.m, {"m"}, {"u", "v"}),
    ],
)
def test_values_that_rates_are_affine_in(rate, held, keys):
    assert held_of(rate) == (held, keys)


@pytest.mark.parametrize(
    "rate",
    [lambda s: np.sin(s.u), lambda s: np.cos(s.t), lambda s: s.u * s.v, lambda s: s.u - s.x],
    ids=["bent", "time alone", "a product of inputs", "a rate that depends on its state"],
)
def test_rates_without_factors(rate):
    assert held_of(rate) is None


class Wave(Heard):
    """Each instance has a frequency of its own in its maps."""

    def __init__(self, name, frequency):
        super().__init__(name)
        self.frequency = frequency

    def flow_map(self, s):
        return {"x": np.sin(self.frequency * s.t) * (s.u - s.m) + s.p}


def test_constants_in_which_the_parts_of_a_group_differ_are_among_what_functions_depend_on():
    network = network_trace(hm.Composition("waves", {"a": Wave("a", 3.0), "b": Wave("b", 5.0)}))
    (group,) = network.groups
    held = group.factors
    # Places in z, u, p and then the constants: m, n, u, v, p, the frequency.
    assert (held.held, held.keys) == ((0, 2), (4, 5))
    for constants in group.constants:
        rate, factors = held.function(0.7, [0.2], [1.3, -0.4], [0.9, 2.1], [1.7], constants)
        assert float(rate) == 1.7
        np.testing.assert_allclose(
            np.ravel(factors), np.sin(constants[0] * 0.7) * np.array([-1.0, 1.0]), rtol=1e-15, atol=0
        )


def test_parts_that_run_on_their_own_in_an_fmu_have_factors_and_the_network_as_one_has_not():
    network = network_trace(hm.Composition("waves", {"a": Wave("a", 3.0), "b": Wave("b", 5.0)}))
    tables = assembly_code(network)
    assert ".factors = part0_factors," in tables
    assert "part0_factor_keys[] = {\n    4,\n    5\n};" in tables
    assert "group0_factors(" in model_code(network, by_parts=True)
    assert "factors" not in model_code(network)

"""Chebyshev series in C: integrals of polynomials through rates, against NumPy's and against closed forms."""

import ctypes
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.engine_files import ENGINE_FOLDERS

FINEST, N_SERIES = 16, 18
# Sums of some twenty terms, each rounded once.
ROUNDING = 20 * np.finfo(float).eps


class Series:
    """The functions of chebyshev.c on arrays: rows are nodes, or coefficients; columns are states."""

    def __init__(self, library):
        self.library = library
        library.node.restype = ctypes.c_double
        library.integrated.restype = ctypes.c_size_t
        self.nodes = np.array([library.node(ctypes.c_size_t(j)) for j in range(FINEST + 1)])

    def _call(self, name, *given):
        kinds = {int: ctypes.c_size_t, float: ctypes.c_double}
        words = [kinds[type(v)](v) if type(v) in kinds else v.ctypes.data_as(ctypes.c_void_p) for v in given]
        return getattr(self.library, name)(*words)

    def integrated(self, stride, h, x0, rates):
        """Terms, coefficients and tails."""
        states, tails = np.full((N_SERIES, len(x0)), np.nan), np.full(len(x0), np.nan)
        n_terms = self._call("integrated", len(x0), stride, float(h), x0, np.ascontiguousarray(rates), states, tails)
        return n_terms, states, tails

    def at_nodes(self, series, n_terms, stride):
        values = np.full((FINEST + 1, series.shape[1]), np.nan)
        self._call("at_nodes", series, n_terms, series.shape[1], stride, values)
        return values

    def at_end(self, series, n_terms, x0):
        x = np.full(len(x0), np.nan)
        self._call("at_end", series, n_terms, len(x0), x0, x)
        return x

    def at(self, series, n_terms, a):
        x = np.full(series.shape[1], np.nan)
        self._call("at", series, n_terms, series.shape[1], float(a), x)
        return x

    def straight(self, x0, x1):
        series = np.full((N_SERIES, len(x0)), np.nan)
        self._call("straight", x0, x1, len(x0), series)
        return series


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    library = tmp_path_factory.mktemp("chebyshev") / "chebyshev.so"
    flags = ["-std=c99", "-O1", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden"]
    folders = [f"-I{folder}" for folder in ENGINE_FOLDERS]
    source = Path(__file__).with_name("chebyshev_exports.c")
    subprocess.run([*find_compiler(), *flags, *folders, str(source), "-o", str(library), "-lm"], check=True)
    return Series(ctypes.CDLL(str(library)))


def test_nodes_are_those_of_chebyshev_and_lobatto_in_the_order_of_time(series):
    expected = np.sin(np.pi * np.arange(FINEST + 1) / (2 * FINEST)) ** 2
    np.testing.assert_allclose(series.nodes, expected, rtol=0, atol=3e-16)
    assert (series.nodes[0], series.nodes[-1]) == (0.0, 1.0)


@pytest.mark.parametrize("stride", [1, 2])
def test_the_integral_of_any_polynomial_through_the_nodes_is_exact(series, stride):
    """NumPy fits, integrates and evaluates the same polynomials; many states at once are those of each."""
    rng = np.random.default_rng(stride)
    degree, h = FINEST // stride, 0.37
    rates, x0 = rng.normal(size=(FINEST + 1, 3)), rng.normal(size=3)
    n_terms, found, tails = series.integrated(stride, h, x0, rates)
    points = 2 * series.nodes[::stride] - 1
    fitted = chebyshev.chebfit(points, rates[::stride], degree)
    expected = chebyshev.chebint(0.5 * h * fitted, lbnd=-1) + np.eye(degree + 2)[:, :1] * x0
    assert n_terms == degree + 2
    np.testing.assert_allclose(found[: degree + 2], expected, rtol=0, atol=ROUNDING)
    assert not found[degree + 2 :].any()
    np.testing.assert_allclose(tails, h / 2 * np.abs(fitted[-2:]).sum(axis=0), rtol=1e-10)
    for a in (0.0, 0.1, 0.5, 0.77, 1.0):
        np.testing.assert_allclose(
            series.at(found, n_terms, a), chebyshev.chebval(2 * a - 1, expected), rtol=0, atol=ROUNDING
        )
    np.testing.assert_allclose(series.at(found, n_terms, 0.0), x0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(series.at_end(found, n_terms, x0), chebyshev.chebval(1, expected), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("stride", [1, 2])
def test_values_at_nodes_are_those_of_the_series(series, stride):
    rng = np.random.default_rng(5)
    n_terms, found, _ = series.integrated(stride, 1.0, rng.normal(size=2), rng.normal(size=(FINEST + 1, 2)))
    values = series.at_nodes(found, n_terms, stride)
    for j in range(stride, FINEST + 1, stride):
        expected = series.at(found, n_terms, series.nodes[j])
        np.testing.assert_allclose(values[j], expected, rtol=0, atol=ROUNDING)
    # The start is known, and so are the nodes of other grids left alone.
    assert np.isnan(values[0]).all()
    assert np.isnan(values[1::2]).all() == (stride == 2)


def test_a_square_of_a_sine_is_integrated_to_rounding_and_its_tail_says_so(series):
    """4 sin^2(5 t) on a fifth of its period: sixteen degrees are enough, eight are not, and the tails tell."""
    t0, h = 0.2, math.pi / 25
    times = t0 + h * series.nodes[:, None]

    def integral(t):
        return 2 * (t - t0) - (np.sin(10 * t) - np.sin(10 * t0)) / 5

    for stride, enough in ((1, True), (2, False)):
        n_terms, found, tails = series.integrated(stride, h, np.zeros(1), 4 * np.sin(5 * times) ** 2)
        errors = [abs(series.at(found, n_terms, a)[0] - integral(t0 + a * h)) for a in np.linspace(0, 1, 101)]
        assert (max(errors) < 1e-15) == enough
        assert (tails[0] < 1e-14) == enough
        assert max(errors) <= max(tails[0], 1e-15)


def test_rates_that_jump_to_and_fro_show_even_where_the_last_two_terms_vanish(series):
    rates = np.zeros((FINEST + 1, 1))
    rates[::2, 0] = [-1, -1, 1, 1, -1, 1, 1, -1, -1]
    fitted = chebyshev.chebfit(2 * series.nodes[::2] - 1, rates[::2, 0], FINEST // 2)
    assert np.abs(fitted[-2:]).max() < 1e-15
    _, _, tails = series.integrated(2, 0.2, np.zeros(1), rates)
    assert tails[0] > 1e-3


def test_constant_and_linear_rates_leave_few_terms_and_no_rounding(series):
    constant, linear = np.full(FINEST + 1, 0.3), 0.5 * series.nodes
    n_terms, found, tails = series.integrated(2, 0.7, np.array([1.1, 0.0]), np.stack([constant, linear], axis=1))
    assert n_terms == 3
    assert tails[0] == 0.0
    assert series.at_end(found, n_terms, np.array([1.1, 0.0]))[0] == 1.1 + 0.7 * 0.3
    np.testing.assert_allclose(series.at(found, n_terms, 0.5), [1.1 + 0.35 * 0.3, 0.7 * 0.25 * 0.25], rtol=1e-15)


def test_what_overflows_is_not_dropped(series):
    """A rate near the largest float: over a short step it is integrated, and beyond floats it leads to infinity."""
    constant, x0 = np.full((FINEST + 1, 1), 1e308), np.zeros(1)
    n_terms, found, _ = series.integrated(2, 0.5, x0, constant)
    assert series.at_end(found, n_terms, x0)[0] == 0.5e308
    n_terms, found, _ = series.integrated(2, 10.0, x0, constant)
    assert series.at_end(found, n_terms, x0)[0] == np.inf


def test_dropped_terms_are_below_the_rounding_of_what_is_left(series):
    """Terms of the last places of a large state go; the same terms of a state that is zero stay."""
    rates = 1e-18 * np.cos(3 * np.arccos(2 * series.nodes - 1))
    n_terms, found, _ = series.integrated(1, 1.0, np.ones(1), rates[:, None])
    assert n_terms == 1
    assert (found[:, 0] == np.eye(N_SERIES)[0]).all()
    n_terms, found, _ = series.integrated(1, 1.0, np.zeros(1), rates[:, None])
    # The integral of T_3 is T_4/8 - T_2/4, and half of that of the rates on a step of 1.
    np.testing.assert_allclose(found[[2, 4], 0], [-0.125e-18, 0.0625e-18], rtol=1e-12)


def test_the_straight_way(series):
    x0, x1 = np.array([1.0, -2.0]), np.array([1.5, 8.0])
    line = series.straight(x0, x1)
    for a in (0.0, 0.25, 1.0):
        np.testing.assert_allclose(series.at(line, 2, a), x0 + a * (x1 - x0), rtol=0, atol=ROUNDING)
    assert not line[2:].any()

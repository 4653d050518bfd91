"""Derivatives of maps at a point against exact ones, and what is said where there are none."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.linear.jacobian import jacobian


def derivative(function, point):
    """Of a scalar function of one variable."""
    found = jacobian(
        lambda x: np.array([function(x[0])]), np.array([float(point)]), owner="probe", rows=["f"], columns=["x"]
    )
    return found[0, 0]


SMOOTH = {
    "exponential": (lambda x: np.exp(3.0 * x), lambda x: 3.0 * np.exp(3.0 * x), (0.0, -2.0, 1.7)),
    "fast sine": (lambda x: np.sin(40.0 * x), lambda x: 40.0 * np.cos(40.0 * x), (0.0, 0.3, 2.0)),
    "cubic far out": (lambda x: x**3, lambda x: 3.0 * x**2, (0.0, 1.0, 1e3, -1e6)),
    "pole near by": (lambda x: 1.0 / x, lambda x: -1.0 / x**2, (0.01, 0.3, -5.0)),
    "logarithm": (lambda x: np.log(x), lambda x: 1.0 / x, (0.02, 1.0, 1e5)),
    "steep": (lambda x: np.tanh(200.0 * x), lambda x: 200.0 / np.cosh(200.0 * x) ** 2, (0.0, 0.003)),
    "whole periods": (lambda x: np.sin(2 * np.pi * x), lambda x: 2 * np.pi * np.cos(2 * np.pi * x), (8.0, 64.0, 8.125)),
    "small numbers": (lambda x: 1e-9 * np.sin(x), lambda x: 1e-9 * np.cos(x), (0.3,)),
}


@pytest.mark.parametrize("name", list(SMOOTH))
def test_derivatives_of_smooth_functions(name):
    """Rounding 1e-16 over a step that the function's scale s allows leaves 1e-12 s; 1e-10 for scales to 1/200."""
    function, exact, points = SMOOTH[name]
    for point in points:
        assert derivative(function, point) == pytest.approx(exact(point), rel=1e-10)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
def test_what_happens_close_to_the_point_only_is_seen(width):
    """Longer steps all say slope zero, and agree."""
    assert derivative(lambda x: np.where(np.abs(x) < width, x, 0.0), 0.0) == pytest.approx(1.0, rel=1e-9)
    assert derivative(lambda x: x * np.exp(-((x / width) ** 2)), 0.0) == pytest.approx(1.0, rel=1e-9)
    with pytest.raises(hm.DeclarationError, match="kink, with the slopes -1 below and 1 above"):
        derivative(lambda x: np.where(np.abs(x) < width, np.abs(x), 0.0), 0.0)


def test_affine_functions_are_exact_to_rounding():
    rng = np.random.default_rng(1)
    matrix, offset = rng.normal(size=(5, 4)), rng.normal(size=5)
    for point in (np.zeros(4), rng.normal(size=4), 1e4 * rng.normal(size=4)):
        found = jacobian(lambda x: matrix @ x + offset, point, owner="probe", rows=list("abcde"), columns=list("wxyz"))
        # Values of size |x| over steps of |x|/8: some ten ulp.
        np.testing.assert_allclose(found, matrix, rtol=0, atol=2e-14)


def test_a_constant_has_the_derivative_zero():
    assert derivative(lambda x: 5.0 + 0.0 * x, 2.0) == 0.0


@pytest.mark.parametrize("distance", [1e-2, 1e-4, 1e-6])
def test_a_kink_close_by_does_not_disturb(distance):
    """The differences over it are left behind for shorter ones; what is left is rounding over the distance."""
    assert derivative(lambda x: np.maximum(x, -distance) * 3.0, 0.0) == pytest.approx(3.0, rel=1e-15 / distance)


@pytest.mark.parametrize(
    ("function", "slopes"),
    [
        (np.abs, "slopes -1 below and 1 above"),
        (lambda x: np.where(x > 0.0, 2.0 * x, np.sin(x)), "slopes 1 below and 2 above"),
        (lambda x: 1e-6 * np.maximum(x, 0.0) + 1e-6, "slopes 0 below and 1e-06 above"),
    ],
)
def test_a_kink_at_the_point_is_told_with_its_slopes(function, slopes):
    with pytest.raises(hm.DeclarationError, match=f"probe: f has no derivative with respect to x at x = 0: .*{slopes}"):
        derivative(function, 0.0)


@pytest.mark.parametrize("function", [np.sign, np.cbrt, lambda x: np.sign(x - 0.3) * np.sqrt(np.abs(x - 0.3))])
def test_jumps_and_infinite_slopes_are_refused(function):
    point = 0.3 if function not in (np.sign, np.cbrt) else 0.0
    with pytest.raises(hm.DeclarationError, match=r"do not settle \(there is a jump or an infinite slope\)"):
        derivative(function, point)


def test_points_without_finite_values_are_refused():
    with pytest.raises(hm.SimulationError, match="f is nan at the point"):
        derivative(lambda x: np.sqrt(x), -1.0)
    with pytest.raises(hm.SimulationError, match="finite on one side only"):
        derivative(lambda x: np.sqrt(x) ** 3, 0.0)


def test_random_smooth_functions_over_six_orders_of_scale():
    """Waves, bumps and slopes: none is refused, and each is accurate as far as its phase is known in floats."""
    rng = np.random.default_rng(0)
    for _ in range(500):
        rate, width = 10.0 ** rng.uniform(-3.0, 3.0), 10.0 ** rng.uniform(-3.0, 2.0)
        wave, bump, slope = rng.normal(size=3) * 10.0 ** rng.uniform(-3.0, 3.0, 3)
        x0 = rng.choice([0.0, rng.normal(), 1e3 * rng.normal(), float(rng.integers(-50, 50))])
        middle = x0 + width * rng.normal()
        exact = (
            wave * rate * np.cos(rate * x0)
            - 2.0 * bump * (x0 - middle) / width**2 * np.exp(-(((x0 - middle) / width) ** 2))
            + slope
        )
        found = derivative(
            lambda x, a=wave, w=rate, b=bump, c=middle, s=width, d=slope: (
                a * np.sin(w * x) + b * np.exp(-(((x - c) / s) ** 2)) + d * x
            ),
            x0,
        )
        # A phase of up to 1e6 has rounding errors of 1e-10, on steps of a fraction of a period.
        scale = abs(wave * rate) + abs(bump / width) + abs(slope)
        assert found == pytest.approx(exact, abs=2e-8 * scale)

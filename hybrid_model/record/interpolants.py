"""Functions of time as polynomials on intervals, to any accuracy that floats allow.

A polynomial is held by its values at Chebyshev-Lobatto points and evaluated by the barycentric formula, which is stable
there (Berrut and Trefethen, Barycentric Lagrange interpolation, SIAM Review 46, 2004, eq. 4.2 and 5.4).
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hybrid_model.declare.variables import FloatArray

LADDER = (2, 3, 5, 9, 17, 33)
"""Numbers of points that are tried: each set contains the one before. Nine hold DOP853's dense output of degree 7."""
HALVINGS = 30
"""How often an interval is halved around a kink: it is then confined to 1e-9 of the interval."""
ASIDE = (0.2137, 0.3819, 0.8541)
"""Parts of an interval at which a polynomial that has held is checked once more, without any symmetry: a function that
is odd about the middle is met there by a straight line."""
GAIN = 0.6
"""An interval is halved only if one half at least comes out with less than this part of the error: a kink's falls to
one half, noise stays."""


def lobatto(a: float, b: float, count: int) -> FloatArray:
    """Return the `count` Chebyshev-Lobatto points of [a, b], increasing, with its ends."""
    points = a + (b - a) * (0.5 - 0.5 * np.cos(np.pi * np.arange(count) / (count - 1)))
    points[-1] = b
    return np.asarray(points, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A vector-valued polynomial on [a, b], by its values at Chebyshev-Lobatto points, shape (count, m)."""

    a: float
    b: float
    values: FloatArray

    def __call__(self, t: float) -> FloatArray:
        """Return its value at `t`, shape (m,)."""
        points = lobatto(self.a, self.b, len(self.values))
        distance = t - points
        hit = np.flatnonzero(distance == 0.0)
        if hit.size:
            return np.asarray(self.values[hit[0]])
        weights = np.where(np.arange(len(points)) % 2 == 0, 1.0, -1.0)
        weights[[0, -1]] *= 0.5
        weights /= distance
        return np.asarray(weights @ self.values / np.sum(weights))


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Polynomials on neighbouring intervals; called with a time it gives the value there."""

    parts: tuple[Polynomial, ...]

    def __call__(self, t: float | FloatArray) -> FloatArray:
        """Return the value at a time, shape (m,), or at times, shape (m, times), as dense outputs do."""
        if isinstance(t, np.ndarray) and t.ndim:
            width = self.parts[0].values.shape[1]
            return np.array([self(float(time)) for time in t]).reshape(len(t), width).T
        at = bisect.bisect_left(self.parts, t, key=lambda part: part.b)
        return self.parts[min(at, len(self.parts) - 1)](float(t))


def interpolate(
    function: Callable[[float], FloatArray], a: float, b: float, tolerance: FloatArray
) -> tuple[Interpolant, FloatArray]:
    """Interpolate a vector-valued function on [a, b].

    Parameters
    ----------
    function : callable
        ``function(t) -> ndarray, shape (m,)``; smooth but for kinks.
    a, b : float
        Ends in s.
    tolerance : ndarray, shape (m,)
        Error that is allowed in each component.

    Returns
    -------
    Interpolant
        The polynomials.
    ndarray, shape (m,)
        The largest error seen in each component, at points between those of the polynomials. It exceeds the tolerance
        where the function has noise of that size, or is discontinuous.
    """
    parts, error = _halved(function, _fit(function, a, b, tolerance), tolerance, HALVINGS)
    return Interpolant(tuple(parts)), error


def _fit(
    function: Callable[[float], FloatArray], a: float, b: float, tolerance: FloatArray
) -> tuple[Polynomial, FloatArray]:
    """Return the first polynomial of the ladder that holds, or the last, and its error at the next points."""
    values = np.array([function(t) for t in lobatto(a, b, LADDER[0])])
    for count in LADDER:
        polynomial = Polynomial(a, b, values)
        # The points of the next set are those of this one and new ones between them.
        between = [(float(t), function(float(t))) for t in lobatto(a, b, 2 * count - 1)[1::2]]
        error = np.max([np.abs(polynomial(t) - exact) for t, exact in between], axis=0)
        if np.all(error <= tolerance) or count == LADDER[-1]:
            aside = [float(a + part * (b - a)) for part in ASIDE]
            error = np.max([error, *(np.abs(polynomial(t) - function(t)) for t in aside)], axis=0)
        if np.all(error <= tolerance) or count == LADDER[-1]:
            return polynomial, error
        joined = np.empty((2 * count - 1, values.shape[1]))
        joined[::2], joined[1::2] = values, [exact for _, exact in between]
        values = joined
    raise AssertionError("the ladder has a last rung")


def _halved(
    function: Callable[[float], FloatArray],
    fitted: tuple[Polynomial, FloatArray],
    tolerance: FloatArray,
    depth: int,
) -> tuple[list[Polynomial], FloatArray]:
    """Halve the interval of a polynomial for as long as that makes it better."""
    whole, error = fitted
    middle = 0.5 * (whole.a + whole.b)
    excess = np.max(error / tolerance, initial=0.0)
    # Written so that a value that is not a number ends it.
    if not excess > 1.0 or depth == 0 or not whole.a < middle < whole.b:
        return [whole], error
    halves = [_fit(function, a, b, tolerance) for a, b in ((whole.a, middle), (middle, whole.b))]
    if all(np.max(rest / tolerance, initial=0.0) > GAIN * excess for _, rest in halves):
        return [whole], error
    parts, errors = zip(*(_halved(function, half, tolerance, depth - 1) for half in halves), strict=True)
    return [*parts[0], *parts[1]], np.maximum(*errors)

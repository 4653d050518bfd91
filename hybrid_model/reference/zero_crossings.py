"""The trigger rule on (t0, t1]: find the first time at which a margin goes from negative to zero or above.

Along one step of a solver each margin is sampled at Chebyshev points. The polynomial through the samples has Bernstein
coefficients that enclose it, and Chebyshev coefficients whose tail tells how well it represents the margin. With both:

* coefficients all below zero by more than the tail: the margin does not reach zero in the step;
* differences of the coefficients of one sign by more than the tail: the margin is monotone and its ends decide;
* neither: the step is halved, and its first half is looked at first.

So every crossing is found, however close to another, of a margin that a polynomial of degree 8 represents on some
halving of the step: all smooth margins, and exactly those that are affine in the states, because the dense output of
the default solver is such a polynomial. A kink ends the halving where the margin cannot be near zero, or after
`HALVINGS` of them. What can be missed is a feature that no sample shows: a peak, sharp against the distance of
neighbouring samples, which is at most a fifth of the step. More `scan_points` or a `max_step` make that smaller.

The C engine of exported FMUs (hybrid_model/engine/location/rises.c) decides in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray
from hybrid_model.scales import ulp

BoolArray = npt.NDArray[np.bool_]
Margin = Callable[[float], float]
MarginAtTimes = Callable[[FloatArray], FloatArray]
SMALLEST = float(np.finfo(np.float64).tiny)
DEGREE = 8
"""Degree of the polynomials; the dense output of DOP853 has degree 7."""
CAUTION = 4.0
"""The error of the polynomial is taken as this many times the tail: beside a kink it is twice that large."""
HALVINGS = 60
"""How often one margin is halved in one step: a simple crossing needs none, a kink some ten."""


def _matrices(degree: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points on [0, 1], and what makes Bernstein and the last two Chebyshev coefficients of samples."""
    k = np.arange(degree + 1)
    points = 0.5 - 0.5 * np.cos(np.pi * k / degree)
    points[degree // 2] = 0.5  # exactly, so that a touch there is seen
    choose = np.array([math.comb(degree, j) for j in range(degree + 1)], dtype=np.float64)
    bernstein = choose * points[:, None] ** k * (1.0 - points[:, None]) ** (degree - k)
    chebyshev = np.polynomial.chebyshev.chebvander(2.0 * points - 1.0, degree)
    to_bernstein, to_chebyshev = (np.linalg.inv(np.asarray(m, dtype=np.float64)) for m in (bernstein, chebyshev))
    return points, to_bernstein, CAUTION * to_chebyshev[-2:]


POINTS, TO_BERNSTEIN, TO_TAIL = _matrices(DEGREE)


def scan_times(a: float, b: float) -> FloatArray:
    """Return the times at which margins are sampled between `a` and `b`, both included; shape (DEGREE + 1,)."""
    times = a + (b - a) * POINTS
    times[-1] = b
    return times


def may_rise(samples: FloatArray) -> BoolArray:
    """Tell which margins may go from negative to zero or above.

    Parameters
    ----------
    samples : ndarray, shape (DEGREE + 1, m)
        Margins at the scan times.

    Returns
    -------
    ndarray of bool, shape (m,)
        False only where the samples exclude it.
    """
    # Samples that are not finite give bounds that are no numbers, and those count as a rise.
    with np.errstate(invalid="ignore"):
        bounds = TO_BERNSTEIN @ samples
        tail = np.abs(TO_TAIL @ samples).sum(axis=0)
        excluded: BoolArray = (bounds.max(axis=0) + tail < 0.0) | (bounds.min(axis=0) - tail >= 0.0)
    return ~excluded


def first_rise(times: FloatArray, samples: FloatArray, margin: MarginAtTimes) -> tuple[float, float] | None:
    """Find the first bracket (a, b] in which a margin rises from negative to zero or above.

    Parameters
    ----------
    times, samples : ndarray, shape (DEGREE + 1,)
        Scan times in s, and the margin there.
    margin : callable
        The margin at an array of times.

    Returns
    -------
    (float, float) or None
        Times with margin(a) < 0 <= margin(b).
    """
    waiting: list[tuple[float, float]] = []
    halvings = 0
    while True:
        sure, bracket = _judge(times, samples)
        if not sure and halvings < HALVINGS and times[-1] - times[0] > DEGREE**2 * max(ulp(times[0]), ulp(times[-1])):
            halvings += 1
            middle = 0.5 * (float(times[0]) + float(times[-1]))
            # The first half is looked at first, so it comes last.
            waiting += [(middle, float(times[-1])), (float(times[0]), middle)]
        elif bracket is not None:
            return bracket
        if not waiting:
            return None
        times = scan_times(*waiting.pop())
        samples = margin(times)


def _judge(times: FloatArray, samples: FloatArray) -> tuple[bool, tuple[float, float] | None]:
    """Return whether the samples settle where the margin rises first, and the bracket that they show."""
    if not np.isfinite(samples).all():
        return True, _between_samples(times, samples)
    bounds = TO_BERNSTEIN @ samples
    tail = float(np.abs(TO_TAIL @ samples).sum())
    if bounds.max() + tail < 0.0 or bounds.min() - tail >= 0.0:
        return True, None
    # The derivative of the polynomial is off by up to the degree squared times the tail, its coefficients are the
    # differences times the degree.
    differences = np.diff(bounds)
    if differences.min() > DEGREE * tail or differences.max() < -DEGREE * tail:
        return True, (float(times[0]), float(times[-1])) if samples[0] < 0.0 <= samples[-1] else None
    return False, _between_samples(times, samples)


def _between_samples(times: FloatArray, samples: FloatArray) -> tuple[float, float] | None:
    rises = np.flatnonzero((samples[:-1] < 0.0) & (samples[1:] >= 0.0))
    return (float(times[rises[0]]), float(times[rises[0] + 1])) if rises.size else None


def first_nonnegative(margin: Margin, a: float, b: float) -> float:
    """Locate the rise in the bracket (a, b] to a few ulp, on the side where the margin is zero or above.

    Parameters
    ----------
    margin : callable
        Continuous, with margin(a) < 0 <= margin(b).
    a, b : float
        Times in s.

    Returns
    -------
    float
        A time t in (a, b] with margin(t) >= 0 and margin < 0 a few ulp before.
    """

    def signed(t: float) -> float:
        # Zero counts as above: else a zero at b would end the search, although the margin may be zero or above before.
        return margin(t) or SMALLEST

    # Absolutely no coarser than the floats at the bracket's start, and relatively to rounding: zero may be close to b.
    # Imported where a crossing is located: it takes longer to import than most runs take.
    from scipy.optimize import brentq

    t = float(brentq(signed, a, b, xtol=max(2.0 * ulp(a), SMALLEST), rtol=8.9e-16, maxiter=2000))
    step = ulp(t)
    while margin(t) < 0.0:
        t = min(t + step, b)
        step *= 2.0
    return t

"""Real exponential sums ``f(t) = sum_m c_m exp(-r_m t)``: their zeros, and the exact integral of their modulus.

Impulse responses of the edge domain are such sums. By Rolle's theorem the zeros of f lie apart from each other by those
of ``(f exp(r t))'``, a sum with one term less; so all of them are found by recursion, and none is missed.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

__all__ = ["absolute_integral", "merged", "zeros"]

_SAME = 1e-9
"""Relative distance below which two rates count as one."""
_SMALL = 1e-13
"""Share of the largest coefficient below which a coefficient counts as zero (rounding)."""
_REMAINS = 1e-17
"""What is left of the slowest exponential at the end of the search for zeros."""


def merged(
    coefficients: NDArray[np.float64], rates: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Add up terms whose rates agree and drop those that vanish, both up to rounding; rates ascending."""
    if not len(rates):
        return np.empty(0), np.empty(0)
    order = np.argsort(rates)
    values, speeds = coefficients[order], rates[order]
    is_new = np.append(True, np.diff(speeds) > _SAME * np.abs(speeds[1:]))
    sums = np.add.reduceat(values, np.flatnonzero(is_new))
    kept = np.abs(sums) > _SMALL * np.max(np.abs(values))
    return np.asarray(sums[kept]), np.asarray(speeds[is_new][kept])


def zeros(coefficients: NDArray[np.float64], rates: NDArray[np.float64], end: float) -> list[float]:
    """Zeros between 0 and `end` [s] at which the sum changes its sign, ascending; for terms as `merged` leaves them."""
    if len(coefficients) < 2:
        return []
    shifted = rates - rates[0]
    # (f exp(r_0 t))' has no constant term any more.
    turning = zeros(-shifted[1:] * coefficients[1:], shifted[1:], end)

    def value(t: float) -> float:
        return float(coefficients @ np.exp(-shifted * t))

    found = []
    for a, b in itertools.pairwise([0.0, *turning, end]):
        if value(a) * value(b) < 0:
            found.append(float(brentq(value, a, b, xtol=1e-300, rtol=1e-15)))
    return found


def absolute_integral(coefficients: NDArray[np.float64], rates: NDArray[np.float64]) -> float:
    """``int_0^inf |sum c_m exp(-r_m t)| dt`` for positive rates, exact up to rounding.

    Raises
    ------
    ValueError
        If a rate is not positive: then the integral may be infinite.
    """
    values, speeds = merged(np.asarray(coefficients, dtype=float), np.asarray(rates, dtype=float))
    if not len(values):
        return 0.0
    if speeds[0] <= 0:
        raise ValueError(f"the rate {speeds[0]} is not positive, so the integral does not converge.")
    cuts = np.array([0.0, *zeros(values, speeds, -np.log(_REMAINS) / speeds[0])])
    tail = np.append(np.exp(-np.outer(cuts, speeds)) @ (values / speeds), 0.0)
    return float(np.sum(np.abs(np.diff(tail))))

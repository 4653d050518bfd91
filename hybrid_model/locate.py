"""The trigger rule on (t0, t1]: find the first time at which a margin goes from negative to zero or above.

Along one step of a solver a margin is sampled at the step's ends, close to its ends, and at `scan_points` places
between them. A sign change between neighbouring samples is bracketed; where three neighbouring samples show a negative
local maximum, the maximum itself is sought, so that two crossings close together are found as well. The samples close
to the ends tell whether the margin rises into the step and falls out of it, so this holds in its first and last
interval too. What can still be missed is a margin with more than one maximum between a sample and the next but one, or
so sharp a peak that the samples beside it do not show it: in less than ``2 h/(scan_points + 1)`` for a step h. Tighter
tolerances, more `scan_points` or a `max_step` make that smaller.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from hybrid_model.variables import FloatArray

Margin = Callable[[float], float]
SMALLEST = float(np.finfo(np.float64).tiny)
NEAR_END = 1e-3
"""The samples close to a step's ends are this part of the distance of the others away from them."""


def ulp(t: float) -> float:
    """Return the distance from `t` to the next float."""
    return float(np.spacing(max(abs(t), 1.0)))


def scan_times(a: float, b: float, interior: int) -> FloatArray:
    """Return the times at which margins are sampled along a step.

    Parameters
    ----------
    a, b : float
        Ends of the step in s.
    interior : int
        Number of places, evenly between the ends, beside those close to the ends.

    Returns
    -------
    ndarray
        Increasing, from a to b.
    """
    even = np.linspace(a, b, interior + 2)
    near = NEAR_END * (even[1] - even[0])
    return np.unique(np.concatenate([even, [min(a + near, b), max(b - near, a)]]))


def rise_in_samples(times: FloatArray, samples: FloatArray, margin: Margin) -> tuple[float, float] | None:
    """Find the first bracket (a, b] in which a sampled margin rises from negative to zero or above.

    Parameters
    ----------
    times, samples : ndarray, shape (n,)
        Increasing times in s, and the margin there.
    margin : callable
        The margin as a function of time.

    Returns
    -------
    (float, float) or None
        Times with margin(a) < 0 <= margin(b).
    """
    for k in range(1, len(times)):
        if samples[k - 1] < 0.0 <= samples[k]:
            return float(times[k - 1]), float(times[k])
        if k > 1 and samples[k - 2] <= samples[k - 1] < 0.0 and samples[k] <= samples[k - 1]:
            top = _top(times[k - 2 : k + 1], samples[k - 2 : k + 1], margin)
            if top is not None:
                return float(times[k - 2]), top
    return None


def _top(times: FloatArray, samples: FloatArray, margin: Margin) -> float | None:
    """Seek a time with margin >= 0 around a negative local maximum of three samples."""
    if not np.isfinite(samples[1]):
        return None
    # Most maxima are far below zero: twice the rise of the parabola through the samples tells, with room for other
    # shapes than parabolas.
    before, after = times[1] - times[0], times[2] - times[1]
    up, down = (samples[1] - samples[0]) / before, (samples[1] - samples[2]) / after
    bend = (up + down) / (before + after)
    slope = (up * after - down * before) / (before + after)
    rise = slope**2 / (4.0 * bend) if bend > 0.0 else 0.0
    if samples[1] + 2.0 * rise + max(samples[1] - samples[0], samples[1] - samples[2]) < 0.0:
        return None
    found = minimize_scalar(
        lambda t: -margin(float(t)), bounds=(times[0], times[2]), method="bounded", options={"xatol": 1e-12}
    )
    return float(found.x) if margin(float(found.x)) >= 0.0 else None


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

    t = float(brentq(signed, a, b, xtol=2.0 * ulp(b), rtol=8.9e-16, maxiter=1000))
    step = ulp(t)
    while margin(t) < 0.0:
        t = min(t + step, b)
        step *= 2.0
    return t

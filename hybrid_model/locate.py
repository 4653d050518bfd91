"""The trigger rule on (t0, t1]: find the first time at which a margin goes from negative to zero or above.

Along one step of a solver a margin is sampled at the step's ends and at `scan_points` places between them. A sign
change between neighbouring samples is bracketed; where three neighbouring samples show a negative local maximum, the
maximum itself is sought, so that two crossings close together are found as well. What can still be missed is a margin
that comes up and goes down again more than once between two samples, that is, in less than ``h/(scan_points + 1)`` for
a step h; tighter tolerances or ``max_step`` make h smaller.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from hybrid_model.variables import FloatArray

Margin = Callable[[float], float]


def ulp(t: float) -> float:
    """Return the distance from `t` to the next float."""
    return float(np.spacing(max(abs(t), 1.0)))


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
        if k > 1 and samples[k - 2] < samples[k - 1] < 0.0 and samples[k] < samples[k - 1]:
            top = _top(times[k - 2 : k + 1], samples[k - 2 : k + 1], margin)
            if top is not None:
                return float(times[k - 2]), top
    return None


def _top(times: FloatArray, samples: FloatArray, margin: Margin) -> float | None:
    """Seek a time with margin >= 0 around a negative local maximum of three samples."""
    # The parabola through the samples overestimates little: skip the search where it stays clearly below zero.
    curve = np.polyfit(times - times[1], samples, 2)
    height = samples[1] - curve[1] ** 2 / (4.0 * curve[0]) if curve[0] < 0.0 else samples[1]
    if height < -(max(samples[1] - samples[0], samples[1] - samples[2])):
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
    t = float(brentq(margin, a, b, xtol=2.0 * ulp(b), rtol=8.9e-16))
    step = ulp(t)
    while margin(t) < 0.0:
        t = min(t + step, b)
        step *= 2.0
    return t

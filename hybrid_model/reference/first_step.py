"""The first step of a solver, in a form that no unit of time or of states changes.

After E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", section II.4: a short Euler step
shows how the derivative changes, and the step is chosen so that the error is about the tolerance. Their formula, which
SciPy uses, compares the derivative with fixed numbers and so means another step in milliseconds than in seconds; here
only ratios occur. The C engine of exported FMUs (hybrid_model/engine/first_step.c) does the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.scales import BLIND_PART, EULER_PART, FIRST_GROWTH, FIRST_LEAST, ulp


def first_step(
    rates_at: Callable[[float, FloatArray], FloatArray],
    t: float,
    x: FloatArray,
    end: float,
    *,
    size: float,
    rtol: float,
    order: int,
) -> float:
    """Return the length of a first step from `t` towards `end`.

    Parameters
    ----------
    rates_at : callable
        ``rates_at(t, x) -> dx/dt``, shape (n,).
    t, end : float
        In s; `end` after `t`.
    x : ndarray, shape (n,)
        State at `t`.
    size : float
        Largest size of the states so far; 0 if nothing is known.
    rtol : float
        Relative tolerance of a step.
    order : int
        Of the solver.

    Returns
    -------
    float
        In s, not above ``end - t``.
    """
    whole = end - t
    least = min(whole, FIRST_LEAST * max(ulp(t), ulp(end) if math.isfinite(end) else 0.0))
    rates = rates_at(t, x)
    speed = float(np.abs(rates).max(initial=0.0))
    if not 0.0 < speed < math.inf:
        return max(least, min(whole, BLIND_PART * whole)) if math.isfinite(whole) else least
    euler = EULER_PART * size / speed if size > 0.0 else BLIND_PART * whole
    euler = max(least, min(euler, whole)) if math.isfinite(euler) else least
    turned = float(np.abs(rates_at(t + euler, x + euler * rates) - rates).max(initial=0.0)) / (speed * euler)
    if not math.isfinite(turned):
        return euler
    # The error of a step h is about speed h (turned h)^order; it is to be a hundredth of the tolerance.
    allowed = EULER_PART * rtol * max(size, speed * euler) / speed
    chosen = (allowed * turned) ** (1.0 / (order + 1)) / turned if turned > 0.0 else math.inf
    return max(least, min(FIRST_GROWTH * euler, chosen, whole))

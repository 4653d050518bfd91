"""How much of the rates is rounding: where large terms cancel, no step is as exact as small states ask for (rule 12).

Rates are looked at along three short lines. Their slope tells how large the terms are that a rate is a sum of, and so
how they are rounded, if it is the same in both halves, as it is not at a jump of the rates. Points are so near to each
other that what is smooth has no second differences; what there is of them is rounding, which the slope does not show of
terms that depend on time alone: J. J. More, S. M. Wild, "Estimating computational noise", SIAM Journal on Scientific
Computing 33, 2011. A jump looks alike, but is not on all of the lines. The C engine
(hybrid_model/engine/methods/rounding.c) decides in the same way.
"""

from __future__ import annotations

from itertools import accumulate, pairwise

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError
from hybrid_model.reference.point import Point
from hybrid_model.reference.tolerances import quiet_rates
from hybrid_model.scales import LEFT_BY_ROUNDING, SEEN_PART, STEADY, part_moves, ulp

LOOK_AFTER = 30
"""Evaluations in one step of a stepper, after which some trials of it were rejected."""
LINES, ON_LINE = 3, 17
"""One rounding is often the same at a few points of a line."""
OF_SECOND_DIFFERENCES = 6.0
"""The variance of a second difference of numbers that differ at random is so many times theirs."""


def rounding_of_rates(point: Point, t: float, x: FloatArray, step: float) -> FloatArray:
    """Return how large a rounding is in each rate.

    Parameters
    ----------
    point : Point
        Of the run.
    t, step : float
        Time in s, and a length of steps there.
    x : ndarray, shape (n,)
        States.

    Returns
    -------
    ndarray, shape (n,)
    """
    later = max(SEEN_PART * max(step, t - point.t_start), ulp(t))
    found, differences = np.zeros(len(x)), []
    for line in range(LINES):
        along = line * ON_LINE + np.arange(ON_LINE)
        seen = np.array([_moved_rates(point, t, x, line, k * later, k * SEEN_PART) for k in along])
        found = np.fmax(found, _by_slope(seen))
        second = np.diff(seen, n=2, axis=0)
        differences.append(np.sqrt((second**2).mean(axis=0) / OF_SECOND_DIFFERENCES))
    found = np.maximum(found, np.min(differences, axis=0))
    return np.where(np.isfinite(found), found, 0.0)


def _by_slope(seen: FloatArray) -> FloatArray:
    """Return the rounding that the slope along a line shows of each rate; `seen` has shape (points, n)."""
    half, other = seen[ON_LINE // 2] - seen[0], seen[-1] - seen[ON_LINE // 2]
    whole = np.abs(half + other)
    steady = np.abs(other - half) <= STEADY * whole
    return np.where(steady, whole * np.finfo(float).eps / ((ON_LINE - 1) * SEEN_PART), 0.0)


def left_by_rounding(point: Point, step: float) -> FloatArray:
    """Return what rounding of the rates leaves open in each state after a step of `step` s from the point."""
    t, x = point.t, point.x
    moved = step * rounding_of_rates(point, t, x, step)
    # What the flow takes back by itself, as stiff flows do, is not left.
    change = step * np.abs(quiet_rates(point, t, x + moved) - quiet_rates(point, t, x))
    turned = np.where(np.isfinite(change), change, 0.0)
    return LEFT_BY_ROUNDING * np.divide(moved**2, moved + turned, out=np.zeros(x.shape), where=moved > 0.0)


def _moved_rates(point: Point, t: float, x: FloatArray, line: int, later: float, part: float) -> FloatArray:
    """Return the rates after time has moved by `later`, and all else that they depend on by a part of itself.

    No simple sum of numbers hides from all lines; integers, which count or choose, stay.
    """
    t = min(t + later, point.t_stop)
    values = (x, point.z, point.inputs.at(t), point.p)
    ends = [0, *accumulate(len(each) for each in values)]
    place = np.arange(1, 1 + ends[-1])
    back = (place % 2 == 1, place % 4 >= 2)[line - 1] if line else np.zeros(ends[-1], dtype=bool)
    ways = np.where(back, -1.0, 1.0) * part_moves(1 + ends[-1])[0][1:]
    ways[ends[1] : ends[2]][point.layout.whole] = 0.0
    moved = np.concatenate(values) * (1.0 + part * ways)
    try:
        return point.maps.rates(t, *(moved[a:b] for a, b in pairwise(ends)))
    except (ArithmeticError, ValueError, SimulationError):
        return np.full(x.shape, np.nan)

"""Derivatives of maps at a point, by central differences that are extrapolated to step zero.

Maps of automata contain ``abs``, ``where`` and minima, where a complex step gives wrong numbers without a sign of it.
Central differences do not, and where the map has a kink the two one-sided slopes show it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import DeclarationError, SimulationError

FIRST = np.pi / 28.0
"""The longest step, in units of the variable's size (at least 1). No simple fraction: over whole periods a periodic map
shows no slope."""
STEPS = 26
"""Steps, each half the one before, down to about 3e-9 of the variable's size: the first ones suit smooth maps, whose
rounding errors are then small, the last ones a map with a kink close by."""
WITNESSES = 3
"""The shortest steps, whose differences a slope must not contradict."""
ORDER = 6
"""Columns of an extrapolation table: with six the error of a smooth map falls with the 12th power of the step."""
EVEN: FloatArray = 4.0 ** np.arange(1.0, ORDER)
ODD: FloatArray = 2.0 ** np.arange(1.0, 2 * ORDER - 2, 2)
"""By what the error terms fall when the step is halved: of central differences, and of those of one-sided slopes."""
KINK = 100.0
"""One-sided slopes that differ by more than this many times the estimated error (and by more than 1e-6 of the slope)
differ."""
ACCURACY = 1e-6
"""A derivative whose estimated relative error is above this is refused; smooth maps reach 1e-12."""


def jacobian(
    function: Callable[[FloatArray], FloatArray],
    point: FloatArray,
    *,
    owner: str,
    rows: Sequence[str],
    columns: Sequence[str],
) -> FloatArray:
    """Return the matrix of derivatives of `function` at `point`.

    Each derivative is the limit of central differences over a ladder of halved steps, extrapolated by Richardson's
    method; the entry of the table with the smallest estimated error is taken (Ridders 1982, Adv. Eng. Software 4(2),
    "Accurate computation of F'(x) and F'(x)F''(x)"). Affine functions come out exact to rounding.

    Parameters
    ----------
    function : callable
        From an array of shape (n,) to one of shape (m,).
    point : ndarray, shape (n,)
        Where.
    owner : str
        Name of the automaton, for messages.
    rows, columns : sequence of str
        Names of the m values and of the n variables, for messages.

    Returns
    -------
    ndarray, shape (m, n)

    Raises
    ------
    SimulationError
        If the function is not finite at the point or around it.
    DeclarationError
        If the function has a kink or a jump at the point, or no derivative for another reason.
    """
    with np.errstate(all="ignore"):
        here = function(point)
        bad = np.flatnonzero(~np.isfinite(here))
        if bad.size:
            raise SimulationError(
                f"{owner}: {rows[bad[0]]} is {here[bad[0]]} at the point of the linearisation: "
                "choose a point where the maps are finite."
            )
        found = np.zeros((here.size, point.size))
        for k in range(point.size):
            found[:, k] = _column(function, point, k, here, owner, rows, columns[k])
    return found


def _column(
    function: Callable[[FloatArray], FloatArray],
    point: FloatArray,
    k: int,
    here: FloatArray,
    owner: str,
    rows: Sequence[str],
    variable: str,
) -> FloatArray:
    steps = FIRST * max(1.0, abs(point[k])) * 0.5 ** np.arange(STEPS)
    ends = np.array([point[k] + steps, point[k] - steps])
    ahead, behind = (np.array([function(_moved(point, k, end)) for end in side]) for side in ends)
    width = (ends[0] - ends[1])[:, None]  # as the rounded ends have it
    size = np.maximum(np.maximum(np.abs(ahead), np.abs(behind)), np.abs(here))
    noise = 2.0 * np.finfo(np.float64).eps * size / width
    central = (ahead - behind) / width
    slope, error = _settled(central, noise, EVEN)
    kink, doubt = _settled(2.0 * (ahead - 2.0 * here + behind) / width, noise, ODD)
    for row, name in enumerate(rows):
        what = f"{owner}: {name} has no derivative with respect to {variable} at {variable} = {point[k]:.9g}"
        if not np.isfinite(error[row]):
            raise SimulationError(
                f"{what}: it is finite on one side only, or nowhere around: choose a point inside its domain."
            )
        if abs(kink[row]) > KINK * doubt[row] + ACCURACY * abs(slope[row]):
            raise DeclarationError(
                f"{what}: there is a kink, with the slopes {slope[row] - kink[row] / 2:.6g} below and "
                f"{slope[row] + kink[row] / 2:.6g} above: choose a point on one side of it."
            )
        rounding = float(np.nanmin(noise[:, row]))
        if error[row] > ACCURACY * (abs(slope[row]) + _largest(central[:, row])) + KINK * rounding:
            raise DeclarationError(
                f"{what}: its differences do not settle (there is a jump or an infinite slope): choose another point."
            )
    return slope


def _moved(point: FloatArray, k: int, value: float) -> FloatArray:
    moved = point.copy()
    moved[k] = value
    return moved


def _settled(column: FloatArray, noise: FloatArray, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the limits of differences for step zero, and their estimated errors.

    Long steps may agree on a limit that is not the one at the point: they reach over what happens close to it. The
    shortest ones are the witnesses, inaccurate but near: steps are left out from the long end until both agree.
    """
    limit, error = _limit(column, noise, factors)
    scale = np.max(np.abs(np.where(np.isfinite(column), column, 0.0)), axis=0)
    for first in range(1, STEPS - ORDER):
        allowed = KINK * noise[-WITNESSES:] + ACCURACY * (np.abs(limit) + scale)
        wrong = np.any(np.abs(column[-WITNESSES:] - limit) > allowed, axis=0)
        if not np.any(wrong):
            break
        nearer, its_error = _limit(column[first:], noise[first:], factors)
        limit, error = np.where(wrong, nearer, limit), np.where(wrong, its_error, error)
    return limit, error


def _largest(differences: FloatArray) -> float:
    """Return the size of the function's slope on the longest step on which it is finite."""
    finite = differences[np.isfinite(differences)]
    return float(abs(finite[0])) if finite.size else 0.0


def _limit(column: FloatArray, noise: FloatArray, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the limits for step zero of sequences over halved steps, and their estimated errors.

    Each further column of the table removes one power of the step, which falls by its factor from row to row. The
    error is the change to the neighbours in the table, plus the rounding errors of the differences.
    """
    best, error = column[0], np.full(column.shape[1], np.inf)
    previous = column
    for factor in factors:
        table = previous[1:] + (previous[1:] - previous[:-1]) / (factor - 1.0)
        noise = noise[1:]
        change = np.maximum(np.abs(table - previous[1:]), np.abs(table - previous[:-1])) + noise
        change = np.where(np.isfinite(change), change, np.inf)
        at = np.argmin(change, axis=0)
        smallest = np.take_along_axis(change, at[None], axis=0)[0]
        better = smallest < error
        best = np.where(better, np.take_along_axis(table, at[None], axis=0)[0], best)
        error = np.where(better, smallest, error)
        previous = table
    return best, error

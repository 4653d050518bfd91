"""The support function of a sum of segments over all earlier periods, many periods at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["FINEST_TAIL", "support_over_periods"]

FINEST_TAIL = 1e-11
"""Share of a direction below which earlier periods count no more."""

_MOST_CYCLES = 1_000_000_000
_LOST = 0.1
"""Times the root of the tail, the share that may be lost by taking periods together: 3e-7 for the finest tail."""

_OF_ALL = 0.02
"""The share is that of the periods taken together, and this part of it of all that came before."""

_FEW_COLUMNS = 64
_CHUNK = 4_000_000
"""Numbers in the largest temporary array."""


def support_over_periods(
    generators: NDArray[np.float64],
    monodromy: NDArray[np.float64],
    directions: NDArray[np.float64],
    tail: float = FINEST_TAIL,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum over all earlier periods: the m-th one sees the direction ``(monodromy^T)^m b``."""
    width = max(1, _CHUNK // len(generators)) if len(generators) else directions.shape[1]
    parts = range(0, directions.shape[1], width)
    found = [_Periods(generators, monodromy, tail).sum(directions[:, k : k + width]) for k in parts]
    return np.concatenate([values for values, _ in found]), np.hstack([points for _, points in found])


class _Periods:
    """Support of the sum over periods, many of them at a time where all errors keep their signs.

    Over the periods m, ..., m + q - 1 the errors at one phase are taken to be equal: then the sum is that of one period
    with the generators ``g (I + M + ... + M^{q-1})^T`` and the monodromy matrix ``M^q``. These errors are admissible,
    so the support is reached from below; nothing is lost where the signs of ``g . (M^T)^m b`` do not change, and
    q is halved where what is lost would count.
    """

    def __init__(self, generators: NDArray[np.float64], monodromy: NDArray[np.float64], tail: float) -> None:
        self._generators, self._tail, self._lost = generators, tail, _LOST * tail**0.5
        self._powers, self._sums = [monodromy], [np.eye(len(monodromy))]

    def sum(self, directions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Support function, shape (count,), and points, shape (p, count)."""
        lengths = np.linalg.norm(directions, axis=0)
        unit = directions / np.where(lengths > 0, lengths, 1.0)
        values, points, shift = np.zeros(len(lengths)), np.zeros_like(directions), np.eye(len(directions))
        now, along, level, cycles = unit, self._along(unit), 0, 0
        while True:
            if cycles > _MOST_CYCLES:
                raise ValueError(
                    f"disagreement does not vanish to {self._tail:g} of itself in {_MOST_CYCLES} periods; "
                    "choose beta further below the Floquet rate."
                )
            wanted = level
            level, whole, later, along_later = self._advance(now, along, level, values)
            values += np.abs(whole).sum(axis=0)
            points += shift @ self._sums[level] @ (self._generators.T @ np.sign(whole))
            if np.linalg.norm(later) <= self._tail * np.linalg.norm(unit):
                return values * lengths, points
            shift, cycles = shift @ self._powers[level], cycles + 2**level
            # A block that had to be halved is not doubled again at once.
            now, along, level = later, along_later, level + (level >= wanted)

    def _advance(
        self, now: NDArray[np.float64], along: NDArray[np.float64], level: int, values: NDArray[np.float64]
    ) -> tuple[int, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """``2^level`` periods or less at a time: the level, and along all of them; the directions after them."""
        later = self._table(level)[0].T @ now
        along_later = self._along(later)
        while level:
            # A sign that turns twice would not be seen at the ends alone.
            halfway = self._powers[level - 1].T @ now
            middle = self._along(halfway)
            size = (np.abs(along) + 2 * np.abs(middle) + np.abs(along_later)).sum(axis=0) / 4
            lost = _turned(along, middle) + _turned(middle, along_later)
            if np.all(lost <= self._lost * (size + _OF_ALL * values / 2**level)):
                return level, self._along(self._sums[level].T @ now), later, along_later
            level, later, along_later = level - 1, halfway, middle
        return level, along, later, along_later

    def _table(self, level: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """``M^q`` and ``I + M + ... + M^{q-1}`` for ``q = 2^level``."""
        while len(self._powers) <= level:
            power, total = self._powers[-1], self._sums[-1]
            self._sums.append(total + power @ total)
            self._powers.append(power @ power)
        return self._powers[level], self._sums[level]

    def _along(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        if directions.shape[1] < _FEW_COLUMNS:
            # A threaded product with few columns costs more than it gives.
            return np.asarray(np.einsum("ri,ic->rc", self._generators, directions))
        return self._generators @ directions


def _turned(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum over rows whose sign changes of the lesser magnitude, shape (count,)."""
    return np.asarray(np.where(before * after < 0, np.minimum(np.abs(before), np.abs(after)), 0.0).sum(axis=0))

"""Recent values of continuous signals, and what they are expected to be a little later."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray

MOST, MOST_WITH_SLOPES = 3, 2
"""Points that a polynomial goes through: a parabola, or by Hermite's interpolation a cubic."""


class SignalHistory:
    """Values of several signals since their last jump, continued by polynomials (Kübler and Schiehlen, 2000).

    Parameters
    ----------
    t : float
        Time in s.
    values : sequence of float
        There.
    slopes : sequence of float
        Derivatives by time; NaN where they are not known, which is of a signal so always.
    """

    def __init__(self, t: float, values: Sequence[float], slopes: Sequence[float]) -> None:
        self.forget(t, values, slopes)

    def forget(self, t: float, values: Sequence[float], slopes: Sequence[float]) -> None:
        """Begin anew at `t` in s, as after a jump."""
        self._times, self._values, self._slopes = [t], [_array(values)], [_array(slopes)]
        self._known = ~np.isnan(self._slopes[0])
        self._forms: list[_Newton] = []

    def add(self, t: float, values: Sequence[float], slopes: Sequence[float]) -> None:
        """Add what there is at `t` in s."""
        self._times = [*self._times, t][-MOST:]
        self._values = [*self._values, _array(values)][-MOST:]
        self._slopes = [*self._slopes, _array(slopes)][-MOST:]
        self._forms = []

    @property
    def is_long(self) -> bool:
        """Whether the polynomials go through as many points as they may."""
        return len(self._times) >= MOST

    def copy(self) -> SignalHistory:
        """Return a history that goes on by itself."""
        return copy.copy(self)  # lists are made anew where they change

    @property
    def last(self) -> FloatArray:
        """The last values."""
        return self._values[-1]

    def at(self, t: float) -> FloatArray:
        """Return what the signals are expected to be at `t` in s."""
        values = [form.at(t) for form in self._polynomials()]
        return values[0] if len(values) == 1 else np.where(self._known, *values)

    def about(self, t: float) -> list[FloatArray]:
        """Return what signals are expected to be about `t` in s: coefficients of polynomials in the time from it."""
        found = [form.about(t) for form in self._polynomials()]
        if len(found) == 1:
            return found[0]
        nothing = np.zeros_like(self.last)
        return [np.where(self._known, *both) for both in itertools.zip_longest(*found, fillvalue=nothing)]

    def _polynomials(self) -> list[_Newton]:
        """Return the polynomials: of signals with slopes, and of those without, where there are such."""
        if not self._forms:
            last = slice(-MOST_WITH_SLOPES, None)
            if self._known.any():
                times = [own for own in self._times[last] for _ in range(2)]
                values = [value for value in self._values[last] for _ in range(2)]
                self._forms.append(_Newton(times, values, self._slopes[last]))
            if not self._known.all() or not self._forms:
                self._forms.append(_Newton(self._times, self._values))
        return self._forms


class _Newton:
    """Polynomials through points, by divided differences; points that are there twice have slopes, one for two."""

    def __init__(self, times: Sequence[float], values: Sequence[FloatArray], slopes: Sequence[FloatArray] = ()) -> None:
        table, self._times, self._differences = list(values), times, [values[0]]
        for order in range(1, len(times)):
            table = [
                slopes[k // 2] if times[k + order] == times[k] else (after - before) / (times[k + order] - times[k])
                for k, (before, after) in enumerate(itertools.pairwise(table))
            ]
            self._differences.append(table[0])

    def at(self, t: float) -> FloatArray:
        """Return the values at `t` in s."""
        value = self._differences[-1]
        for difference, own in zip(self._differences[-2::-1], self._times[-2::-1], strict=True):
            value = value * (t - own) + difference
        return value

    def about(self, t: float) -> list[FloatArray]:
        """Return the coefficients in the time from `t` in s."""
        result = [self._differences[-1]]
        for difference, own in zip(self._differences[-2::-1], self._times[-2::-1], strict=True):
            # Times (t - own) + s, plus the difference.
            shifted = [*((t - own) * c for c in result), np.zeros_like(difference)]
            result = [shifted[0] + difference, *(a + b for a, b in zip(shifted[1:], result, strict=True))]
        return result


def _array(values: Sequence[float]) -> FloatArray:
    return np.array(values, dtype=np.float64)

"""Recent values of continuous signals, and what they are expected to be a little later."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray

MOST = 3
"""Points that a polynomial goes through: a parabola."""


class SignalHistory:
    """Values of several signals since their last jump, continued by polynomials (Kübler and Schiehlen, 2000).

    Parameters
    ----------
    t : float
        Time in s.
    values : sequence of float
        There.
    """

    def __init__(self, t: float, values: Sequence[float]) -> None:
        self.forget(t, values)

    def forget(self, t: float, values: Sequence[float]) -> None:
        """Begin anew at `t` in s, as after a jump."""
        self._times, self._values = [t], [np.array(values, dtype=np.float64)]

    def add(self, t: float, values: Sequence[float]) -> None:
        """Add the values at `t` in s."""
        self._times = [*self._times, t][-MOST:]
        self._values = [*self._values, np.array(values, dtype=np.float64)][-MOST:]

    def copy(self) -> SignalHistory:
        """Return a history that goes on by itself."""
        other = SignalHistory(0.0, ())
        other._times, other._values = list(self._times), list(self._values)
        return other

    @property
    def last(self) -> FloatArray:
        """The last values."""
        return self._values[-1]

    def at(self, t: float) -> FloatArray:
        """Return what the signals are expected to be at `t` in s."""
        result = np.zeros_like(self._values[-1])
        for k, (own, values) in enumerate(zip(self._times, self._values, strict=True)):
            weight = 1.0
            for j, other in enumerate(self._times):
                weight *= 1.0 if j == k else (t - other) / (own - other)
            result = result + weight * values
        return result

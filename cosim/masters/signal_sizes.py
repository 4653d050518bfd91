"""How large signals are: what their errors are held against."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.scales import UNKNOWN

NOMINAL = 0.01
"""Part of its nominal value that a signal is taken for at least (FMI 2.0.4, section 2.2.7: for absolute tolerances)."""
TINY = 1e-300
"""A size above zero."""


class SignalSizes:
    """The largest value that each of several signals has had.

    A signal that rises from zero would be all error at first, however short the steps are. So one that has shown
    nothing to speak of is taken for as large as the first step that was not accurate would have made it, until its end.

    Parameters
    ----------
    nominal : sequence of float
        Nominal values; 0 where there is none.
    values : sequence of float
        At the start.
    """

    def __init__(self, nominal: Sequence[float], values: Sequence[float] | FloatArray) -> None:
        self._least = np.maximum(NOMINAL * np.array(nominal, dtype=np.float64), TINY)
        self._largest = np.abs(np.array(values, dtype=np.float64))
        self._ahead, self._until = np.zeros_like(self._largest), -math.inf

    def beside(self, values: FloatArray) -> FloatArray:
        """Return the sizes of the signals, these values among theirs."""
        return np.maximum(np.maximum(self._largest, self._ahead), np.maximum(self._least, np.abs(values)))

    def take(self, t: float, values: FloatArray) -> None:
        """Note values at `t` in s."""
        self._largest = np.maximum(self._largest, np.abs(values))
        if t >= self._until:
            self._ahead = np.zeros_like(self._ahead)

    def foresee(self, t: float, values: FloatArray) -> None:
        """Note what a step to `t` in s came to that was not accurate."""
        if t > self._until:
            sizes = np.abs(values)
            self._ahead, self._until = np.where(self._largest < UNKNOWN * sizes, sizes, 0.0), t

"""The gate ``square(rate*t - phase, duty_percent)`` as data: its segments, its instants, integrals while it is open."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.consensus.weights.clockwork import gate_boundary, gate_segment
from hybrid_model.consensus.weights.waveform import require, require_phase

__all__ = ["Gate"]


@dataclass(frozen=True)
class Gate:
    """MATLAB's ``square`` as the paper uses it (section 7): open for the first share of each period, then closed.

    Parameters
    ----------
    rate : float
        Angular rate [rad/s], positive.
    duty_percent : float
        Open share of each period, 0 to 100 [%].
    phase : float
        Phase [rad].
    """

    rate: float
    duty_percent: float
    phase: float = 0.0

    def check(self) -> None:
        """ValueError if a number is outside its range or not finite."""
        require("gate_rate", self.rate, self.rate > 0, "must be positive")
        require("duty_percent", self.duty_percent, 0 <= self.duty_percent <= 100, "must lie between 0 and 100")
        require_phase(self.phase)

    def segment(self, t: Any) -> Any:
        """Index of the segment that holds `t` [s]; even is open."""
        return gate_segment(t, self.rate, self.phase, self.duty_percent)

    def boundary(self, k: Any) -> Any:
        """End time [s] of segment `k`."""
        return gate_boundary(k, self.rate, self.phase, self.duty_percent)

    def is_open(self, t: ArrayLike) -> NDArray[np.float64]:
        """1 where the gate is open at `t` [s], else 0."""
        return np.asarray(1.0 - self.segment(np.asarray(t, dtype=float)) % 2)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Instants strictly between `t0` and `t1` [s] at which the gate opens or closes; none if it never does."""
        if not 0 < self.duty_percent < 100:
            return np.empty(0)
        times: NDArray[np.float64] = self.boundary(np.arange(self.segment(t0), self.segment(t1)))
        return times[(times > t0) & (times < t1)]

    def integral(self, carrier: Carrier, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral of the carrier over the open windows from `t0` to `t1` [s]; the two broadcast."""
        begin, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        if begin.size == 0:
            return np.zeros(begin.shape)
        first, last = float(min(begin.min(), end.min())), float(max(begin.max(), end.max()))
        windows = np.arange(self._window(first), self._window(last) + 1)
        # Cutting the first window at the earliest time makes its primitive zero there: a scalar integral is then one
        # sum of positive terms, with no difference of two large numbers.
        opens = np.maximum(self.boundary(2 * windows - 1), first)
        closes = np.maximum(self.boundary(2 * windows), opens)
        before = np.concatenate(([0.0], np.cumsum(carrier.integral(opens, closes))))

        def primitive(t: NDArray[np.float64]) -> NDArray[np.float64]:
            index = (self._window(t) - windows[0]).astype(int)
            within = np.clip(t, opens[index], closes[index])
            return np.asarray(before[index] + carrier.integral(opens[index], within))

        return primitive(end) - primitive(begin)

    def _window(self, t: Any) -> Any:
        return np.floor(self.segment(t) / 2)

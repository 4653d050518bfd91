"""The gate ``square(rate*t - phase, duty_percent)``: segments, integrals while it is open, its clock in runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import holding, is_odd
from hybrid_model.consensus.clocks.over_time import require, require_phase
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.consensus.weights.edge_automata import PIECE_EVENTS, ForeseenWeights
from hybrid_model.declare.variables import Value

__all__ = ["Gate", "GateClock", "gate_boundary", "gate_segment", "is_open"]


def gate_segment(t: Value, rate: Value, phase: Value, duty_percent: Value) -> Value:
    """Index of the on- or off-segment of the gate ``square(rate*t - phase, duty_percent)`` that holds `t`.

    On-window ``m`` starts at ``(phase + 2*pi*m)/rate`` and lasts ``2*pi*duty_percent/100/rate``; ``m`` may be negative.

    Parameters
    ----------
    t : float, array or symbol
        Time [s].
    rate : float
        Angular rate of the gate [rad/s].
    phase : float
        Phase [rad].
    duty_percent : float
        Share of each period during which the gate is open, 0 to 100 [%].

    Returns
    -------
    float, array or symbol
        ``2*m`` inside on-window ``m``, ``2*m + 1`` after it. With a duty of 0 there are only odd segments, with a duty
        of 100 only even ones.

    Notes
    -----
    ``square(a*t, b)`` is the paper's section 7: +1 for the first ``b`` percent of each period ``2*pi/a``, then -1.
    """
    window = holding(
        t,
        np.floor((t * rate - phase) / (2 * np.pi)),
        lambda m: gate_boundary(2 * m + 1, rate, phase, duty_percent),
    )
    is_over = np.where(t >= gate_boundary(2 * window, rate, phase, duty_percent), 1.0, 0.0)
    return 2 * window + is_over


def gate_boundary(k: Value, rate: Value, phase: Value, duty_percent: Value) -> Value:
    """End time [s] of segment `k` of the gate; see `gate_segment` for the parameters.

    The end of an off-segment is computed as ``(phase + 2*pi*(m + 1))/rate``. With ``rate = 4`` and ``phase = 0`` the
    division is exact, so a dwell of ``pi`` or ``pi/2`` meets the gate at the same floating-point number.
    """
    share = is_odd(k) + (1 - is_odd(k)) * (duty_percent / 100)
    return (phase + 2 * np.pi * (np.floor(k / 2) + share)) / rate


def is_open(segment: Value) -> Value:
    """1 in segments in which the gate is open, else 0."""
    return 1 - is_odd(segment)


class GateClock(ForeseenWeights):
    """Weights with gates, one for each edge, each with the index of its present segment."""

    segment = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="segment of the gate: even is on"
    )
    gate_rate = hm.Parameter(4.0, shape="degree", unit="rad/s", description="rate of the gate")
    duty_percent = hm.Parameter(
        20.0, shape="degree", minimum=0.0, maximum=100.0, description="share of each gate period that is on, in percent"
    )
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the gate")
    pieces: ClassVar[tuple[str, ...]] = ("segment",)
    transitions: ClassVar[tuple[hm.Jump | hm.TimeEvent, ...]] = PIECE_EVENTS

    def pieces_at(self, s: hm.Values) -> dict[str, Value]:
        """The segments that hold the present time."""
        return {"segment": gate_segment(s.t, s.gate_rate, s.phase, s.duty_percent)}

    def piece_end(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """Time at which the first gate switches."""
        return np.min(gate_boundary(pieces["segment"], s.gate_rate, s.phase, s.duty_percent))


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
        lowest, highest = self._window(np.array([first, last]))
        windows = np.arange(lowest, highest + 1)
        # Cutting the first window at the earliest time makes its primitive zero there: a scalar integral is then one
        # sum of positive terms, with no difference of two large numbers.
        opens = np.maximum(self.boundary(2 * windows - 1), first)
        closes = np.maximum(self.boundary(2 * windows), opens)
        before = np.concatenate(([0.0], np.cumsum(carrier.integral(opens, closes))))

        def primitive(t: NDArray[np.float64]) -> NDArray[np.float64]:
            index = (self._window(t) - windows[0]).astype(int)
            within = np.clip(t, opens[index], closes[index])
            return np.asarray(before[index] + carrier.integral(opens[index], within))

        below, above = primitive(np.stack((begin, end)))
        return np.asarray(above - below)

    def _window(self, t: Any) -> Any:
        return np.floor(self.segment(t) / 2)

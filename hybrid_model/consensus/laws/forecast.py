"""Forecast of an agent's error while nothing is received and its weights are known: the first time it is too large.

Everything here is arithmetic on values, without a branch on any, so that it also traces on symbols.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid_model.consensus.scenario.trigger import Threshold
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.declare.variables import Value

ROUNDS = 8
"""Steps of one search; one that has not arrived is taken up again from where it got to."""
NOISE = 1e-13
"""Relative rounding of a predicted error: within it, the threshold is met."""
RESOLVED = 1e-15
"""Steps that short, relative to the time, lead nowhere."""
FLATTEST = 1e-30
"""Smallest bound of the curvature: a larger bound is a bound too, and a positive one makes every root finite."""
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Meeting:
    """How far a search got: at `t` the threshold is met, or the search is still open, or the piece has ended."""

    t: Value
    met: Value
    open: Value


@dataclass(frozen=True, eq=False)
class Forecast:
    """The error ``e(t) = error_then + sum_j pull_j integral of carrier_j from since to t`` against a threshold.

    Parameters
    ----------
    carrier : Carrier
        Shapes of the edges' weights, with a bound on their slopes.
    pull : array
        ``k a_j (xhat - xhat_j)`` with the amplitudes a_j of the weights, zero for edges that are not active.
    error_then, since : float
        The error at the time `since` in s.
    threshold : Threshold
        With no offset: ``c exp(-beta t)``.
    scale : float
        Size of the states, for their rounding.
    """

    carrier: Carrier
    pull: Value
    error_then: Value
    since: Value
    threshold: Threshold
    scale: Value

    def error(self, t: Value) -> Value:
        """The error at time `t` in s."""
        return self.error_then + np.sum(self.pull * self.carrier.integral(self.since, t))

    def first_meeting(self, end: Value) -> Meeting:
        """Search from `since` to `end` for the first time at which ``|e|`` meets the threshold.

        With ``f'' <= K`` the parabola ``f + f' h + K h**2/2`` lies above ``f = |e| - c exp(-beta t)``, so f has no root
        before the parabola has one. Steps to the parabola's root never pass the root of f and near it are Newton's.
        """
        t = self.since
        for _ in range(ROUNDS):
            step, _ = self._step(t)
            t = np.minimum(t + step, end)
        step, room = self._step(t)
        level = self.threshold.at(t)
        rounding = np.minimum(NOISE * self.scale, 0.25 * level)
        met = np.logical_or(room <= rounding, step <= RESOLVED * np.maximum(1.0, t))
        return Meeting(t, met, np.logical_and(np.logical_not(met), t < end))

    def _step(self, t: Value) -> tuple[Value, Value]:
        """A step that passes no root, and the distance of ``|e|`` from the threshold."""
        error = self.error(t)
        level = self.threshold.at(t)
        slope = np.sum(self.pull * self.carrier.value(t))
        curvature = np.maximum(np.sum(np.abs(self.pull) * self.carrier.steepness), FLATTEST)
        above, below = level - error, level + error
        sink = self.threshold.decay * level
        step = np.minimum(_safe_step(above, slope + sink, curvature), _safe_step(below, sink - slope, curvature))
        return step, np.minimum(above, below)


def _safe_step(room: Value, slope: Value, curvature: Value) -> Value:
    """Positive root of ``-room + slope*h + curvature*h**2/2``, for a positive curvature."""
    room = np.maximum(room, 0.0)
    root = np.sqrt(slope * slope + 2.0 * curvature * room)
    # Each form of the root is free of cancellation for one sign of the slope.
    rising = 2.0 * room / np.maximum(np.abs(slope) + root, TINY)
    falling = (np.abs(slope) + root) / curvature
    return np.where(slope > 0.0, rising, falling)

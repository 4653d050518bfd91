"""Forecast of an agent's error while nothing is received and its weights are waves: the first time it is too large.

Everything here is arithmetic on values, without a branch on any, so that it also traces on symbols.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid_model.consensus.weights.clockwork import not_negative
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
class Wave:
    """Weights ``mean + cosine*cos(rate*t) + sine*sin(rate*t)``, arrays over the edges; rate in rad/s, positive."""

    mean: Value
    cosine: Value
    sine: Value
    rate: Value

    def value(self, t: Value) -> Value:
        """Weights at time `t` in s."""
        return not_negative(self.mean + self.cosine * np.cos(self.rate * t) + self.sine * np.sin(self.rate * t))

    def integral(self, a: Value, b: Value) -> Value:
        """Integrals from `a` to `b` in s, in a form that does not cancel for short intervals."""
        middle, half = self.rate * (a + b) / 2, self.rate * (b - a) / 2
        swing = self.cosine * np.cos(middle) + self.sine * np.sin(middle)
        return self.mean * (b - a) + 2.0 * swing * np.sin(half) / self.rate

    @property
    def steepness(self) -> Value:
        """Bounds of the weights' slopes."""
        return self.rate * (np.abs(self.cosine) + np.abs(self.sine))


@dataclass(frozen=True, eq=False)
class Meeting:
    """How far a search got: at `t` the threshold is met, or the search is still open, or the piece has ended."""

    t: Value
    met: Value
    open: Value


@dataclass(frozen=True, eq=False)
class Forecast:
    """The error ``e(t) = error_then + sum_j pull_j integral of w_j from since to t`` against ``c exp(-beta t)``.

    Parameters
    ----------
    wave : Wave
        Weights of the edges.
    pull : array
        ``k (xhat - xhat_j)``, zero for edges that are not active.
    error_then, since : float
        The error at the time `since` in s.
    threshold, decay : float
        c and beta.
    scale : float
        Size of the states, for their rounding.
    """

    wave: Wave
    pull: Value
    error_then: Value
    since: Value
    threshold: Value
    decay: Value
    scale: Value

    def error(self, t: Value) -> Value:
        """The error at time `t` in s."""
        return self.error_then + np.sum(self.pull * self.wave.integral(self.since, t))

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
        level = self.threshold * np.exp(-self.decay * t)
        rounding = np.minimum(NOISE * self.scale, 0.25 * level)
        met = np.logical_or(room <= rounding, step <= RESOLVED * np.maximum(1.0, t))
        return Meeting(t, met, np.logical_and(np.logical_not(met), t < end))

    def _step(self, t: Value) -> tuple[Value, Value]:
        """A step that passes no root, and the distance of ``|e|`` from the threshold."""
        error = self.error(t)
        level = self.threshold * np.exp(-self.decay * t)
        slope = np.sum(self.pull * self.wave.value(t))
        curvature = np.maximum(np.sum(np.abs(self.pull) * self.wave.steepness), FLATTEST)
        above, below = level - error, level + error
        sink = self.decay * level
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

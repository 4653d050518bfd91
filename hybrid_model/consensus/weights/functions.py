"""Weights given by a Python function of time, of the distance between agents, or of a link's reliability."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from hybrid_model.consensus.graphs.undirected import Edge
from hybrid_model.consensus.weights.clockwork import not_negative
from hybrid_model.consensus.weights.primitive import Primitive
from hybrid_model.consensus.weights.row_clock import RowClock, check_rows
from hybrid_model.consensus.weights.waveform import ALWAYS, require

__all__ = ["FunctionCarrier", "FunctionWeight", "TimeFunction", "distance_weights", "reliability_weight"]

TimeFunction = Callable[[Any], Any]
"""A function of time [s] in numpy style: the same line serves floats, arrays and symbols."""

_CHECKS, _SAMPLES = 257, 2049
_ROUNDING = 1e-12
"""Share of the largest value by which rounding may leave a weight below 0."""
_TRIED = 100.0
"""Time [s] over which a function without a period is tried out."""


@dataclass(frozen=True)
class FunctionCarrier:
    """The function itself as a carrier; two are equal if they hold the same function object."""

    function: TimeFunction
    kinks: tuple[float, ...] = ()
    period: float | None = None

    @cached_property
    def rate(self) -> float:
        """An estimate: as many half waves as the samples of one period, or of 100 s, have turning points."""
        span = self.period if self.period is not None else _TRIED
        rises = np.sign(np.diff(self.value(np.linspace(0.0, span, _SAMPLES))))
        rises = rises[rises != 0]
        return float(np.pi * np.count_nonzero(rises[1:] != rises[:-1]) / span)

    @cached_property
    def clock(self) -> RowClock | None:
        """The kinks as beginnings of rows; None if there are none."""
        return RowClock(self.kinks, self.period) if self.kinks else None

    @cached_property
    def _primitive(self) -> Primitive:
        return Primitive(self.value, self.breakpoints, self.period)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Kinks strictly between `t0` and `t1` [s], ascending."""
        return self.clock.breakpoints(t0, t1) if self.clock is not None else np.empty(0)

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """Value at time `t` [s]; what is below 0 counts as 0."""
        return np.asarray(not_negative(self.raw(t)))

    def raw(self, t: ArrayLike) -> NDArray[np.float64]:
        """What the function gives at time `t` [s], below 0 or not."""
        time = np.asarray(t, dtype=float)
        return np.broadcast_to(np.asarray(self.function(time), dtype=float), time.shape)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s] by Gauss quadrature, to about 12 digits of the integral of one cell."""
        begin, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        return self._primitive(end) - self._primitive(begin)


@dataclass(frozen=True)
class FunctionWeight:
    """A weight that is a given function of time.

    Parameters
    ----------
    function : callable
        ``function(t)`` in numpy style (``np.where``, ``np.exp``, ... instead of ``if`` and ``math``), so that it runs
        on arrays and is traced into exported FMUs. It must be at least 0, up to rounding, and continuous; a weight that
        also jumps is this one under a switching, or a table. What is below 0 counts as 0, in all executions.
    kinks : tuple of float
        Times [s] of the points where it is not smooth, ascending; those of one period if it has a period. Runs stop
        there and go on.
    period : float, optional
        A period of the function [s].

    Raises
    ------
    ValueError
        If the function is negative by more than rounding, not finite or not periodic at one of the times at which this
        is tried out, or the kinks do not ascend within one period.
    """

    function: TimeFunction
    kinks: tuple[float, ...] = ()
    period: float | None = None

    def __post_init__(self) -> None:
        """Try the function out."""
        if self.period is not None:
            require("period", self.period, self.period > 0, "must be positive")
        if self.kinks:
            check_rows(self.kinks, self.period, ("kinks", "period"))
        span = self.period if self.period is not None else _TRIED
        times = np.linspace(0.0, span, _CHECKS)
        values = self.carrier.raw(times)
        rounding = _ROUNDING * float(np.max(np.abs(values)))
        for time, value in zip(times.tolist(), values.tolist(), strict=True):
            require(f"the weight at t = {time:.6g}", value, value >= -rounding, "must not be negative")
        if self.period is not None:
            later = self.carrier.raw(times + self.period)
            wrong = np.abs(later - values) > 1e-9 * (1 + values.max())
            if wrong.any():
                time = float(times[wrong.argmax()])
                raise ValueError(
                    f"period is {self.period}, but the weight is {float(values[wrong.argmax()]):.9g} at t = {time:.6g} "
                    f"and {float(later[wrong.argmax()]):.9g} one period later; give a period of the function, or none."
                )

    @cached_property
    def carrier(self) -> FunctionCarrier:
        """The function."""
        return FunctionCarrier(self.function, self.kinks, self.period)

    @property
    def domain(self) -> tuple[float, float]:
        """All times."""
        return ALWAYS

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """1, in the shape of `t` [s]."""
        return np.ones(np.shape(t))

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`."""
        return self.carrier.value(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Kinks strictly between `t0` and `t1` [s], ascending."""
        return self.carrier.breakpoints(t0, t1)

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral of the weight from `t0` to `t1` [s] to about 12 digits; the two broadcast against each other."""
        return self.carrier.integral(t0, t1)


def reliability_weight(
    law: Callable[[Any], Any], reliability: TimeFunction, kinks: Sequence[float] = (), period: float | None = None
) -> FunctionWeight:
    """The weight ``law(reliability(t))`` of a link whose reliability is known as a function of time.

    Parameters
    ----------
    law : callable
        Weight as a function of the reliability, in numpy style.
    reliability : callable
        Reliability of the link at time t [s], in numpy style.
    kinks, period
        As in `FunctionWeight`.
    """
    return FunctionWeight(lambda t: law(reliability(t)), tuple(kinks), period)


def distance_weights(
    edges: Sequence[Edge],
    positions: Sequence[Callable[[Any], Sequence[Any]]],
    law: Callable[[Any], Any],
    *,
    bends: Sequence[float] = (),
    horizon: float,
    period: float | None = None,
) -> tuple[FunctionWeight, ...]:
    """Weights ``law(distance)`` of edges between agents that move along given paths.

    Parameters
    ----------
    edges : sequence of Edge
        Pairs of agents, counted from 1.
    positions : sequence of callable
        For each agent ``t -> (coordinate, coordinate, ...)`` in numpy style.
    law : callable
        Weight as a function of the distance, in numpy style and continuous, such as ``np.exp(-d**2)``.
    bends : sequence of float
        Distances at which the law has a kink, such as the range of a radio; the times at which an edge passes them are
        found and become kinks of its weight.
    horizon : float
        Time [s] up to which they are looked for; with a period, one period is searched.
    period : float, optional
        Common period of the paths [s].

    Notes
    -----
    The times are bracketed on a grid of 4096 steps, so two passages within one step can escape; the weight is
    continuous there, and an integrator only takes smaller steps.
    """
    return tuple(_distance_weight(positions[i - 1], positions[j - 1], law, bends, horizon, period) for i, j in edges)


def _distance_weight(
    first: Callable[[Any], Sequence[Any]],
    second: Callable[[Any], Sequence[Any]],
    law: Callable[[Any], Any],
    bends: Sequence[float],
    horizon: float,
    period: float | None,
) -> FunctionWeight:
    distance = _Distance(first, second)
    end = period if period is not None else horizon
    kinks = sorted({time for bend in bends for time in _passages(distance, bend, end)})
    return FunctionWeight(_OfDistance(law, distance), tuple(kinks), period)


@dataclass(frozen=True)
class _Distance:
    """Distance of two positions over time; a class, like the next, since functions in functions cannot be pickled."""

    first: Callable[[Any], Sequence[Any]]
    second: Callable[[Any], Sequence[Any]]

    def __call__(self, t: Any) -> Any:
        return np.sqrt(sum((a - b) ** 2 for a, b in zip(self.first(t), self.second(t), strict=True)))


@dataclass(frozen=True)
class _OfDistance:
    """A law of the distance, as a function of time."""

    law: Callable[[Any], Any]
    distance: _Distance

    def __call__(self, t: Any) -> Any:
        return self.law(self.distance(t))


def _passages(distance: TimeFunction, bend: float, end: float) -> list[float]:
    """Times in ``[0, end)`` at which the distance passes `bend`."""
    times = np.linspace(0.0, end, 4097)
    side = distance(times) - bend + np.zeros_like(times)
    exact: list[float] = times[:-1][side[:-1] == 0].tolist()
    changes = np.flatnonzero(side[:-1] * side[1:] < 0)
    return exact + [brentq(lambda t: float(distance(t)) - bend, times[k], times[k + 1], xtol=1e-14) for k in changes]

"""Weights that follow the distance between agents, or the reliability of a link."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hybrid_model.consensus.graphs.undirected import Edge
from hybrid_model.consensus.weights.function import FunctionWeight, TimeFunction

__all__ = ["distance_weights", "reliability_weight"]


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

"""Lower bounds on the time between two broadcasts of one agent: printed, valid, improved (audit, section 6)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

from hybrid_model.consensus.analysis import Analysis
from hybrid_model.consensus.edge_weights import EdgeWeights
from hybrid_model.consensus.scenario_data import WeightKind

__all__ = ["excited_gap", "frozen_gap", "growing_gap", "printed_gap"]

_ACCURACY = 1e-5
_GRID = 4
_FINE = 4001
_CORNERED = (WeightKind.CONSTANT, WeightKind.GATED_SINE)
"""Weights whose integral over a moving interval is largest at or beside their breakpoints."""


def printed_gap(threshold: float, decay: float, speed: float, kappa1: float, kappa2: float) -> float:
    """Solution of ``gamma e^{beta gamma} = c/(k rho omega ||D|| (kappa1 + kappa2))``, as the paper's section 5 ends.

    Parameters
    ----------
    threshold, decay : float
        c and beta [1/s] of the trigger.
    speed : float
        ``k rho omega ||D||`` [1/s].
    kappa1, kappa2 : float
        Of the printed bound. kappa1 is negative as a rule, and then this number is not a lower bound.
    """
    return frozen_gap(threshold, decay, speed * (kappa1 + kappa2))


def frozen_gap(threshold: float, decay: float, speed: float) -> float:
    """Solution g [s] of ``g e^{beta g} = c/K``: the state moves with K e^{-beta t1} throughout the gap.

    Parameters
    ----------
    threshold, decay : float
        c and beta [1/s].
    speed : float
        K, a bound on ``|x_i'(t)| e^{beta t}``.
    """
    if speed <= 0:
        return math.inf
    if decay == 0:
        return threshold / speed
    return float(lambertw(decay * threshold / speed).real) / decay


def growing_gap(threshold: float, decay: float, speed: float) -> float:
    """``ln(1 + beta c/K)/beta`` [s], or ``c/K``: the state moves with ``K e^{-beta t}``; never below `frozen_gap`."""
    if speed <= 0:
        return math.inf
    if decay == 0:
        return threshold / speed
    return math.log1p(decay * threshold / speed) / decay


def excited_gap(
    analysis: Analysis, threshold: float, decay: float, speeds: NDArray[np.float64], agent: int, low: float, high: float
) -> float:
    """Largest g [s] from `low` to `high` for which no window of length g moves the agent by its threshold.

    The agent moves by at most ``sum_e speeds[e] int w_e`` in units of ``e^{-beta t1}``, so a gap from t1 to ``t1 + g``
    needs that sum to reach ``c e^{-beta g}``.

    Parameters
    ----------
    analysis : Analysis
        The scenario.
    threshold, decay : float
        c and beta [1/s].
    speeds : ndarray, shape (m,)
        ``k (H_e + 2 c)`` with ``|x_i - x_j| <= H_e e^{-beta t}`` over edge e.
    agent : int
        Number of the agent, from 1.
    low : float
        A gap [s] that is known to be safe; returned if nothing larger is.
    high : float
        Largest gap [s] of interest, finite.
    """
    network, weights = analysis.scenario.network, analysis.scenario.edge_weights
    rates = np.array([speed if agent in edge else 0.0 for edge, speed in zip(network.edges, speeds, strict=True)])

    def is_safe(gap: float) -> bool:
        return _moved(weights, rates, analysis, gap) < threshold * math.exp(-decay * gap)

    if is_safe(high):
        return high
    while high - low > _ACCURACY * low:
        middle = (low + high) / 2
        low, high = (middle, high) if is_safe(middle) else (low, middle)
    return low


def _moved(weights: EdgeWeights, rates: NDArray[np.float64], analysis: Analysis, length: float) -> float:
    """Supremum over the starts t1 of ``sum rates*int_{t1}^{t1+length} w``."""
    cycle = analysis.cycle
    last = cycle if analysis.is_periodic else max(cycle - length, 0.0)
    corners = np.concatenate(
        ([0.0, last], weights.breakpoints(0.0, last), weights.breakpoints(length, last + length) - length)
    )
    corners = np.unique(np.clip(corners, 0.0, last))
    steps = np.arange(_GRID) / _GRID
    starts = np.append((corners[:-1, None] + np.diff(corners)[:, None] * steps).ravel(), last)
    values = weights.integral(starts, starts + length) @ rates
    # Between two starts the integral follows a parabola: the vertex through the best three lies above the grid.
    best = int(np.argmax(values))
    around = slice(max(best - 1, 0), min(best + 2, len(values)))
    largest = float(values[best] + _vertex_rise(starts[around], values[around]))
    if analysis.scenario.weights.kind in _CORNERED:
        return largest
    # Between the corners of other kinds anything may happen: a fine grid, and the most that lies between its points.
    starts = np.unique(np.append(np.linspace(0.0, last, _FINE), corners))
    steepest = float(rates @ analysis.largest_weights)
    between = 0.5 * steepest * float(np.max(np.diff(starts), initial=0.0))
    return max(largest, float(np.max(weights.integral(starts, starts + length) @ rates)) + between)


def _vertex_rise(t: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """How far the parabola through three points rises above the largest of them; 0.0 if it does not."""
    if len(t) < 3 or np.min(np.diff(t)) <= 0:
        return 0.0
    left, right = (y[1] - y[0]) / (t[1] - t[0]), (y[2] - y[1]) / (t[2] - t[1])
    bend = (right - left) / (t[2] - t[0])
    if bend >= 0:
        return 0.0
    slope = left + bend * (t[1] - t[0])
    return float(max(0.0, -(slope**2) / (4 * bend)))

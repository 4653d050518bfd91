"""The longest gap in which the weights move an agent by less than its threshold (audit, section 6)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.excitation.persistence import window_corners
from hybrid_model.consensus.weights.edge_weights import EdgeWeights

__all__ = ["excited_gap"]

_ACCURACY = 1e-5
_FINE = 4000
_RISE = 1e-4
"""Share of the integral by which the bound between two starts may exceed what is found at the starts."""


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
    steepest = _steepest(analysis, rates)

    def is_safe(gap: float) -> bool:
        level = threshold * math.exp(-decay * gap)
        return _moved(weights, rates, analysis, gap, steepest, level) < level

    if is_safe(high):
        return high
    # Most gaps are far below the longest of interest.
    while 2 * low < high and is_safe(2 * low):
        low *= 2
    high = min(high, 2 * low)
    while high - low > _ACCURACY * low:
        middle = (low + high) / 2
        low, high = (middle, high) if is_safe(middle) else (low, middle)
    return low


def _moved(
    weights: EdgeWeights,
    rates: NDArray[np.float64],
    analysis: Analysis,
    length: float,
    steepest: float | None,
    level: float,
) -> float:
    """Supremum over the starts t1 of ``sum rates*int_{t1}^{t1+length} w``, never too small; or a value above `level`.

    Between two starts h apart, with no corner of a weight between them, the sum rises above the larger of its end
    values by at most ``h^2/8`` times the bound of its second derivative, which is twice that of the slope of the
    weights.
    """
    cycle = analysis.cycle
    last = cycle if analysis.is_periodic else max(cycle - length, 0.0)
    corners = window_corners(weights, last, length)
    largest = float(np.max(weights.integral(corners, corners + length) @ rates))
    if largest >= level or steepest == 0.0 or len(corners) == 1:
        return largest
    if steepest is None:
        # Nothing is known of the slope: the sum itself changes no faster than the largest weights say.
        starts = np.unique(np.append(np.linspace(0.0, last, _FINE), corners))
        between = 0.5 * float(rates @ analysis.largest_weights) * float(np.max(np.diff(starts)))
        return float(np.max(weights.integral(starts, starts + length) @ rates)) + between
    step = max(math.sqrt(4 * _RISE * largest / steepest), last / _FINE)
    counts = np.ceil(np.diff(corners) / step).astype(int)
    inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(corners[:-1], corners[1:], counts, strict=True)]
    starts = np.append(np.concatenate(inner), last)
    rise = steepest / 4 * float(np.max(np.diff(starts))) ** 2
    return float(np.max(weights.integral(starts, starts + length) @ rates)) + rise


def _steepest(analysis: Analysis, rates: NDArray[np.float64]) -> float | None:
    """Bound on ``|sum rates*w'|`` between the corners of the weights; None if a carrier's slope is not known."""
    pieces = analysis.scenario.edge_weights.pieces(0.0, analysis.cycle)
    amplitudes = np.max([piece.amplitudes for piece in pieces], axis=0)
    slopes = [carrier.steepness for carrier in analysis.scenario.edge_weights.carriers]
    if any(slope is None for slope in slopes):
        return None
    return float(np.sum(rates * amplitudes * np.array(slopes, dtype=float)))

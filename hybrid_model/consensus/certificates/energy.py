"""The energy bound on disagreement, and how large the share of the initial state gets (audit, section 5.3)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.excitation.persistence import Signal, scenario_excitation, signal_factor
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence

__all__ = ["energy_radius", "initial_peaks"]

_DOUBLINGS = 10
_LARGEST = 600.0
"""Exponent ``beta T`` that a float still holds."""

_FORGOTTEN = 1e-9
_MOST_CYCLES = 5000

_ASIDE, _FORGOTTEN_BY_MODES, _MOST_TIMES, _COLUMNS = 5e-5, 1e-6, 5000, 500
"""Of constant weights: how far states may leave the chord of a cell, when they are forgotten, cells, and at once."""


def energy_radius(analysis: Analysis, decay: float) -> float | None:
    """Bound on ``limsup exp(beta t) ||x_e(t)||`` for the threshold ``exp(-beta t)``; None if it does not exist.

    ``edge_gain c_n sqrt(k nubar/2) e^{beta T} sqrt(1 - q)/(1 - e^{beta T} sqrt q)`` with the exact contraction q over
    T, or ``q = 1 - gamma*`` if the weights have no period or the exact q would take too long. T is the cycle or a
    multiple that serves better: the exact q over many cycles falls at the Floquet rate, however slowly it begins.

    With beta > 0 a long window costs ``e^{beta T}``. There the windows are bounded one by one instead: the j-th one
    back lets through ``e^{beta (j + 1) T} sqrt(k nubar/2) sup ||phi(t, t - j T)||``, because ``a_j - a_{j+1} <= a_j``.
    The norms for j that are no power of two are bounded by products, so the sum over j < 2^b is ``prod (1 + x_i)`` over
    i < b with ``x_i = e^{beta T 2^i} sup ||phi(t, t - 2^i T)||``, and the rest is geometric with the ratio x_b.

    Parameters
    ----------
    analysis : Analysis
        The scenario.
    decay : float
        beta [1/s].
    """
    window, nubar, contraction = _cycle_constants(analysis)
    strength, series, best = analysis.scenario.network.gain * nubar / 2, 1.0, math.inf
    first = contraction(1)
    for doubling in range(_DOUBLINGS):
        count = 2**doubling
        growth = decay * window * count
        least = math.log(strength * count * (1 - first**2)) / 2 + growth if first < 1 and strength > 0 else -math.inf
        if growth > _LARGEST or (least >= math.log(best) and series >= best):
            break
        root = contraction(count)
        share = math.exp(growth + math.log(root)) if root > 0 else 0.0
        if share < 1:
            # 1 - q from its logarithm: q is close to 1 for short windows.
            lost = -math.expm1(2 * math.log(root)) if root > 0 else 1.0
            whole = math.sqrt(strength * count * lost) * math.exp(growth) / (1 - share)
            # Every window for itself: each of the first `count` by the roots of the powers of two that make it up.
            single = math.sqrt(strength) * math.exp(decay * window) * series / (1 - share)
            best = min(best, whole, single)
            if share < np.finfo(float).eps:
                break  # the next share is no larger than the square of this one, and longer windows cost more
        series *= 1 + share
    return analysis.edge_gain * analysis.box_gain * best if math.isfinite(best) else None


def _cycle_constants(analysis: Analysis) -> tuple[float, float, Callable[[int], float]]:
    """T, ``sup int ||N||`` over T, and the square root of q over multiples of T."""
    if not analysis.has_exact_contraction:
        window, root = analysis.window, math.sqrt(1 - analysis.improved_contraction)
        return window, analysis.disagreement.mu2_bar, lambda count: root**count
    if analysis.is_constant and analysis.spectrum is not None:
        window, rate = analysis.window, analysis.spectrum.rate
        return window, analysis.disagreement.mu2_bar, lambda count: math.exp(-rate * window * count)
    if analysis.window == analysis.cycle:
        return analysis.cycle, analysis.disagreement.mu2_bar, analysis.contraction
    over_cycle = scenario_excitation(analysis.scenario, Signal.DISAGREEMENT, window=analysis.cycle)
    return analysis.cycle, over_cycle.mu2_bar, analysis.contraction


def initial_peaks(analysis: Analysis, decay: float) -> tuple[float, NDArray[np.float64]]:
    """Suprema over t >= 0 of ``exp(beta t) ||x_e(t)||`` and ``exp(beta t) |x_i - x_j|`` without trigger errors.

    Returns
    -------
    norm : float
        Over the underlying graph.
    pairs : ndarray, shape (m,)
        For each listed edge.

    Notes
    -----
    The suprema are over the ends of short cells, and what may lie between is added. Over a cell with
    ``k int ||N|| <= d`` the state leaves one of its end values by at most ``d/2 ||xi||``; if all weights have one
    shape, it leaves the straight line between them by at most ``d^2/8 ||xi||``. Large networks are followed without
    matrices of the flow, see `hybrid_model.consensus.exact.free_motion`.
    """
    if analysis.is_large:
        return _large_initial_peaks(analysis, decay)
    network, cells = analysis.scenario.network, analysis.cells
    basis = disagreement_basis(network.agents)
    edges = basis.T @ np.hstack([incidence(network.agents, e) for e in (network.edges, network.underlying_edges)])
    listed = len(network.edges)
    lengths = np.where(cells.is_idle, 0.0, np.diff(cells.times))
    aside = _between_ends(analysis)
    longer = math.exp(decay * float(np.max(lengths)))
    path, state = np.empty((len(cells.flows) + 1, basis.shape[1])), analysis.initial_disagreement
    pairs, norm, start, least = np.zeros(listed), 0.0, 0.0, _FORGOTTEN * float(np.linalg.norm(state))
    for _ in range(_MOST_CYCLES):
        path[0] = state
        for j, flow in enumerate(cells.flows):
            path[j + 1] = flow @ path[j]
        growth = np.exp(decay * (start + cells.times))
        # A cell adds to both its ends what it may hold above them.
        inside = (longer * (1 + aside) - 1) * np.linalg.norm(path[:-1], axis=1) * growth[:-1]
        sizes = np.maximum(np.append(inside, 0.0), np.append(0.0, inside))
        values = np.abs(path @ edges) * growth[:, None]
        pairs = np.maximum(pairs, np.max(values[:, :listed] + math.sqrt(2.0) * sizes[:, None], axis=0))
        norms = np.linalg.norm(values[:, listed:], axis=1)
        norm = max(norm, float(np.max(norms + analysis.edge_gain * sizes)))
        state, start = path[-1], start + float(cells.times[-1])
        rest = float(np.linalg.norm(state)) * math.exp(decay * (start + float(cells.times[-1])))
        if rest <= least or not analysis.is_periodic:
            break
    return max(norm, analysis.edge_gain * rest), np.maximum(pairs, math.sqrt(2.0) * rest)


def _large_initial_peaks(analysis: Analysis, decay: float) -> tuple[float, NDArray[np.float64]]:
    """`initial_peaks` of large networks."""
    if analysis.is_constant:
        return _peaks_of_constants(analysis, decay)
    motion, state = analysis.motion, np.asarray(analysis.scenario.network.initial)
    mean = float(np.mean(state))
    alike = len(set(analysis.scenario.edge_weights.carriers)) == 1
    aside = np.minimum(motion.doses**2 / 8 if alike else motion.doses / 2, 1.0)
    peaks, start, least = _Peaks(analysis), 0.0, _FORGOTTEN * float(np.linalg.norm(state - mean))
    for _ in range(_MOST_CYCLES):
        path = motion.path(state).T
        sizes = aside * np.linalg.norm(path[:, :-1] - mean, axis=0)
        rest = peaks.take(path, start + motion.times, sizes, decay)
        state, start = path[:, -1], start + float(motion.times[-1])
        if rest <= least or peaks.are_above(rest) or not analysis.is_periodic:
            break
    return peaks.above(rest)


def _peaks_of_constants(analysis: Analysis, decay: float) -> tuple[float, NDArray[np.float64]]:
    motion, peaks = analysis.constant_motion, _Peaks(analysis)
    times, aside = motion.grid(decay, _ASIDE, _FORGOTTEN_BY_MODES, _MOST_TIMES)
    rest = 0.0
    # Not all at once: a block of columns each.
    for first in range(0, len(aside), _COLUMNS):
        last = min(first + _COLUMNS, len(aside))
        rest = peaks.take(motion.states(times[first : last + 1]), times[first : last + 1], aside[first:last], decay)
    return peaks.above(rest)


class _Peaks:
    """Largest ``exp(beta t) ||x_e||`` and ``exp(beta t) |x_i - x_j|`` of states at ends of cells, and between them."""

    def __init__(self, analysis: Analysis) -> None:
        network = analysis.scenario.network
        self._listed, self._all = (np.asarray(edges) - 1 for edges in (network.edges, network.underlying_edges))
        self._same = network.edges == network.underlying_edges
        self._gain = analysis.edge_gain
        self.norm, self.pairs = 0.0, np.zeros(len(network.edges))

    def take(
        self, path: NDArray[np.float64], times: NDArray[np.float64], aside: NDArray[np.float64], decay: float
    ) -> float:
        """Take states, shape (n, cells + 1), which leave the chord of each cell by at most `aside`.

        Returns ``exp(beta t) ||x - mean||`` at the end.
        """
        growth = np.exp(decay * times)
        # Within a cell: what lies above the ends, and the factor at its end in place of that at its beginning.
        rise = np.append(np.exp(decay * np.diff(times)), 1.0)
        between = np.append(aside, 0.0)
        listed = path[self._listed[:, 1]] - path[self._listed[:, 0]]
        underlying = listed if self._same else path[self._all[:, 1]] - path[self._all[:, 0]]
        norms = np.linalg.norm(underlying, axis=0)

        def largest(values: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
            ends = np.maximum(values, np.hstack([values[:, 1:], values[:, -1:]]))
            return np.asarray(np.max((ends + factor * between) * rise * growth, axis=1))

        self.pairs = np.maximum(self.pairs, largest(np.abs(listed), math.sqrt(2.0)))
        self.norm = max(self.norm, float(largest(norms[None, :], self._gain)[0]))
        return float(np.linalg.norm(path[:, -1] - path[:, -1].mean()) * growth[-1])

    def are_above(self, rest: float) -> bool:
        """Whether nothing that comes later can exceed them: with beta at most the rate, `rest` only falls."""
        return self._gain * rest <= self.norm and math.sqrt(2.0) * rest <= float(np.min(self.pairs))

    def above(self, rest: float) -> tuple[float, NDArray[np.float64]]:
        """The peaks, where what comes later is below `rest`."""
        return max(self.norm, self._gain * rest), np.maximum(self.pairs, math.sqrt(2.0) * rest)


def _between_ends(analysis: Analysis) -> NDArray[np.float64]:
    """How far the state leaves its values at the ends of each cell, per ``||xi||`` at its beginning."""
    factor, cells = signal_factor(analysis.scenario, Signal.DISAGREEMENT), analysis.cells
    matrices = (factor * cells.doses[:, None, :]) @ factor.T
    doses = analysis.scenario.network.gain * np.linalg.eigvalsh(matrices)[:, -1]
    alike = len(set(analysis.scenario.edge_weights.carriers)) == 1
    return np.asarray(np.minimum(doses**2 / 8 if alike else doses / 2, 1.0))

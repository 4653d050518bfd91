"""Persistence of excitation: the constants (mu1, mu2, T) of a network's weights (paper, definition 1).

All signals of interest have the form ``S(t) = F diag(w(t)) F^T`` with a constant factor F, so the integral over a
window follows from the exact integrals of the weights. What is left is a search over the starts of the windows.
"""

import enum
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.excitation.norm_integral import NormPrimitive
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.edge_weights import EdgeWeights

__all__ = [
    "ExcitationConstants",
    "Signal",
    "WindowExtremes",
    "excitation_constants",
    "excitation_horizon",
    "scenario_excitation",
    "signal_factor",
    "window_corners",
    "window_extremes",
]

_POINTS_PER_PIECE = 8
_REFINED_PEAKS = 3
_ZOOMS = 9


class Signal(enum.Enum):
    """The matrices whose excitation the convergence results use (paper, section 3; audit, section 1)."""

    TREE_WEIGHTS = "W_tau"
    TREE_COORDINATES = "M"
    DISAGREEMENT = "N"


@dataclass(frozen=True, kw_only=True)
class WindowExtremes:
    """Extremes of the integrals ``int_t^{t+T} S`` of a positive semidefinite signal over all windows of one length.

    Parameters
    ----------
    window : float
        T [s].
    mu1, mu2 : float
        Smallest and largest eigenvalue over all t (paper, definition 1, read as in audit section 2).
    frobenius : float
        ``sup_t ||int_t^{t+T} S||_F`` (audit, section 3).
    horizon : float or None
        None if the weights are periodic and all windows of all time are meant; otherwise the constants are those of the
        windows inside ``[0, horizon]`` [s] and say nothing about later ones.
    """

    window: float
    mu1: float
    mu2: float
    frobenius: float
    horizon: float | None = None


@dataclass(frozen=True, kw_only=True)
class ExcitationConstants(WindowExtremes):
    """The same with the integrated norm.

    Parameters
    ----------
    mu2_bar : float
        ``sup_t int_t^{t+T} ||S||``, at least mu2 (audit, section 5.1).
    """

    mu2_bar: float


def signal_factor(scenario: Scenario, signal: Signal, partition: TreePartition | None = None) -> NDArray[np.float64]:
    """The factor F of ``S = F diag(w) F^T``, shape (r, m) for the m listed edges.

    Parameters
    ----------
    scenario : Scenario
        The network; edges of its underlying graph that are not listed carry no weight.
    signal : Signal
        Which S.
    partition : TreePartition, optional
        The spanning tree of the underlying graph; by default its first one in edge order. DISAGREEMENT needs none.
    """
    network = scenario.network
    listed = len(network.edges)
    if signal is Signal.DISAGREEMENT:
        return np.asarray(disagreement_basis(network.agents).T @ incidence(network.agents, network.edges))
    tree = partition if partition is not None else TreePartition(network.agents, network.underlying_edges)
    if signal is Signal.TREE_WEIGHTS:
        return np.eye(len(tree.edges))[np.asarray(tree.tree) - 1, :listed]
    return np.asarray(tree.Gamma.T @ tree.R_by_edge[:, :listed])


def scenario_excitation(
    scenario: Scenario, signal: Signal, partition: TreePartition | None = None, window: float | None = None
) -> ExcitationConstants:
    """`excitation_constants` of one signal of a scenario, along the tree of `partition`; `window` and errors as there.

    Without a period the constants are those of the windows inside the run, as their `horizon` says.
    """
    return excitation_constants(
        signal_factor(scenario, signal, partition), scenario.edge_weights, window, excitation_horizon(scenario)
    )


def excitation_horizon(scenario: Scenario) -> float | None:
    """None if the weights of a scenario have a period, else its stop time [s]."""
    return scenario.stop_time if scenario.edge_weights.period is None else None


def excitation_constants(
    factor: NDArray[np.float64], weights: EdgeWeights, window: float | None = None, horizon: float | None = None
) -> ExcitationConstants:
    """Constants of ``S(t) = F diag(w(t)) F^T`` over all windows of length `window`.

    Parameters
    ----------
    factor : ndarray, shape (r, m)
        F.
    weights : EdgeWeights
        The weights.
    window : float, optional
        T [s]; by default the period of the weights.
    horizon : float, optional
        For weights without a period: windows inside ``[0, horizon]`` [s] only.

    Raises
    ------
    ValueError
        If the weights have no period and no horizon is given, the window is not positive or longer than the horizon, or
        no window is given for weights without a period or constant ones.

    Notes
    -----
    Every window integral is exact (closed forms); only `mu2_bar` uses quadrature, on pieces where weights of different
    shape overlap, to about ten digits. If the window is a multiple of the period, no search is needed. Otherwise the
    starts are searched on a grid that holds all points where a window's end meets a breakpoint and at least eight for
    each half wave of the fastest carrier, and the best grid cells are refined. For weights that are constant on pieces
    the extremes of mu1 and mu2 lie at such points (the smallest eigenvalue is concave, the largest one and the norm
    convex in a window's start between them) and are exact. For others a narrower extremum between two grid points can
    escape by at most the grid step times ``sup ||S||``.
    """
    length, starts = _windows(weights, window, horizon)
    extremes = _extremes(factor, weights, length, starts)
    norm = NormPrimitive(factor, weights, float(starts[0]), float(starts[-1]) + length)
    bar = _largest(lambda at: norm(at + length) - norm(at), starts, refine=not _is_level(weights))
    return ExcitationConstants(window=length, mu2_bar=bar, horizon=_said(weights, horizon), **extremes)


def window_extremes(
    factor: NDArray[np.float64], weights: EdgeWeights, window: float | None = None, horizon: float | None = None
) -> WindowExtremes:
    """`excitation_constants` without the integrated norm, which takes most of the time; all else as there."""
    length, starts = _windows(weights, window, horizon)
    return WindowExtremes(window=length, horizon=_said(weights, horizon), **_extremes(factor, weights, length, starts))


def _extremes(
    factor: NDArray[np.float64], weights: EdgeWeights, length: float, starts: NDArray[np.float64]
) -> dict[str, float]:
    primitive = weights.primitive(float(starts[0]), float(starts[-1]) + length)

    def integrals(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((factor * (primitive(at + length) - primitive(at))[:, None, :]) @ factor.T)

    refine = not _is_level(weights)
    return {
        "mu1": max(0.0, -_largest(lambda at: -np.linalg.eigvalsh(integrals(at))[:, 0], starts, refine=refine)),
        "mu2": _largest(lambda at: np.linalg.eigvalsh(integrals(at))[:, -1], starts, refine=refine),
        "frobenius": _largest(lambda at: np.linalg.norm(integrals(at), axis=(1, 2)), starts, refine=refine),
    }


def _said(weights: EdgeWeights, horizon: float | None) -> float | None:
    return horizon if weights.period is None else None


def _windows(weights: EdgeWeights, window: float | None, horizon: float | None) -> tuple[float, NDArray[np.float64]]:
    """Length of the windows [s] and the starts to try."""
    period = weights.period
    if period is None and horizon is None:
        raise ValueError(
            "the weights have no common period, so the windows to search do not repeat; choose rates and a dwell time "
            "whose quotients are simple fractions, or give a horizon up to which the constants are to hold."
        )
    if window is None and not period:
        if period == 0.0:
            raise ValueError("the weights are constant, so every window length will do; say which one to use.")
        raise ValueError("the weights have no period, so no window length is the natural one; say which one to use.")
    length = window if window is not None else period or 0.0
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"window is {length}; it must be a positive, finite number of seconds.")
    if period is not None:
        return length, _window_starts(weights, 0.0 if _is_multiple(length, period) else period, length)
    last = (horizon or 0.0) - length
    if last < 0:
        raise ValueError(f"window is {length}, longer than the horizon of {horizon} s; choose a shorter one.")
    return length, _window_starts(weights, last, length)


def _is_multiple(length: float, period: float) -> bool:
    cycles = length / period if period > 0 else 1.0
    return abs(cycles - round(cycles)) < 1e-12 * cycles


def _window_starts(weights: EdgeWeights, last: float, length: float) -> NDArray[np.float64]:
    """Starts to try from 0 to `last`, ascending: a grid with all points where a window's end meets a breakpoint."""
    if last <= 0:
        return np.zeros(1)
    corners = window_corners(weights, last, length)
    if _is_level(weights):
        return corners
    # A cell holds half an oscillation of the fastest carrier at most, and eight steps at least.
    fastest = max(carrier.rate for carrier in weights.carriers)
    counts = np.maximum(np.ceil(np.diff(corners) * fastest / np.pi), 1.0).astype(int) * _POINTS_PER_PIECE
    inner = [np.linspace(a, b, count + 1)[:-1] for (a, b), count in zip(pairwise(corners), counts, strict=True)]
    return np.append(np.concatenate(inner), last)


def window_corners(weights: EdgeWeights, last: float, length: float) -> NDArray[np.float64]:
    """Starts from 0 to `last` [s] at which an end of a window of that length meets a breakpoint, and both ends."""
    corners = np.concatenate(
        ([0.0, last], weights.breakpoints(0.0, last), weights.breakpoints(length, last + length) - length)
    )
    return np.unique(np.clip(corners, 0.0, last))


def _is_level(weights: EdgeWeights) -> bool:
    """Whether all weights are constant on pieces: then every extremum lies where a window's end meets a breakpoint."""
    return all(isinstance(carrier, UnitCarrier) for carrier in weights.carriers)


def _largest(
    function: Callable[[NDArray[np.float64]], NDArray[np.floating[Any]]], starts: NDArray[np.float64], *, refine: bool
) -> float:
    """Supremum of `function` over the range of `starts`: the best peaks of the grid, refined between their neighbours.

    A peak is refined by grids of 17 points that shrink eightfold around their best one.
    """
    values = np.asarray(function(starts), dtype=float)
    best = float(values.max())
    if len(starts) == 1 or not refine:
        return best
    padded = np.concatenate(([-np.inf], values, [-np.inf]))
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    for peak in peaks[np.argsort(-values[peaks], kind="stable")][:_REFINED_PEAKS].tolist():
        low, high = starts[max(peak - 1, 0)], starts[min(peak + 1, len(starts) - 1)]
        for _ in range(_ZOOMS):
            at = np.linspace(low, high, 17)
            values = np.asarray(function(at), dtype=float)
            place = int(values.argmax())
            best = max(best, float(values[place]))
            low, high = at[max(place - 1, 0)], at[min(place + 1, 16)]
    return best

"""Persistence of excitation: the constants (mu1, mu2, T) of a network's weights.

All signals of interest have the form ``S(t) = F diag(w(t)) F^T`` with a constant factor F, so the integral over a
window follows from the exact integrals of the weights. What is left is a search over the starts of the windows.
"""

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from hybrid_model.consensus.edge_weights import EdgeWeights
from hybrid_model.consensus.graphs import disagreement_basis, incidence
from hybrid_model.consensus.norm_integral import NormPrimitive
from hybrid_model.consensus.scenario_data import Scenario
from hybrid_model.consensus.spanning_trees import TreePartition

__all__ = ["ExcitationConstants", "Signal", "excitation_constants", "scenario_excitation", "signal_factor"]

_POINTS_PER_PIECE = 8


class Signal(enum.Enum):
    """The matrices whose excitation the convergence results use (paper, section 3; audit, section 1)."""

    TREE_WEIGHTS = "W_tau"
    TREE_COORDINATES = "M"
    DISAGREEMENT = "N"


@dataclass(frozen=True)
class ExcitationConstants:
    """Excitation of a positive semidefinite signal S(t) over all windows of one length.

    Parameters
    ----------
    window : float
        T [s].
    mu1, mu2 : float
        Smallest and largest eigenvalue of ``int_t^{t+T} S`` over all t (paper,
        definition 1, read as in audit section 2).
    mu2_bar : float
        ``sup_t int_t^{t+T} ||S||``, at least mu2 (audit, section 5.1).
    frobenius : float
        ``sup_t ||int_t^{t+T} S||_F`` (audit, section 3).
    """

    window: float
    mu1: float
    mu2: float
    mu2_bar: float
    frobenius: float


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
    """`excitation_constants` of one signal of a scenario; see there for `window` and the errors."""
    return excitation_constants(signal_factor(scenario, signal, partition), scenario.edge_weights, window)


def excitation_constants(
    factor: NDArray[np.float64], weights: EdgeWeights, window: float | None = None
) -> ExcitationConstants:
    """Constants of ``S(t) = F diag(w(t)) F^T`` over all windows of length `window`.

    Parameters
    ----------
    factor : ndarray, shape (r, m)
        F.
    weights : EdgeWeights
        Periodic or constant weights.
    window : float, optional
        T [s]; by default the period of the weights.

    Raises
    ------
    ValueError
        If the weights are not periodic, the window is not positive, or none is given for constant weights.

    Notes
    -----
    Every window integral is exact (closed forms); only `mu2_bar` uses quadrature, on pieces where weights of different
    shape overlap, to about ten digits. If the window is a multiple of the period, no search is needed. Otherwise the
    starts are searched on a grid that holds all points where a window's end meets a breakpoint, and the best grid cell
    is refined. A narrower extremum between two grid points can escape by at most the grid step times ``sup ||S||``.
    """
    period = weights.period
    if period is None:
        raise ValueError(
            "the weights have no common period, so the windows to search do not repeat; "
            "choose rates and a dwell time whose quotients are simple fractions."
        )
    if window is None and period == 0.0:
        raise ValueError("the weights are constant, so every window length will do; say which one to use.")
    length = period if window is None else window
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"window is {length}; it must be a positive, finite number of seconds.")

    starts = _window_starts(weights, period, length)
    norm = NormPrimitive(factor, weights, 0.0, starts[-1] + length)

    def integrals(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((factor * weights.integral(at, at + length)[:, None, :]) @ factor.T)

    return ExcitationConstants(
        window=length,
        mu1=max(0.0, -_largest(lambda at: -np.linalg.eigvalsh(integrals(at))[:, 0], starts)),
        mu2=_largest(lambda at: np.linalg.eigvalsh(integrals(at))[:, -1], starts),
        mu2_bar=_largest(lambda at: norm(at + length) - norm(at), starts),
        frobenius=_largest(lambda at: np.linalg.norm(integrals(at), axis=(1, 2)), starts),
    )


def _window_starts(weights: EdgeWeights, period: float, length: float) -> NDArray[np.float64]:
    """Starts to try, ascending: one if all windows are alike, else a grid over one period with all corners."""
    cycles = length / period if period > 0 else 1.0
    if abs(cycles - round(cycles)) < 1e-12 * cycles:
        return np.zeros(1)
    corners = np.concatenate(
        ([0.0, period], weights.breakpoints(0.0, period), weights.breakpoints(length, length + period) - length)
    )
    corners = np.unique(corners)
    steps = np.arange(_POINTS_PER_PIECE) / _POINTS_PER_PIECE
    inner = corners[:-1, None] + np.diff(corners)[:, None] * steps
    return np.append(inner.ravel(), period)


def _largest(
    function: Callable[[NDArray[np.float64]], NDArray[np.floating[Any]]], starts: NDArray[np.float64]
) -> float:
    """Supremum of `function` over the range of `starts`: the best start, refined within its two neighbours."""
    values = function(starts)
    best = int(np.argmax(values))
    if len(starts) == 1:
        return float(values[0])
    low, high = starts[max(best - 1, 0)], starts[min(best + 1, len(starts) - 1)]
    refined = minimize_scalar(
        lambda at: -float(function(np.array([at]))[0]), bounds=(low, high), method="bounded", options={"xatol": 1e-12}
    )
    return max(float(values[best]), -float(refined.fun))

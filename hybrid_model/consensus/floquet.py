"""Exact rate of the undisturbed dynamics ``xi' = -k N(t) xi`` with periodic weights, by Floquet's theorem."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hybrid_model.consensus.edge_weights import Piece
from hybrid_model.consensus.excitation import Signal, signal_factor
from hybrid_model.consensus.scenario_data import Scenario

__all__ = ["FloquetSpectrum", "floquet_spectrum", "transition_matrix"]


@dataclass(frozen=True)
class FloquetSpectrum:
    """Floquet multipliers and the rate that follows from them.

    Parameters
    ----------
    period : float
        P [s].
    multipliers : ndarray, shape (n - 1,)
        Eigenvalues of the monodromy matrix, largest modulus first; complex in general.
    rate : float
        ``-ln(max |multiplier|)/P`` [1/s]: the exact exponential rate of convergence to consensus.
    """

    period: float
    multipliers: NDArray[np.complex128]
    rate: float


def floquet_spectrum(scenario: Scenario) -> FloquetSpectrum:
    """Floquet multipliers of the network without trigger errors, in the disagreement coordinates of audit section 1.

    Raises
    ------
    ValueError
        If the weights are not periodic.
    """
    period = scenario.edge_weights.period
    if period is None:
        raise ValueError(
            "the weights have no common period, so there is no monodromy matrix; "
            "choose rates and a dwell time whose quotients are simple fractions."
        )
    if period == 0.0:
        # Every number is a period of a constant: take one second. The rate is an eigenvalue, however small e^{-rate}.
        factor, weights = signal_factor(scenario, Signal.DISAGREEMENT), scenario.edge_weights.value(0.0)
        rates = scenario.network.gain * np.maximum(np.linalg.eigvalsh((factor * weights) @ factor.T), 0.0)
        return FloquetSpectrum(1.0, np.exp(-rates).astype(complex), float(rates[0]))
    multipliers = np.linalg.eigvals(transition_matrix(scenario, 0.0, period)).astype(complex)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    # A multiplier below the smallest float counts as that: the rate is then a lower bound.
    largest = max(float(np.abs(multipliers[0])), float(np.finfo(float).tiny))
    return FloquetSpectrum(period, multipliers, -float(np.log(largest)) / period)


def transition_matrix(scenario: Scenario, t0: float, t1: float) -> NDArray[np.float64]:
    """The matrix, shape (n - 1, n - 1), that maps ``xi(t0)`` to ``xi(t1)``; times in seconds.

    Notes
    -----
    On a piece whose active edges share a carrier s(t), N(t) is s(t) times a constant matrix and the flow is its matrix
    exponential, exact up to rounding (audit, section 7). Elsewhere the piece is integrated numerically to a relative
    tolerance of 1e-12.
    """
    factor = signal_factor(scenario, Signal.DISAGREEMENT)
    gain = scenario.network.gain
    flow = np.eye(factor.shape[0])
    for piece in scenario.edge_weights.pieces(t0, t1):
        if not piece.is_idle:
            flow = _piece_flow(gain, factor, piece) @ flow
    return flow


def _piece_flow(gain: float, factor: NDArray[np.float64], piece: Piece) -> NDArray[np.float64]:
    carrier = piece.shared_carrier
    if carrier is None:
        return _integrated_flow(gain, factor, piece)
    eigenvalues, vectors = np.linalg.eigh((factor * piece.amplitudes) @ factor.T)
    decay = np.exp(-gain * float(carrier.integral(piece.start, piece.end)) * eigenvalues)
    return np.asarray((vectors * decay) @ vectors.T)


def _integrated_flow(gain: float, factor: NDArray[np.float64], piece: Piece) -> NDArray[np.float64]:
    size = factor.shape[0]

    def derivative(t: float, flow: NDArray[np.float64]) -> NDArray[np.float64]:
        weights = piece.amplitudes * np.array([float(carrier.value(t)) for carrier in piece.carriers])
        return np.asarray(-gain * ((factor * weights) @ (factor.T @ flow.reshape(size, size)))).ravel()

    # The carriers are those of this piece throughout, so the integrator never sees a jump at its ends.
    solution = solve_ivp(
        derivative, (piece.start, piece.end), np.eye(size).ravel(), method="DOP853", rtol=1e-12, atol=1e-14
    )
    if not solution.success:
        raise ValueError(f"the flow from {piece.start} s to {piece.end} s cannot be integrated: {solution.message}")
    return np.asarray(solution.y[:, -1].reshape(size, size))

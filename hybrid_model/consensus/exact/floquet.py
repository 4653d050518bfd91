"""Exact rate of the undisturbed dynamics ``xi' = -k N(t) xi`` with periodic weights, by Floquet's theorem."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hybrid_model.consensus.exact.transition_grid import affordable_resolution, joined_flows, transition_grid
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.edge_weights import Piece

__all__ = ["FloquetSpectrum", "floquet_spectrum", "transition_matrix"]

_LOST = 1e-5
"""A largest multiplier below this has lost digits: the monodromy matrix is known to about 1e-14 absolutely."""

_CELL = 0.02
_MOST_CELLS = 6000
_MILD = 1.0
"""``k int ||N||`` over flows that are multiplied as they are: each then loses no more than a digit."""

_SWEEPS = 60
_SETTLED = 1e-12


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
    is_scaled : bool
        Whether the period is so long that the monodromy matrix itself would be made of rounding. The multipliers, which
        may underflow, and the rate, which does not, then come from a product that is scaled on the way.
    """

    period: float
    multipliers: NDArray[np.complex128]
    rate: float
    is_scaled: bool = False


def floquet_spectrum(scenario: Scenario) -> FloquetSpectrum:
    """Floquet multipliers of a `scenario` without trigger errors, in the disagreement coordinates of audit section 1.

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
    multipliers = _sorted(np.linalg.eigvals(transition_matrix(scenario, 0.0, period)))
    largest = float(np.abs(multipliers[0]))
    if largest < _LOST:
        return _scaled_spectrum(scenario, period)
    return FloquetSpectrum(period, multipliers, -float(np.log(largest)) / period)


def _sorted(multipliers: NDArray[Any]) -> NDArray[np.complex128]:
    return multipliers.astype(complex)[np.argsort(-np.abs(multipliers))]


def _scaled_spectrum(scenario: Scenario, period: float) -> FloquetSpectrum:
    """The spectrum of a period that forgets almost everything, by orthogonal iteration over the period.

    Each flow over a cell, which forgets little, is multiplied to an orthogonal basis and factored into a new basis Q
    and a triangle R. The product of the triangles, scaled, keeps relative digits of directions that decay at different
    times; with the turn of the basis over the period it is similar to the monodromy matrix.

    Where every direction is forgotten in a part of the period in which another one is kept, rounding of a share 1e-16
    feeds the kept one. If that alone outlives the period, the rate comes out too small, never too large.
    """
    resolution = affordable_resolution(scenario, 0.0, period, _CELL, _MOST_CELLS)
    flows = joined_flows(transition_grid(scenario, 0.0, period, resolution).flows, max(1, int(_MILD / resolution)))
    basis, known = np.eye(flows.shape[1]), math.inf
    for _ in range(_SWEEPS):
        start, triangle, logarithm = basis, np.eye(len(basis)), 0.0
        for flow in flows:
            basis, step = np.linalg.qr(flow @ basis)
            triangle = step @ triangle
            size = float(np.max(np.abs(triangle)))
            triangle, logarithm = triangle / size, logarithm + math.log(size)
        scaled = _sorted(np.linalg.eigvals(start.T @ basis @ triangle))
        exponent = logarithm + math.log(float(np.abs(scaled[0])))
        if abs(exponent - known) <= _SETTLED * abs(exponent):
            break
        known = exponent
    return FloquetSpectrum(period, scaled * math.exp(max(logarithm, -745.0)), -exponent / period, is_scaled=True)


def transition_matrix(scenario: Scenario, t0: float, t1: float) -> NDArray[np.float64]:
    """The matrix, shape (n - 1, n - 1), that maps ``xi(t0)`` to ``xi(t1)``; times in seconds.

    Notes
    -----
    On a piece whose active edges share a carrier s(t), N(t) is s(t) times a constant matrix and the flow is its matrix
    exponential, exact up to rounding (audit, section 7). Elsewhere the piece is integrated numerically to a relative
    tolerance of 1e-12; entries below about 1e-10 keep fewer digits.
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

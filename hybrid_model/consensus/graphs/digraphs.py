"""Directed graphs whose weights balance: consensus on the average without symmetry (audit, section 11.9).

``A[i, j]`` is the weight with which agent i listens to agent j, and ``L = diag(A 1) - A``. If every agent gives as much
weight as it takes, ``1^T L = 0``, the mean is conserved as with undirected edges. The disagreement
``V = ||x - mean(x) 1||^2/2`` then falls at the rate ``k xi^T S xi`` with the symmetric part S of L, so excitation of S
is what counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from hybrid_model.consensus.graphs.undirected import disagreement_basis

__all__ = [
    "BalancedSwitching",
    "DirectedContraction",
    "directed_contraction",
    "directed_laplacian",
    "is_weight_balanced",
    "symmetric_part",
]

_BALANCE = 1e-12
"""Share of the largest degree by which what an agent gives and takes may differ (rounding)."""


def directed_laplacian(adjacency: ArrayLike) -> NDArray[np.float64]:
    """``L = diag(A 1) - A``, shape (n, n), of the weights ``A[i, j] >= 0`` with which i listens to j.

    Raises
    ------
    ValueError
        If the matrix is not square, an entry is negative or not finite, or an agent listens to itself.
    """
    A = np.asarray(adjacency, dtype=float)
    if A.ndim != 2 or A.shape[0] != A.shape[1]:
        raise ValueError(f"the adjacency matrix has the shape {A.shape}; it must be square.")
    bad = np.argwhere(~(np.isfinite(A) & (A >= 0)))
    if bad.size:
        i, j = bad[0]
        raise ValueError(f"entry ({i + 1}, {j + 1}) is {A[i, j]}; weights must be finite and not negative.")
    if np.any(np.diag(A)):
        raise ValueError(f"agent {np.flatnonzero(np.diag(A))[0] + 1} listens to itself; the diagonal must be zero.")
    return np.asarray(np.diag(A.sum(axis=1)) - A)


def is_weight_balanced(adjacency: ArrayLike) -> bool:
    """Whether every agent gives as much weight as it takes, up to rounding: ``1^T L = 0``."""
    L = directed_laplacian(adjacency)
    return bool(np.max(np.abs(L.sum(axis=0))) <= _BALANCE * max(float(np.max(np.diag(L))), 1e-300))


def symmetric_part(adjacency: ArrayLike) -> NDArray[np.float64]:
    """``S = U^T (L + L^T)/2 U``, shape (n - 1, n - 1), positive semidefinite for balanced weights.

    Raises
    ------
    ValueError
        As `directed_laplacian`, and if the weights do not balance: then S may have negative eigenvalues.
    """
    L = directed_laplacian(adjacency)
    if not is_weight_balanced(adjacency):
        gap = L.sum(axis=0)
        agent = int(np.argmax(np.abs(gap)))
        raise ValueError(
            f"the weights do not balance: agent {agent + 1} takes {L[agent, agent]:.6g} and gives "
            f"{L[agent, agent] - gap[agent]:.6g}; make both sums equal for every agent."
        )
    U = disagreement_basis(len(L))
    return np.asarray(U.T @ (L + L.T) @ U / 2)


@dataclass(frozen=True)
class DirectedContraction:
    """What a window of length T does to the disagreement, at least.

    Attributes
    ----------
    window : float
        T [s].
    mu1 : float
        Smallest eigenvalue of ``int S`` over the window.
    squared : float
        q with ``||xi(t + T)||^2 <= q ||xi(t)||^2``; 1.0 without excitation.
    rate : float
        ``-ln(q)/(2 T)`` [1/s].
    """

    window: float
    mu1: float
    squared: float
    rate: float


def directed_contraction(mu1: float, trace: float, degree: float, gain: float, window: float) -> DirectedContraction:
    """``q = 1 - 2 k mu1/(1 + k sqrt(2 dbar tr int S))^2`` (audit, section 11.9).

    Parameters
    ----------
    mu1 : float
        ``int S >= mu1 I`` over every window.
    trace : float
        Upper bound of ``tr int S``.
    degree : float
        dbar, upper bound of the integral of the largest degree.
    gain : float
        k.
    window : float
        T [s].

    Notes
    -----
    ``||L x||^2 <= 2 d x^T S x`` with d the largest degree (Cauchy-Schwarz in each row). So over a window xi moves by at
    most ``k sqrt(2 dbar) ||y||`` with ``y = S^{1/2} xi``, and
    ``sqrt(mu1) ||xi(t)|| <= (1 + k sqrt(2 dbar tr int S)) ||y||``, while ``||xi||^2`` loses ``2 k ||y||^2``.
    """
    share = 2 * gain * mu1 / (1 + gain * np.sqrt(2 * degree * trace)) ** 2
    return DirectedContraction(window, mu1, float(1 - share), float(-np.log1p(-share) / (2 * window)))


@dataclass(frozen=True, eq=False)
class BalancedSwitching:
    """Balanced directed graphs that follow each other periodically, each for its own time.

    Parameters
    ----------
    adjacencies : sequence of array_like, each of shape (n, n)
        Weights; some may be zero.
    dwells : sequence of float
        For how long [s] each is active; positive.
    gain : float
        k.

    Raises
    ------
    ValueError
        If the lists differ in length, a time is not positive, or weights do not balance.
    """

    adjacencies: Sequence[ArrayLike]
    dwells: Sequence[float]
    gain: float = 1.0

    def __post_init__(self) -> None:
        """Check the parts."""
        if not self.adjacencies or len(self.adjacencies) != len(self.dwells):
            raise ValueError(
                f"{len(self.adjacencies)} graphs and {len(self.dwells)} dwell times; give one time for each graph."
            )
        for number, dwell in enumerate(self.dwells, start=1):
            if not (np.isfinite(dwell) and dwell > 0):
                raise ValueError(f"dwell[{number}] is {dwell}; it must be a positive number of seconds.")
        for adjacency in self.adjacencies:
            symmetric_part(adjacency)

    @property
    def period(self) -> float:
        """Sum of the dwell times [s]."""
        return float(sum(self.dwells))

    def contraction(self) -> DirectedContraction:
        """What every window of one period does at least; the integrals over a period do not depend on its start."""
        total = sum(dwell * symmetric_part(A) for A, dwell in zip(self.adjacencies, self.dwells, strict=True))
        degrees = [float(np.max(np.diag(directed_laplacian(A)))) for A in self.adjacencies]
        eigenvalues = np.linalg.eigvalsh(total)
        # What rounding leaves of a union that does not join all agents is no excitation.
        mu1 = float(eigenvalues[0]) if eigenvalues[0] > _BALANCE * eigenvalues[-1] else 0.0
        dbar = sum(d * dwell for d, dwell in zip(degrees, self.dwells, strict=True))
        return directed_contraction(mu1, float(np.trace(total)), dbar, self.gain, self.period)

    def flow(self, start: float) -> NDArray[np.float64]:
        """``phi(start + T, start)``, shape (n - 1, n - 1), over one period T; exact up to rounding."""
        ends = np.cumsum(np.tile(self.dwells, 2))
        begin = start % self.period
        U = disagreement_basis(len(np.asarray(self.adjacencies[0])))
        cuts = [begin, *(end for end in ends if begin < end < begin + self.period), begin + self.period]
        flow = np.eye(U.shape[1])
        for a, b in itertools.pairwise(cuts):
            place = int(np.searchsorted(ends, (a + b) / 2)) % len(self.dwells)
            L = directed_laplacian(self.adjacencies[place])
            flow = expm(-self.gain * (b - a) * (U.T @ L @ U)) @ flow
        return np.asarray(flow)

    @property
    def exact_rate(self) -> float:
        """Floquet rate [1/s]: ``-ln rho(phi(T, 0))/T``; 0 up to rounding without excitation."""
        return float(-np.log(np.max(np.abs(np.linalg.eigvals(self.flow(0.0))))) / self.period)

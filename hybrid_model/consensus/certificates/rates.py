"""Rates of convergence from excitation constants: along a tree, without one, and of the repaired corollary."""

import math

from hybrid_model.consensus.excitation.joint import JointExcitation
from hybrid_model.consensus.excitation.persistence import WindowExtremes

__all__ = [
    "corollary_rate",
    "corollary_rate_exact",
    "rate_of_contraction",
    "tree_contraction",
    "tree_free_contraction",
    "tree_free_rate",
]

_ZERO = 1e-12
"""Share of the largest eigenvalue below which the smallest one of a window integral counts as zero (rounding)."""


def rate_of_contraction(gamma: float, window: float) -> float:
    """``ln(1/(1 - gamma))/(2 T)`` [1/s]: the rate at which a norm falls whose square loses the share gamma every T."""
    return -math.log1p(-gamma) / (2 * window)


def tree_contraction(constants: WindowExtremes, gain: float, smallest: float, largest: float, p: int) -> float:
    """gamma of theorem 1; 0.0 if mu1 is zero up to rounding.

    Parameters
    ----------
    constants : WindowExtremes
        Those of W_tau (printed) or M (valid).
    gain : float
        k.
    smallest, largest : float
        Extreme eigenvalues of Lambda.
    p : int
        Number of edges of the tree.
    """
    if constants.mu1 <= _ZERO * constants.mu2:
        return 0.0
    return 2 * gain * smallest * constants.mu1 / (1 + gain * math.sqrt(p) * largest * constants.mu2) ** 2


def tree_free_contraction(constants: WindowExtremes, gain: float) -> float:
    """``gamma* = 2 mu1/(1 + mu2 + ||P||_F^2/2)`` with the constants of ``k N`` (audit, section 3 (ii)).

    The share of ``||xi||^2`` that is lost every window; 0.0 if mu1 is zero up to rounding.

    Parameters
    ----------
    constants : WindowExtremes
        Those of N, `Signal.DISAGREEMENT`.
    gain : float
        k.
    """
    if constants.mu1 <= _ZERO * constants.mu2:
        return 0.0
    return 2 * gain * constants.mu1 / (1 + gain * constants.mu2 + (gain * constants.frobenius) ** 2 / 2)


def tree_free_rate(constants: WindowExtremes, gain: float) -> float:
    """Rate [1/s] that follows from `tree_free_contraction`; parameters as there."""
    return rate_of_contraction(tree_free_contraction(constants, gain), constants.window)


def corollary_rate(joint: JointExcitation, gain: float) -> float:
    """Rate [1/s] of the corollary on switching topologies, repaired, from the intervals alone (audit, section 8).

    Over windows of twice the longest interval mu1 of N is at least ``2 w_min (1 - cos(pi/n))``; its mu2 and its
    Frobenius norm are at most its trace ``2 sum_e int w_e``. With these, gamma* needs no common spanning tree and no
    knowledge of when which edge is active.

    Parameters
    ----------
    joint : JointExcitation
        The intervals, the least weight on their trees and the total weight.
    gain : float
        k.
    """
    trace = gain * joint.trace
    gamma = 2 * gain * joint.mu1_of_paths / (1 + trace + trace**2 / 2)
    return rate_of_contraction(gamma, joint.window)


def corollary_rate_exact(joint: JointExcitation, gain: float) -> float:
    """The same with the exact constants of N over these windows; never smaller [1/s]."""
    return tree_free_rate(joint.exact, gain)

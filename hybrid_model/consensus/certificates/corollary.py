"""The corollary on switching topologies, repaired: a rate from the intervals alone (audit, section 8)."""

from __future__ import annotations

from hybrid_model.consensus.certificates.rates import rate_of_contraction, tree_free_rate
from hybrid_model.consensus.excitation.joint import JointExcitation

__all__ = ["corollary_rate", "corollary_rate_exact"]


def corollary_rate(joint: JointExcitation, gain: float) -> float:
    """Rate [1/s] from the lengths of the intervals, the least weight on their trees and the total weight.

    Over windows of twice the longest interval mu1 of N is at least ``2 w_min (1 - cos(pi/n))``; its mu2 and its
    Frobenius norm are at most its trace ``2 sum_e int w_e``. With these, gamma* needs no common spanning tree and no
    knowledge of when which edge is active.

    Parameters
    ----------
    joint : JointExcitation
        The intervals.
    gain : float
        k.
    """
    trace = gain * joint.trace
    gamma = 2 * gain * joint.mu1_of_paths / (1 + trace + trace**2 / 2)
    return rate_of_contraction(gamma, joint.window)


def corollary_rate_exact(joint: JointExcitation, gain: float) -> float:
    """The same with the exact constants of N over these windows; never smaller [1/s]."""
    return tree_free_rate(joint.exact, gain)

"""kappa_2 along every spanning tree: the paper's kappa_2^m and kappa_2^M (audit, sections 5.4 and 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.rates import BoundForm, convergence_bound
from hybrid_model.consensus.excitation.joint import tree_excitations
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

__all__ = ["TreeRadius", "tree_radii"]

_MOST_TREES = 200


@dataclass(frozen=True)
class TreeRadius:
    """The bound of theorem 2 along one spanning tree, for the threshold held at c.

    Parameters
    ----------
    tree : tuple of int
        Edges, from 1.
    rate : float
        alpha_v [1/s].
    kappa2 : float
        Bound on ``||Upsilon||`` for t to infinity; depends on the coordinates that the tree gives.
    radius : float
        ``rho kappa2``, a bound on ``||x_e||``, which does not depend on the tree.
    """

    tree: tuple[int, ...]
    rate: float
    kappa2: float
    radius: float


def tree_radii(analysis: Analysis, form: BoundForm = BoundForm.VALID, most: int = _MOST_TREES) -> list[TreeRadius]:
    """The bound of theorem 2 along each exciting spanning tree, for beta = 0; at most `most` of them.

    Parameters
    ----------
    analysis : Analysis
        The scenario; its window is used for all trees.
    form : BoundForm
        PRINTED (constants of W_tau) or VALID (constants of M).
    most : int
        Trees beyond this number are left out; a complete graph on n agents has ``n**(n - 2)``.
    """
    c = analysis.scenario.trigger.threshold or 1.0
    scenario = replace(analysis.scenario, trigger=Trigger(TriggerKind.STATIC, c))
    found = []
    for excitation in tree_excitations(scenario, analysis.window, most):
        tree = excitation.partition
        bound = convergence_bound(scenario, form, tree, analysis.window)
        if bound.kappa2 is not None:
            found.append(TreeRadius(tree.tree, bound.rate, bound.kappa2, bound.edge_factor * bound.kappa2))
    return found

"""Edge domain and paper side by side: the slowest pole and alpha_v, the exact peak and rho kappa_2."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from hybrid_model.consensus.certificates.tree_bound import BoundForm, convergence_bound
from hybrid_model.consensus.exact.edge_domain import edge_domain_gains
from hybrid_model.consensus.exact.periodic_edge_domain import periodic_gains
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

__all__ = ["EdgeComparison", "compare_edge_domain"]


@dataclass(frozen=True)
class EdgeComparison:
    """What linear systems theory gives exactly, and what the paper's theorem 2 bounds, for a constant threshold c.

    Attributes
    ----------
    rate : float
        Slowest pole, or Floquet rate [1/s].
    alpha : dict
        Form -> alpha_v [1/s], a lower bound of `rate`; 0.0 without excitation along the tree.
    radius : float
        Exact ultimate ``||x_e||``: c times the peak gain with the Euclidean norm over edges.
    rho_kappa2 : dict
        Form -> ``rho kappa_2``, an upper bound of `radius`; None without excitation along the tree.
    rms : float
        Bound on the root mean square of ``||x_e(t)||`` over a long time, ``c sqrt(n)`` times the L2 gain. It
        bounds no peak.
    window : float
        T [s] of the excitation behind alpha_v and kappa_2.
    """

    rate: float
    alpha: dict[BoundForm, float]
    radius: float
    rho_kappa2: dict[BoundForm, float | None]
    rms: float
    window: float


def compare_edge_domain(
    scenario: Scenario,
    partition: TreePartition | None = None,
    window: float | None = None,
    resolution: float = 0.01,
) -> EdgeComparison:
    """Compare the exact gains of the edge domain with alpha_v and kappa_2 for the scenario's threshold without decay.

    Parameters
    ----------
    scenario : Scenario
        With periodic or constant weights that join all agents, and a trigger that has a threshold.
    partition, window
        As in `hybrid_model.consensus.certificates.tree_bound.convergence_bound`.
    resolution : float
        As in `edge_domain_gains` and `periodic_gains`.

    Raises
    ------
    ScenarioError
        If the weights are not periodic, do not join all agents, or the trigger has no threshold.
    """
    c = scenario.trigger.threshold
    if c <= 0:
        raise ScenarioError(
            f"the trigger '{scenario.trigger.name}' of {scenario.name} has no threshold c, so nothing scales the "
            "gains; give a static or dynamic one."
        )
    static = replace(scenario, trigger=Trigger(TriggerKind.STATIC, c))
    bounds = {form: convergence_bound(static, form, partition, window) for form in BoundForm}
    if scenario.edge_weights.period == 0.0:
        constant = edge_domain_gains(scenario, resolution)
        rate, radius, l2 = constant.rate, constant.radius, constant.l2
    else:
        periodic = periodic_gains(scenario, resolution)
        rate, radius, l2 = periodic.spectrum.rate, periodic.radius, periodic.l2
    return EdgeComparison(
        rate=rate,
        alpha={form: bound.rate for form, bound in bounds.items()},
        radius=c * radius,
        rho_kappa2={form: bound.radius for form, bound in bounds.items()},
        rms=c * math.sqrt(scenario.network.agents) * l2,
        window=next(iter(bounds.values())).window,
    )

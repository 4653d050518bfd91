"""The edge domain with python-control: how the broadcast errors drive the edge states."""

from __future__ import annotations

import numpy as np

from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import weighted_laplacian
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.gated_sine import ConstantWeight
from hybrid_model.linear import StateSpace, named_system


def edge_domain_system(scenario: Scenario, partition: TreePartition | None = None) -> StateSpace:
    """Return the linear system from the broadcast errors e to the edge states x_e, for constant weights.

    With the tree-edge states ``x_tau`` it is ``x_tau' = -k D_tau' L D_tau (D_tau' D_tau)^-1 x_tau - k D_tau' L e`` and
    ``x_e = R' x_tau``, where L is the weighted Laplacian (paper, equation of the edge states with events). The
    consensus direction, which the edges do not see, is not a state: the system has n - 1 poles, all stable if the
    weighted graph is connected.

    Parameters
    ----------
    scenario : Scenario
        With constant weights and no switching.
    partition : TreePartition, optional
        Spanning tree of the underlying graph whose edges are the states; default: the first in edge order.

    Returns
    -------
    control.StateSpace
        Inputs ``e[1]`` ... ``e[n]``, states ``x_tau[1]`` ... ``x_tau[n-1]``, outputs ``x_e[1]`` ... over the underlying
        graph's edges, in their order.

    Raises
    ------
    ScenarioError
        If the weights change with time: then the system is not time-invariant.
    """
    levels = constant_levels(scenario)
    network = scenario.network
    tree = partition or TreePartition(network.agents, network.underlying_edges)
    laplacian = weighted_laplacian(network.agents, network.edges, levels)
    from_error = -network.gain * tree.incidence_tree.T @ laplacian
    # x = D_tau (D_tau' D_tau)^-1 x_tau, up to the mean, which the Laplacian does not see.
    to_states = tree.incidence_tree @ np.linalg.inv(tree.edge_laplacian_tree)
    return named_system(
        from_error @ to_states,
        from_error,
        tree.R_by_edge.T,
        np.zeros((len(network.underlying_edges), network.agents)),
        inputs=_names("e", network.agents),
        states=_names("x_tau", network.agents - 1),
        outputs=_names("x_e", len(network.underlying_edges)),
        name=scenario.name,
    )


def constant_levels(scenario: Scenario) -> list[float]:
    """Return the constant weight of each listed edge.

    Raises
    ------
    ScenarioError
        If the weights change with time.
    """
    constant = [w for w in scenario.weights.waveforms if isinstance(w, ConstantWeight)]
    if len(constant) < len(scenario.weights.waveforms) or scenario.edge_weights.period != 0.0:
        raise ScenarioError(
            f"{scenario.name}: the weights change with time, so the edge domain is no time-invariant system: "
            "give constant weights without switching, or use the Floquet spectrum."
        )
    return [w.level if on else 0.0 for w, on in zip(constant, scenario.switching.active_at(0.0), strict=True)]


def _names(symbol: str, count: int) -> list[str]:
    return [f"{symbol}[{k}]" for k in range(1, count + 1)]

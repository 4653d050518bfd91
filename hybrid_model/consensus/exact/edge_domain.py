"""The edge domain for constant weights: a linear system from the broadcast errors to the edge states, and its gains.

In disagreement coordinates the system is ``xi' = -k N (xi + U^T e)``, ``x_e = D^T U xi``. Its gain at frequency zero
is ``-D^T``: constant errors shift the agents by minus the errors. No frequency has a larger one, because
``k N (jw + k N)^-1`` is a contraction; so the H-infinity norm is ``||D||``, whatever the weights and the gain k
(audit, section 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.exponential_sums import absolute_integral
from hybrid_model.consensus.exact.worst_case import worst_case
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import Edge, disagreement_basis, incidence, weighted_laplacian
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.linear import StateSpace, h_infinity_norm, named_system

__all__ = ["EdgeGains", "edge_domain_gains", "edge_domain_system", "edge_states_system", "impulse_modes"]

_ROUNDING = 1e-12
"""Share of the largest rate below which a rate counts as zero."""


@dataclass(frozen=True, eq=False)
class EdgeGains:
    """How large the edge states can get for errors of a given size; a broadcast error has the unit of the states.

    Attributes
    ----------
    edges : tuple of Edge
        The edges of the underlying graph, in their order.
    poles : ndarray, shape (n - 1,)
        Of the system [1/s], real and negative, the slowest first.
    h_infinity : float
        Largest singular value over all frequencies.
    peaks : ndarray, shape (edges,)
        ``sum_i int |g_ei(t)| dt``: the largest ``|x_e(t)|`` on each edge over all errors with ``|e_i| <= 1``.
    radius : float
        Largest Euclidean norm of all edge states over the same errors; with ``|e_i| <= c`` the ultimate radius is c
        times this (audit, section 7).
    """

    edges: tuple[Edge, ...]
    poles: NDArray[np.float64]
    h_infinity: float
    peaks: NDArray[np.float64]
    radius: float

    @property
    def l2(self) -> float:
        """Induced gain from square-integrable errors to square-integrable edge states: the H-infinity norm."""
        return self.h_infinity

    @property
    def peak(self) -> float:
        """Induced gain for largest absolute values, of errors over agents and of edge states over edges."""
        return float(np.max(self.peaks))

    @property
    def rate(self) -> float:
        """Exact rate [1/s] of convergence without errors: minus the slowest pole."""
        return float(-self.poles[0])


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
    levels = _constant_levels(scenario)
    network = scenario.network
    tree = partition or TreePartition(network.agents, network.underlying_edges)
    laplacian = weighted_laplacian(network.agents, network.edges, levels)
    from_error = -network.gain * tree.incidence_tree.T @ laplacian
    # x = D_tau (D_tau' D_tau)^-1 x_tau, up to the mean, which the Laplacian does not see.
    to_states = tree.incidence_tree @ np.linalg.inv(tree.edge_laplacian_tree)
    return edge_states_system(scenario, tree, from_error @ to_states, from_error)


def edge_states_system(
    scenario: Scenario,
    tree: TreePartition,
    A: NDArray[np.float64],
    B: NDArray[np.float64],
    period: float = 0.0,
) -> StateSpace:
    """The system with tree-edge states, from errors to the edge states, with named signals.

    Parameters
    ----------
    scenario : Scenario
        Its name, its agents, its underlying graph.
    tree : TreePartition
        Whose edges are the states.
    A, B : ndarray, shapes (n - 1, n - 1) and (n - 1, n)
        The matrices of ``x_tau`` and e.
    period : float
        Sampling time [s]; 0 for continuous time.
    """
    network = scenario.network
    errors, states, outputs = network.agents, network.agents - 1, len(network.underlying_edges)
    return named_system(
        A,
        B,
        tree.R_by_edge.T,
        np.zeros((outputs, errors)),
        inputs=_names("e", errors),
        states=_names("x_tau", states),
        outputs=_names("x_e", outputs),
        name=scenario.name,
        period=period,
    )


def _names(symbol: str, count: int) -> list[str]:
    return [f"{symbol}[{k}]" for k in range(1, count + 1)]


def edge_domain_gains(scenario: Scenario, resolution: float = 0.01) -> EdgeGains:
    """Gains of the edge domain.

    Parameters
    ----------
    scenario : Scenario
        With constant weights that join all agents, and no switching.
    resolution : float
        Of the radius, see `hybrid_model.consensus.exact.worst_case.worst_case`; all else is exact up to rounding, the
        H-infinity norm to python-control's relative tolerance of 1e-6.

    Raises
    ------
    ScenarioError
        If the weights change with time or do not join all agents.
    """
    values, gains = impulse_modes(scenario)
    if values[0] == 0:
        raise ScenarioError(
            f"{scenario.name}: the edges that carry weight do not join all agents, so constant errors move edge states "
            "without bound; give them weights that do."
        )
    system = edge_domain_system(scenario)
    peaks = [sum(absolute_integral(modes, values) for modes in row) for row in gains]
    return EdgeGains(
        edges=scenario.network.underlying_edges,
        poles=np.sort(system.poles().real)[::-1],
        h_infinity=h_infinity_norm(system),
        peaks=np.array(peaks),
        radius=worst_case(scenario, 1 / values[0], 0.0, resolution, threshold=1.0).radius,
    )


def impulse_modes(scenario: Scenario) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The impulse responses ``g_ei(t) = sum_m gains[e, i, m] exp(-rates[m] t)`` of the edge domain.

    Returns
    -------
    rates : ndarray, shape (n - 1,)
        Eigenvalues of ``k N`` [1/s], ascending; zero up to rounding is zero.
    gains : ndarray, shape (edges, n, n - 1)
        In 1/s.
    """
    network = scenario.network
    basis = disagreement_basis(network.agents)
    laplacian = weighted_laplacian(network.agents, network.edges, _constant_levels(scenario))
    rates, vectors = np.linalg.eigh(network.gain * basis.T @ laplacian @ basis)
    rates = np.where(rates > _ROUNDING * rates[-1], rates, 0.0)
    towards_agents = basis @ vectors
    towards_edges = incidence(network.agents, network.underlying_edges).T @ towards_agents
    return rates, -towards_edges[:, None, :] * towards_agents[None, :, :] * rates


def _constant_levels(scenario: Scenario) -> list[float]:
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

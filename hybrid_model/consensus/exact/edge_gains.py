"""Gains of the edge domain for constant weights: from the broadcast errors to the edge states.

In disagreement coordinates the system is ``xi' = -k N (xi + U^T e)``, ``x_e = D^T U xi``. Its gain at frequency zero
is ``-D^T``: constant errors shift the agents by minus the errors. No frequency has a larger one, because
``k N (jw + k N)^-1`` is a contraction; so the H-infinity norm is ``||D||``, whatever the weights and the gain k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.edge_domain import constant_levels, edge_domain_system
from hybrid_model.consensus.exact.exponential_sums import absolute_integral
from hybrid_model.consensus.exact.worst_case import worst_case
from hybrid_model.consensus.graphs.undirected import Edge, disagreement_basis, incidence, weighted_laplacian
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.linear import h_infinity_norm

__all__ = ["EdgeGains", "edge_domain_gains", "impulse_modes"]

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
    laplacian = weighted_laplacian(network.agents, network.edges, constant_levels(scenario))
    rates, vectors = np.linalg.eigh(network.gain * basis.T @ laplacian @ basis)
    rates = np.where(rates > _ROUNDING * rates[-1], rates, 0.0)
    towards_agents = basis @ vectors
    towards_edges = incidence(network.agents, network.underlying_edges).T @ towards_agents
    return rates, -towards_edges[:, None, :] * towards_agents[None, :, :] * rates

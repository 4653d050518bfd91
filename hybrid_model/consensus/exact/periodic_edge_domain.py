"""The edge domain for periodic weights: the map over one period, and gains that take the whole period into account.

Between the ends of periods the system is time-invariant again, with the monodromy matrix as its state matrix; that is
what python-control can hold. Its gains are those for errors held over a period. Errors that move within the period can
do more: their L2 gain is in `l2_gain`, their peaks are those of the exact worst case (audit, section 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid_model.consensus.exact.edge_domain import edge_states_system
from hybrid_model.consensus.exact.floquet import FloquetSpectrum, floquet_spectrum, transition_matrix
from hybrid_model.consensus.exact.l2_gain import periodic_l2_gain, require_consensus, require_period
from hybrid_model.consensus.exact.worst_case import worst_case
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import Edge, disagreement_basis
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.linear import StateSpace

__all__ = ["PeriodicGains", "period_map", "periodic_gains"]


@dataclass(frozen=True, eq=False)
class PeriodicGains:
    """How large the edge states can get for errors of a given size, with periodic weights.

    Attributes
    ----------
    spectrum : FloquetSpectrum
        Period, multipliers, exact rate.
    l2 : float
        Induced gain from square-integrable errors to square-integrable edge states over the underlying graph.
    peaks : dict
        Listed edge -> largest ultimate ``|x_e(t)|`` over all errors with ``|e_i| <= 1``.
    radius : float
        Largest ultimate Euclidean norm of all edge states over the same errors.
    """

    spectrum: FloquetSpectrum
    l2: float
    peaks: dict[Edge, float]
    radius: float


def period_map(scenario: Scenario, partition: TreePartition | None = None, start: float = 0.0) -> StateSpace:
    """Return the edge domain from period to period as a discrete-time system, for errors held over each period.

    ``x_tau(start + (j+1) P) = Phi x_tau(start + j P) + (Phi - I) D_tau^T e_j`` with the monodromy matrix Phi in tree
    coordinates: as long as e is constant, ``x + e`` moves as x does without errors.

    Parameters
    ----------
    scenario : Scenario
        With periodic or constant weights.
    partition : TreePartition, optional
        Spanning tree of the underlying graph whose edges are the states; default: the first in edge order.
    start : float
        Where the periods begin [s].

    Returns
    -------
    control.StateSpace
        With the period as its sampling time; names as of `edge_domain_system`. Its poles are the Floquet multipliers.

    Raises
    ------
    ScenarioError
        If the weights are not periodic.
    """
    period = require_period(scenario)
    network = scenario.network
    tree = partition or TreePartition(network.agents, network.underlying_edges)
    to_tree = tree.incidence_tree.T @ disagreement_basis(network.agents)
    monodromy = to_tree @ transition_matrix(scenario, start, start + period) @ np.linalg.inv(to_tree)
    from_error = (monodromy - np.eye(len(monodromy))) @ tree.incidence_tree.T
    return edge_states_system(scenario, tree, monodromy, from_error, period)


def periodic_gains(scenario: Scenario, resolution: float = 0.01) -> PeriodicGains:
    """Gains of the edge domain with periodic weights.

    Parameters
    ----------
    scenario : Scenario
        With periodic weights that join all agents over a period.
    resolution : float
        Of the peaks and the radius, see `hybrid_model.consensus.exact.worst_case.worst_case`, and of the L2 gain.

    Raises
    ------
    ScenarioError
        If the weights are not periodic or do not join all agents.
    """
    period = require_period(scenario)
    spectrum = floquet_spectrum(scenario)
    require_consensus(scenario, spectrum)
    worst = worst_case(scenario, period, 0.0, resolution, threshold=1.0)
    return PeriodicGains(spectrum, periodic_l2_gain(scenario, resolution), worst.pairs, worst.radius)

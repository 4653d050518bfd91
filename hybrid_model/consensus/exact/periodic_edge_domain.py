"""The edge domain for periodic weights: the map over one period, and gains that take the whole period into account.

Between the ends of periods the system is time-invariant again, with the monodromy matrix as its state matrix; that is
what python-control can hold. Its gains are those for errors held over a period. Errors that move within the period can
do more; their L2 gain follows from the monodromy matrix of the Hamiltonian system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.edge_domain import edge_states_system
from hybrid_model.consensus.exact.floquet import FloquetSpectrum, floquet_spectrum, transition_matrix
from hybrid_model.consensus.exact.transition_grid import transition_grid
from hybrid_model.consensus.exact.worst_case import worst_case
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import Edge, disagreement_basis, incidence
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.linear import StateSpace

__all__ = ["PeriodicGains", "period_map", "periodic_gains", "periodic_l2_gain"]

_DOUBLINGS = 60
_FORGOTTEN = 1e-12
"""Norm of what a state passes on over a horizon, below which a longer one makes no difference."""


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
    period = _period(scenario)
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
    period = _period(scenario)
    spectrum = floquet_spectrum(scenario)
    _require_consensus(scenario, spectrum)
    worst = worst_case(scenario, period, 0.0, resolution, threshold=1.0)
    return PeriodicGains(spectrum, periodic_l2_gain(scenario, resolution), worst.pairs, worst.radius)


def periodic_l2_gain(scenario: Scenario, resolution: float = 0.01, tolerance: float = 1e-7) -> float:
    """Induced L2 gain from broadcast errors to edge states over the underlying graph.

    Parameters
    ----------
    scenario : Scenario
        With periodic or constant weights that join all agents.
    resolution : float
        Largest ``k int ||N||`` over a cell of the grid on which N is held; the error is of its second order, and there
        is none for weights that are piecewise constant.
    tolerance : float
        Relative accuracy of the bisection.

    Raises
    ------
    ScenarioError
        If the weights are not periodic or do not join all agents.

    Notes
    -----
    A gain g is larger than the norm if and only if the boundary value problem of the Hamiltonian system
    ``xi' = -k N xi + (k N)^2 eta/g^2, eta' = -U^T D D^T U xi + k N eta``, from xi at the start and eta at the end, has
    one solution over every horizon. So cells, then periods, are joined in the form that such a problem
    gives, and two neighbours whose gains are below g join to one with that property if and only if the product of what
    one passes on and the other returns has no eigenvalue from 1 on. The horizon doubles until nothing is passed on.
    The gain is at least ``||D||``, that for constant errors.
    """
    _require_consensus(scenario, floquet_spectrum(scenario))
    network = scenario.network
    cells = transition_grid(scenario, 0.0, _period(scenario), resolution)
    factor = signal_factor(scenario, Signal.DISAGREEMENT)
    moved = network.gain * (factor * cells.doses[:, None, :]) @ factor.T
    edge_form = disagreement_basis(network.agents).T @ incidence(network.agents, network.underlying_edges)
    lengths = np.diff(cells.times)

    def exceeds(gain: float) -> bool:
        return _is_above_norm(moved, lengths, edge_form @ edge_form.T, gain)

    low, step = float(np.linalg.norm(edge_form, 2)), tolerance
    high = low * (1 + step)
    while not exceeds(high):
        step *= 4
        low, high = high, high * (1 + step)
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (low, middle) if exceeds(middle) else (middle, high)
    return high


def _is_above_norm(
    moved: NDArray[np.float64], lengths: NDArray[np.float64], output: NDArray[np.float64], gain: float
) -> bool:
    size = moved.shape[1]
    blocks: Blocks | None = _cell_blocks(moved, lengths, output, gain)
    while blocks is not None and len(blocks[0]) > 1:
        if len(blocks[0]) % 2:
            units = (1.0, 0.0, 0.0, 1.0)
            a, b, c, d = (_with_identity(part, unit) for part, unit in zip(blocks, units, strict=True))
            blocks = (a, b, c, d)
        a, b, c, d = blocks
        blocks = _joined((a[::2], b[::2], c[::2], d[::2]), (a[1::2], b[1::2], c[1::2], d[1::2]))
    for _ in range(_DOUBLINGS):
        if blocks is None or np.linalg.norm(blocks[0]) < _FORGOTTEN * np.sqrt(size):
            break
        blocks = _joined(blocks, blocks)
    return blocks is not None and _joined(blocks, blocks) is not None


Blocks = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""``xi1 = a xi0 + b eta1, eta0 = c xi0 + d eta1`` from the start, 0, to the end, 1, of some cells."""


def _cell_blocks(
    moved: NDArray[np.float64], lengths: NDArray[np.float64], output: NDArray[np.float64], gain: float
) -> Blocks:
    cells, size = moved.shape[:2]
    generator = np.zeros((cells, 2 * size, 2 * size))
    generator[:, :size, :size] = -moved
    # (k N)^2 over a cell on which N is held: the square of its integral over the length.
    generator[:, :size, size:] = moved @ moved / lengths[:, None, None] / gain**2
    generator[:, size:, :size] = -output * lengths[:, None, None]
    generator[:, size:, size:] = moved
    flows = _exponential(generator)
    back = np.asarray(np.linalg.inv(flows[:, size:, size:]), dtype=np.float64)
    across = back @ flows[:, size:, :size]
    ahead = flows[:, :size, size:]
    return flows[:, :size, :size] - ahead @ across, ahead @ back, -across, back


def _exponential(generator: NDArray[np.float64]) -> NDArray[np.float64]:
    """Taylor's polynomial of order ten: over a short cell the next term is below rounding, since the eigenvalues of the
    generators are at most those of ``k int N``."""
    eye = np.eye(generator.shape[-1])
    flows = np.broadcast_to(eye, generator.shape)
    for order in range(10, 0, -1):
        flows = eye + generator @ flows / order
    return flows


def _joined(first: Blocks, second: Blocks) -> Blocks | None:
    """One after the other (Redheffer's star product); None if the gain is not above the norm of some pair."""
    (a, b, c, d), (e, f, g, h) = first, second
    if np.max(np.linalg.eigvals(b @ g).real) >= 1:
        return None
    eye = np.eye(a.shape[1])
    middle = np.linalg.solve(eye - b @ g, np.concatenate((a, b @ h), axis=2))
    to_start, to_end = middle[:, :, : a.shape[1]], middle[:, :, a.shape[1] :]
    parts = (e @ to_start, f + e @ to_end, c + d @ g @ to_start, d @ (h + g @ to_end))
    a, b, c, d = (np.asarray(part, dtype=np.float64) for part in parts)
    return a, b, c, d


def _with_identity(part: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
    return np.concatenate((part, unit * np.eye(part.shape[1])[None]))


def _period(scenario: Scenario) -> float:
    period = scenario.edge_weights.period
    if period is None:
        raise ScenarioError(
            f"{scenario.name}: the weights have no common period, so there is no map over a period; choose rates and a "
            "dwell time whose quotients are simple fractions."
        )
    # Every number is a period of a constant: take one second.
    return period or 1.0


def _require_consensus(scenario: Scenario, spectrum: FloquetSpectrum) -> None:
    if spectrum.rate * spectrum.period < 1e-12:
        raise ScenarioError(
            f"{scenario.name}: the edges that carry weight over a period do not join all agents, so constant errors "
            "move edge states without bound; give them weights that do."
        )

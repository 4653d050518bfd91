"""The L2 gain of the edge domain for periodic weights, from the monodromy matrix of a Hamiltonian system."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.floquet import FloquetSpectrum, floquet_spectrum
from hybrid_model.consensus.exact.transition_grid import transition_grid
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["periodic_l2_gain", "require_consensus", "require_period"]

_DOUBLINGS = 60
_FORGOTTEN = 1e-12
"""Norm of what a state passes on over a horizon, below which a longer one makes no difference."""


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
    require_consensus(scenario, floquet_spectrum(scenario))
    network = scenario.network
    cells = transition_grid(scenario, 0.0, require_period(scenario), resolution)
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


def require_period(scenario: Scenario) -> float:
    """The period [s] of the weights, for constant ones a second.

    Raises
    ------
    ScenarioError
        If there is none.
    """
    period = scenario.edge_weights.period
    if period is None:
        raise ScenarioError(
            f"{scenario.name}: the weights have no common period, so there is no map over a period; choose rates and a "
            "dwell time whose quotients are simple fractions."
        )
    # Every number is a period of a constant: take one second.
    return period or 1.0


def require_consensus(scenario: Scenario, spectrum: FloquetSpectrum) -> None:
    """Refuse a network that some constant errors drive without bound.

    Raises
    ------
    ScenarioError
        If the edges that carry weight do not join all agents.
    """
    if spectrum.rate * spectrum.period < 1e-12:
        raise ScenarioError(
            f"{scenario.name}: the edges that carry weight over a period do not join all agents, so constant errors "
            "move edge states without bound; give them weights that do."
        )

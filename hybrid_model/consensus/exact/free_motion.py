"""How agents move without trigger errors, in large networks.

The states are carried along: for constant weights by the modes of the Laplacian; else from cell to cell, by the sparse
Laplacian of each where its transition matrices would fill the memory.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigs

from hybrid_model.consensus.exact.transition_grid import TransitionGrid
from hybrid_model.consensus.graphs.undirected import disagreement_basis
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.edge_weights import Piece

__all__ = ["CellMotion", "ConstantMotion", "SparseMotion", "leading_multipliers"]

_GROWTH = 0.01
"""``beta`` times the length of a cell."""
_RESOLUTION = 0.05
"""Largest bound on ``k ||int N||`` of a cell."""
_SMALLEST = 1e-17
_PARTS = 32
"""Of a half wave, where edges of different shape carry weight: the Magnus series needs smooth carriers."""


class ConstantMotion:
    """Motion with constant weights, ``x(t) = mean + sum_m v_m exp(-rate_m t) v_m' x(0)``.

    Parameters
    ----------
    scenario : Scenario
        With constant weights.

    Attributes
    ----------
    rates : ndarray, shape (n - 1,)
        Eigenvalues of ``k L`` [1/s] but the zero of the mean, ascending.
    """

    def __init__(self, scenario: Scenario) -> None:
        network = scenario.network
        weights = scenario.edge_weights.value(0.0)
        rates, vectors = np.linalg.eigh(network.gain * _laplacian(_sparse_incidence(scenario), weights).toarray())
        self.rates, self._vectors = np.maximum(rates[1:], 0.0), vectors[:, 1:]
        self._shares = self._vectors.T @ np.asarray(network.initial)
        self._mean = float(np.mean(network.initial))

    def states(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """States, shape (n, times), at times [s]."""
        modes = self._shares[:, None] * np.exp(-self.rates[:, None] * times)
        return np.asarray(self._vectors @ modes + self._mean)

    def grid(
        self, decay: float, share: float, forgotten: float, most: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times that follow the states as closely as they move, and how far these leave the chord between two.

        Parameters
        ----------
        decay : float
            beta [1/s], not above the slowest rate.
        share : float
            Of the disagreement at the start of a cell, by which the states may leave the chord.
        forgotten : float
            Share of the disagreement at the start, times ``exp(beta t)``, at which the grid ends.
        most : int
            Number of cells at which it ends at the latest.

        Returns
        -------
        times : ndarray, shape (cells + 1,)
        aside : ndarray, shape (cells,)
            Bound on the Euclidean distance from the chord within each cell, by the second derivative at its start,
            which falls with time.
        """
        squares, rates = self._shares**2, self.rates
        least = forgotten * math.sqrt(float(np.sum(squares)))
        times, t = [0.0], 0.0
        aside: list[float] = []
        while len(aside) < most:
            fallen = squares * np.exp(-2 * rates * t)
            size = math.sqrt(float(np.sum(fallen)))
            if size * math.exp(decay * t) <= least or size == 0.0:
                break
            bend = math.sqrt(float(np.sum(fallen * rates**4)))
            step = math.sqrt(8 * share * size / bend) if bend > 0 else 1 / decay if decay > 0 else 1.0
            # The factor exp(beta t) is to change little over a cell as well.
            step = min(step, _GROWTH / decay) if decay > 0 else step
            t += step
            times.append(t)
            aside.append(step**2 / 8 * bend)
        return np.array(times), np.array(aside)


class SparseMotion:
    """Motion from cell to cell of a cycle.

    Parameters
    ----------
    scenario : Scenario
        Network, weights and switching.
    cycle : float
        Length [s] of the interval from t = 0 that is cut into cells.

    Attributes
    ----------
    times : ndarray, shape (cells + 1,)
        Ends of the cells [s].
    doses : ndarray, shape (cells,)
        Bound on ``k ||int N||`` over each cell: twice the largest degree, by Gershgorin's circles.
    """

    def __init__(self, scenario: Scenario, cycle: float) -> None:
        self._scenario = scenario
        self._gain = scenario.network.gain
        cuts, doses = [np.zeros(1)], []
        self._steps: list[sparse.csr_array | None] = []
        for piece in scenario.edge_weights.pieces(0.0, cycle):
            count = self._count(piece)
            times = np.linspace(piece.start, piece.end, count + 1)
            dose = piece.amplitudes * np.stack([c.integral(times[:-1], times[1:]) for c in piece.carriers], axis=-1)
            self._steps += self._of_piece(piece, times, dose)
            doses.append(self._bounds(dose))
            cuts.append(times[1:])
        self.times, self.doses = np.concatenate(cuts), np.concatenate(doses)

    @cached_property
    def _incidence(self) -> sparse.csr_array:
        return _sparse_incidence(self._scenario)

    def _bounds(self, dose: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(2 * self._gain * (abs(self._incidence) @ dose.T).max(axis=0))

    def _count(self, piece: Piece) -> int:
        if piece.is_idle:
            return 1
        whole = piece.amplitudes * np.array([float(c.integral(piece.start, piece.end)) for c in piece.carriers])
        count = float(self._bounds(whole[None, :])[0]) / _RESOLUTION
        if piece.shared_carrier is None:
            fastest = max(float(getattr(carrier, "rate", 0.0)) for carrier in piece.carriers)
            count = max(count, _PARTS * (piece.end - piece.start) * fastest / math.pi)
        return max(1, math.ceil(count))

    def _of_piece(
        self, piece: Piece, times: NDArray[np.float64], dose: NDArray[np.float64]
    ) -> list[sparse.csr_array | None]:
        """The exponents of the Magnus series of each cell; None where nothing moves."""
        if piece.is_idle:
            return [None] * (len(times) - 1)
        first = [-self._gain * _laplacian(self._incidence, row) for row in dose]
        if piece.shared_carrier is not None:
            return list(first)
        lengths = np.diff(times)
        middle, offset = (times[:-1] + times[1:]) / 2, lengths / (2 * math.sqrt(3.0))
        early, late = (self._values(piece, middle + sign * offset) for sign in (-1, 1))
        steps: list[sparse.csr_array | None] = []
        for k, exponent in enumerate(first):
            a, b = (_laplacian(self._incidence, row) for row in (early[k], late[k]))
            steps.append(exponent + self._gain**2 * math.sqrt(3.0) / 12 * lengths[k] ** 2 * (b @ a - a @ b))
        return steps

    def _values(self, piece: Piece, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(piece.amplitudes * np.stack([c.value(times) for c in piece.carriers], axis=-1))

    def path(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """States at the ends of the cells, shape (cells + 1, n), from that at the start of the cycle."""
        found = np.empty((len(self._steps) + 1, len(state)))
        found[0] = state
        for k, step in enumerate(self._steps):
            found[k + 1] = _moved(step, found[k])
        return found

    def over_a_cycle(self, state: NDArray[np.float64], cycles: int = 1) -> NDArray[np.float64]:
        """The state so many cycles later."""
        for _ in range(cycles):
            for step in self._steps:
                state = _moved(step, state)
        return state


class CellMotion:
    """Motion from cell to cell of a cycle, by transition matrices that are there; attributes as `SparseMotion`.

    Parameters
    ----------
    scenario : Scenario
        Network, weights and switching.
    cells : TransitionGrid
        Of the cycle.
    """

    def __init__(self, scenario: Scenario, cells: TransitionGrid) -> None:
        self._cells, self._basis = cells, disagreement_basis(scenario.network.agents)
        self.times = cells.times
        degrees = abs(_sparse_incidence(scenario)) @ cells.doses.T
        self.doses: NDArray[np.float64] = np.asarray(2 * scenario.network.gain * degrees.max(axis=0))

    def path(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `SparseMotion.path`."""
        found = np.empty((len(self._cells.flows) + 1, self._basis.shape[1]))
        found[0] = self._basis.T @ state
        for k, flow in enumerate(self._cells.flows):
            found[k + 1] = flow @ found[k]
        return np.asarray(found @ self._basis.T + state.mean())

    def over_a_cycle(self, state: NDArray[np.float64], cycles: int = 1) -> NDArray[np.float64]:
        """See `SparseMotion.over_a_cycle`."""
        disagreement = self._basis.T @ state
        for _ in range(cycles):
            disagreement = self._whole @ disagreement
        return np.asarray(self._basis @ disagreement + state.mean())

    @cached_property
    def _whole(self) -> NDArray[np.float64]:
        return self._cells.product()


def leading_multipliers(motion: SparseMotion | CellMotion, agents: int, count: int = 4) -> NDArray[np.complex128]:
    """The largest Floquet multipliers of a motion over its cycle, largest modulus first, by Arnoldi's method.

    Parameters
    ----------
    motion : SparseMotion or CellMotion
        Over one period.
    agents : int
        n.
    count : int
        How many are wanted.

    Raises
    ------
    scipy.sparse.linalg.ArpackNoConvergence
        If they lie so close together that they are not found.
    """

    def cycle(state: NDArray[np.float64]) -> NDArray[np.float64]:
        # Without its mean, which never changes and would be a multiplier of one.
        free = state - state.mean()
        return np.asarray(motion.over_a_cycle(free))

    operator = LinearOperator((agents, agents), matvec=cycle, dtype=np.float64)
    start = np.random.default_rng(agents).standard_normal(agents)
    found = eigs(operator, k=min(count, agents - 2), which="LM", v0=start, return_eigenvectors=False)
    return np.asarray(found[np.argsort(-np.abs(found))], dtype=np.complex128)


def _moved(step: sparse.csr_array | None, state: NDArray[np.float64]) -> NDArray[np.float64]:
    """``exp(step) state`` by its series: a step is small."""
    if step is None:
        return state
    term = total = state
    limit = _SMALLEST * float(np.max(np.abs(state)))
    k = 1
    while float(np.max(np.abs(term))) > limit:
        term = step @ term / k
        total, k = total + term, k + 1
    return np.asarray(total)


def _sparse_incidence(scenario: Scenario) -> sparse.csr_array:
    edges = np.asarray(scenario.network.edges) - 1
    columns = np.arange(len(edges))
    ones = np.ones(len(edges))
    entries = (np.concatenate([-ones, ones]), (np.concatenate([edges[:, 0], edges[:, 1]]), np.tile(columns, 2)))
    return sparse.csr_array(entries, shape=(scenario.network.agents, len(edges)))


def _laplacian(D: sparse.csr_array, weights: NDArray[np.float64]) -> sparse.csr_array:
    return sparse.csr_array(D @ sparse.diags_array(weights) @ D.T)

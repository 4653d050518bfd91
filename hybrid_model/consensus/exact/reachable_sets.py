"""Reachable sets of disagreement under all errors within a box, as sums of segments (zonotopes).

Every measurable error with ``|e_i(t)| <= exp(-beta t)`` is allowed, started in the infinite past, and the weights are
periodic. With ``phi`` the transition matrix of ``xi' = -k N xi`` the part of ``xi(t)`` that the errors cause is

    -int phi(t, s) k N(s) U^T e(s) ds = -int d_s phi(t, s) U^T e(s),      as  d_s phi(t, s) = phi(t, s) k N(s).

Its largest value along b is therefore the total variation over s of the entries of ``U phi(t, s)^T b``, weighted with
``exp(beta (t - s))``: the support function of audit, section 7, without an integral over weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.period_sums import FINEST_TAIL, support_over_periods
from hybrid_model.consensus.exact.transition_grid import TransitionGrid, affordable_resolution, transition_grid
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["ReachableSets"]

_ITERATIONS = 200
_APART = 0.5
"""``k int ||N||`` between two times at which suprema are looked for."""

_STALLED = 1e-10
_MOST_CELLS = 20_000
_MOST_WAVING = 5000
_MOST_TIMES = 800
_FORGOTTEN = 1e-13
_BLOCK = 64
"""Cells whose flows to a common end are kept."""


class ReachableSets:
    """The sets of ``xi(t)`` that errors within the box ``|e_i| <= exp(-beta t)`` reach, times ``exp(beta t)``.

    Parameters
    ----------
    scenario : Scenario
        Network with periodic or constant weights.
    period : float
        A period [s] of the weights; any positive number for constant weights.
    decay : float
        beta [1/s], below the Floquet rate.
    resolution : float
        Largest ``k int ||N||`` over a cell of the grid. The suprema are reached from below with an error of the second
        order: about a share of 1e-6 at 0.01.
    periodic : bool
        False if errors begin at t = 0 and `period` is the end of the run.
    most : int
        Number of cells beyond which the resolution is made coarser.

    Attributes
    ----------
    resolution : float
        The one in use.
    is_coarser : bool
        Whether that is coarser than what was asked for.
    """

    def __init__(
        self,
        scenario: Scenario,
        period: float,
        decay: float,
        resolution: float,
        *,
        periodic: bool = True,
        most: int = _MOST_CELLS,
    ) -> None:
        """Cut one period into cells."""
        self._periodic = periodic
        self.resolution = affordable_resolution(scenario, 0.0, period, resolution, most)
        self.is_coarser = self.resolution > resolution
        longest = self.resolution / decay if decay > 0 else np.inf
        # Cells that follow each wave serve accuracy: they are kept as long as there are not too many.
        waving = 64 * period * max(carrier.rate for carrier in scenario.edge_weights.carriers) / np.pi
        self._cells: TransitionGrid = transition_grid(
            scenario, 0.0, period, self.resolution, longest, joined=waving > _MOST_WAVING
        )
        self._period, self._decay = period, decay
        network = scenario.network
        self._basis = disagreement_basis(network.agents)
        self._edge_form = self._basis.T @ incidence(network.agents, network.underlying_edges)

    @property
    def times(self) -> NDArray[np.float64]:
        """Ends of the cells [s] in one period, where the sets can be asked for by index."""
        return self._cells.times[:-1] if self._periodic else self._cells.times

    @property
    def is_idle(self) -> NDArray[np.bool_]:
        """Mask of the cells in which no edge carries weight; cell j begins at ``times[j]``."""
        return self._cells.is_idle

    @cached_property
    def edge_gain(self) -> float:
        """Square root of the largest eigenvalue of ``D D^T``: ``||x_e|| <= edge_gain*||xi||``."""
        return float(np.linalg.norm(self._edge_form, 2))

    def at(self, index: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Generators of one period and the monodromy matrix, for the time ``times[index]``.

        Returns
        -------
        generators : ndarray, shape (cells*n, p)
            ``(phi(t, s_{j+1}) - phi(t, s_j)) U^T e_i exp(beta (t - s))`` over the last period, cells without weight
            left out.
        monodromy : ndarray, shape (p, p)
            ``phi(t, t - P) exp(beta P)``.
        """
        cells, size = self._cells, self._basis.shape[1]
        flow, age, steps, ages = np.eye(size), 0.0, [np.zeros((1, size, size))], [np.zeros(1)]
        forgotten = False
        idle = cells.is_idle
        for first, last in self._backward(index):
            forgotten = float(np.abs(flow).max()) * np.exp(self._decay * age) < _FORGOTTEN
            if forgotten:
                break
            flows = flow @ self._to_the_end(first, last)
            active = ~idle[first:last]
            steps.append((np.concatenate((flows[1:], flow[None])) - flows)[active])
            middles = (cells.times[first:last] + cells.times[first + 1 : last + 1]) / 2
            ages.append((age + cells.times[last] - middles)[active])
            flow, age = flows[0], age + float(cells.times[last] - cells.times[first])
        scale = np.exp(self._decay * np.concatenate(ages))
        moved = np.concatenate(steps) @ self._basis.T * scale[:, None, None]
        generators = np.swapaxes(moved, 1, 2).reshape(-1, size)
        # Without a period nothing happened before the start.
        lasting = self._periodic and not forgotten
        return generators, flow * (np.exp(self._decay * self._period) if lasting else 0.0)

    def _backward(self, index: int) -> Iterator[tuple[int, int]]:
        """Ranges of cells, each within a block, from ``times[index]`` backward: one period, or to the start."""
        ranges = [(0, index)]
        if self._periodic:
            # The period before looks the same.
            ranges.append((index, len(self._cells.flows)))
        for first, last in ranges:
            while last > first:
                begin = max((last - 1) // _BLOCK * _BLOCK, first)
                yield begin, last
                last = begin

    def _to_the_end(self, first: int, last: int) -> NDArray[np.float64]:
        """``phi(times[last], times[j])`` for the cells j from `first` to `last`, all in one block."""
        block, count = first // _BLOCK, len(self._cells.flows)
        if last == min((block + 1) * _BLOCK, count):
            return self._block_flows[block, first % _BLOCK : (last - 1) % _BLOCK + 1]
        flows = np.empty((last - first, *self._cells.flows.shape[1:]))
        flow = np.eye(flows.shape[1])
        for j in range(last - 1, first - 1, -1):
            flow = flows[j - first] = flow @ self._cells.flows[j]
        return flows

    @cached_property
    def _block_flows(self) -> NDArray[np.float64]:
        """Flows from each cell's beginning to the end of its block, shape (blocks, cells of a block, p, p)."""
        flows = self._cells.flows
        size, blocks = flows.shape[1], -(-len(flows) // _BLOCK)
        padded = np.concatenate((flows, np.broadcast_to(np.eye(size), (blocks * _BLOCK - len(flows), size, size))))
        ends = padded.reshape(blocks, _BLOCK, size, size).copy()
        for j in range(_BLOCK - 2, -1, -1):
            ends[:, j] = ends[:, j + 1] @ ends[:, j]
        return ends

    def support(
        self, index: int, directions: NDArray[np.float64], tail: float = FINEST_TAIL
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Support function and support points at ``times[index]`` for directions of shape (p, count).

        Earlier periods count until their share falls below `tail`.

        Returns
        -------
        values : ndarray, shape (count,)
        points : ndarray, shape (p, count)
        """
        generators, monodromy = self.at(index)
        return support_over_periods(generators, monodromy, directions, tail)

    def norms(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """``||x_e||`` at points xi, shape (p, count)."""
        return np.asarray(np.linalg.norm(self._edge_form.T @ points, axis=0))

    def radius(
        self, index: int, starts: NDArray[np.float64], tail: float = FINEST_TAIL, patience: int = 0
    ) -> tuple[float, NDArray[np.float64]]:
        """Largest ``||x_e||`` over the set at ``times[index]``, and directions, the farthest first, shape (p, count).

        The norm is convex, so its maximum lies at an extreme point: the support point of its own gradient. Power
        iteration from each of the `starts`, shape (p, count), never decreases, and there are many local maxima.
        In the first steps, `patience` of them, only starts that come together are given up.
        """
        generators, monodromy = self.at(index)
        form = self._edge_form @ self._edge_form.T
        directions, best, where = starts, 0.0, starts[:, :1]
        for step in range(_ITERATIONS):
            _, points = support_over_periods(generators, monodromy, directions, tail)
            squares = np.einsum("ic,ij,jc->c", points, form, points)
            ranked = np.argsort(-squares)
            largest = float(np.sqrt(squares[ranked[0]]))
            if largest <= best * (1 + _STALLED) and step >= patience:
                break
            best, where = max(best, largest), form @ points[:, ranked]
            # Later the worse half of the starts is given up in each step.
            directions = _distinct(where) if step < patience else where[:, : max(2, len(ranked) // 2)]
        return best, where

    def candidates(self, scenario: Scenario) -> NDArray[np.intp]:
        """Indices of times at which suprema are looked for: ends of the pieces, and points inside active ones."""
        if scenario.edge_weights.period == 0.0 and self._periodic:
            return np.zeros(1, dtype=np.intp)
        cuts = np.append(scenario.edge_weights.breakpoints(0.0, self._period), self._period)
        ends = np.concatenate(([0], np.searchsorted(self._cells.times, cuts * (1 - 1e-12))))
        step, least = max(1, round(_APART / self.resolution)), len(self.times) // _MOST_TIMES
        fastest = max(carrier.rate for carrier in scenario.edge_weights.carriers)
        found = []
        for (a, b), length in zip(pairwise(ends.tolist()), np.diff(cuts, prepend=0.0).tolist(), strict=True):
            # Eight a wave where weights oscillate without a break.
            points = max(1, int(4 * fastest * length / np.pi) - 3)
            found.append(np.arange(a, b, max(1, least, min(step, (b - a) // points))))
        return np.unique(np.concatenate(found)).astype(np.intp)

    def contraction(self, periods: int = 1) -> float:
        """Largest ``||phi(t + m P, t)||``, m periods, over the grid of times; a bound on it if the grid is coarser."""
        # Within a cell the norm rises above its values at the ends by a share of the second order.
        cover = 1 + self.resolution**2 if self.is_coarser else 1.0
        return min(1.0, cover * self._cells.contraction(periods))

    def overshoot(self, rate: float) -> float:
        """Largest ``||phi(t, s)|| exp(rate (t - s))``, see `TransitionGrid.overshoot`."""
        return self._cells.overshoot(rate)


def _distinct(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions, shape (p, count), without those that nearly equal an earlier one or its opposite."""
    leading = directions[np.abs(directions).argmax(axis=0), np.arange(directions.shape[1])]
    scaled = directions / np.where(leading != 0.0, leading, 1.0)
    _, first = np.unique(np.round(scaled, 2), axis=1, return_index=True)
    return directions[:, np.sort(first)]

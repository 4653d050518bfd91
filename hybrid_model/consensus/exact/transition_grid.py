"""The undisturbed flow ``xi' = -k N(t) xi`` on a grid of short cells: what the exact worst case is summed over."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.consensus.weights.edge_weights import Piece

__all__ = ["TransitionGrid", "affordable_resolution", "dose_between", "joined_flows", "transition_grid"]

_MOST_PER_PIECE = 100_000
_MOST_BLOCKS = 256
_TOGETHER = 4
_ENTRIES = 40_000


@dataclass(frozen=True, eq=False)
class TransitionGrid:
    """An interval cut into cells, with the transition matrix over each.

    Attributes
    ----------
    times : ndarray, shape (cells + 1,)
        Ends of the cells [s], ascending; every breakpoint of a weight is among them.
    flows : ndarray, shape (cells, n - 1, n - 1)
        ``phi(times[j + 1], times[j])``.
    doses : ndarray, shape (cells, m)
        Integral of each listed edge's weight over the cell.
    """

    times: NDArray[np.float64]
    flows: NDArray[np.float64]
    doses: NDArray[np.float64]

    @cached_property
    def is_idle(self) -> NDArray[np.bool_]:
        """Mask, shape (cells,), of the cells in which no edge carries weight."""
        return np.asarray(~self.doses.any(axis=1))

    def product(self) -> NDArray[np.float64]:
        """The transition matrix over the whole interval."""
        flow = np.eye(self.flows.shape[1])
        for cell in self.flows:
            flow = cell @ flow
        return flow

    def contraction(self, periods: int = 1) -> float:
        """Largest ``||phi(t + m P, t)||`` over the ends t of the cells of one period P, for m periods."""
        before, after, whole = self._halves
        inner = after if periods == 1 else np.linalg.matrix_power(whole, periods - 1) @ after
        return math.exp(_largest_log_norm(before @ inner, 0.0, -math.inf))

    @cached_property
    def _halves(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Flows from the start of the period to each cell, from each cell to the end, and over all of it."""
        size = self.flows.shape[1]
        forward = _running_products(self.flows)
        # From the right end the same, of the transposes.
        backward = _running_products(self.flows[::-1].transpose(0, 2, 1))
        before = np.concatenate((np.eye(size)[None], forward[:-1]))
        return before, backward[::-1].transpose(0, 2, 1), forward[-1]

    def overshoot(self, rate: float) -> float:
        """``sup ||phi(t, s)|| exp(rate (t - s))`` over starts s in the period and two periods after each.

        The supremum is over the ends of the cells. If there are many, they are joined to blocks, and what the
        exponential grows by within the two blocks of s and t is added: norms never grow, so that is never too little.
        """
        count, size = len(self.flows), self.flows.shape[1]
        step = -(-count // _MOST_BLOCKS)
        cuts = np.append(np.arange(0, count, step), count)
        lengths = np.diff(self.times[cuts])
        blocks = np.empty((len(lengths), size, size))
        for k, (first, last) in enumerate(pairwise(cuts.tolist())):
            flow = np.eye(size)
            for cell in self.flows[first:last]:
                flow = cell @ flow
            blocks[k] = flow
        places = np.arange(len(blocks))
        flows, ages, largest = np.broadcast_to(np.eye(size), blocks.shape), np.zeros(len(blocks)), 0.0
        # Small matrices are looked at many at a time.
        many = max(1, _ENTRIES // blocks.size)
        for first in range(0, 2 * len(blocks), many):
            products, spans = [], []
            for j in range(first, min(first + many, 2 * len(blocks))):
                at = (places + j) % len(blocks)
                flows, ages = blocks[at] @ flows, ages + lengths[at]
                products.append(flows)
                spans.append(ages)
            largest = _largest_log_norm(np.concatenate(products), rate * np.concatenate(spans), largest)
        within = 2 * rate * float(np.max(lengths)) if step > 1 else 0.0
        return float(np.exp(min(largest + within, 700.0)))


def _largest_log_norm(matrices: NDArray[np.float64], plus: NDArray[np.float64] | float, known: float) -> float:
    """The largest of ``log ||A|| + plus`` over matrices, shape (count, p, p), and of what is `known`.

    Both terms can leave the range of floats as factors; their product does not. ``||A||`` is computed where the norm of
    Frobenius, which is no smaller, leaves open whether it is the largest.
    """
    sizes = np.maximum(np.abs(matrices).max(axis=(1, 2)), np.finfo(float).tiny)
    scaled = matrices / sizes[:, None, None]
    scales = np.log(sizes) + plus
    ceilings = scales + 0.5 * np.log(np.maximum(np.einsum("kij,kij->k", scaled, scaled), 1.0))
    for rivals in (1, len(matrices)):
        chosen = np.argsort(-ceilings)[:rivals]
        chosen = chosen[ceilings[chosen] > known]
        if len(chosen):
            norms = np.maximum(np.linalg.norm(scaled[chosen], 2, axis=(1, 2)), np.finfo(float).tiny)
            known = max(known, float(np.max(scales[chosen] + np.log(norms))))
    return known


def _running_products(flows: NDArray[np.float64]) -> NDArray[np.float64]:
    """``flows[j] @ ... @ flows[0]`` for each j: in rows side by side, then each row after those before it."""
    count, size = len(flows), flows.shape[1]
    length = math.isqrt(count - 1) + 1
    padding = np.broadcast_to(np.eye(size), (-count % length, size, size))
    rows = np.concatenate((flows, padding)).reshape(-1, length, size, size)
    for k in range(1, length):
        rows[:, k] = rows[:, k] @ rows[:, k - 1]
    flow = rows[0, -1]
    for row in rows[1:]:
        row[:] = row @ flow
        flow = row[-1]
    return rows.reshape(-1, size, size)[:count]


def transition_grid(
    scenario: Scenario, t0: float, t1: float, resolution: float, longest: float = np.inf, *, joined: bool = False
) -> TransitionGrid:
    """Cut an interval so finely that the flow hardly changes over a cell.

    Parameters
    ----------
    scenario : Scenario
        Network, weights and switching.
    t0, t1 : float
        The interval [s].
    resolution : float
        ``k ||int N||`` of a cell, on the average over each piece.
    longest : float
        Largest length [s] of a cell in which some edge carries weight.
    joined : bool
        Whether cells that are much shorter than `resolution` and `longest` ask for, because a weight oscillates, are
        joined by fours once their flows are known.

    Notes
    -----
    On a piece whose active edges share a carrier the flow is a matrix exponential of the exact integral, so it is exact
    up to rounding. Elsewhere a cell's flow is the exponential of the Magnus series: the first term from the exact
    integrals of the weights, the commutator from two Gauss points. Its error is of the fifth order in the length.
    """
    factor = signal_factor(scenario, Signal.DISAGREEMENT)
    gain = scenario.network.gain
    cuts, flows, doses = [np.array([t0])], [], []
    for piece in scenario.edge_weights.pieces(t0, t1):
        count, each = _counts(piece, gain, factor, resolution, longest)
        times = np.linspace(piece.start, piece.end, count * each + 1)
        dose = piece.amplitudes * np.stack([c.integral(times[:-1], times[1:]) for c in piece.carriers], axis=-1)
        flow = _flows(piece, gain, factor, times, dose)
        if joined and each >= _TOGETHER:
            parts = dose.reshape(-1, _TOGETHER, dose.shape[1])
            flow, dose, times = joined_flows(flow, _TOGETHER), parts.sum(axis=1), times[::_TOGETHER]
        flows.append(flow)
        doses.append(dose)
        cuts.append(times[1:])
    return TransitionGrid(np.concatenate(cuts), np.concatenate(flows), np.concatenate(doses))


def affordable_resolution(scenario: Scenario, t0: float, t1: float, resolution: float, most: int) -> float:
    """`resolution`, or what leaves about `most` cells between `t0` and `t1` [s] if the weights are so large."""
    return max(resolution, dose_between(scenario, t0, t1) / most)


def dose_between(scenario: Scenario, t0: float, t1: float) -> float:
    """``k ||int N||`` over each piece between `t0` and `t1` [s], added up."""
    factor, gain = signal_factor(scenario, Signal.DISAGREEMENT), scenario.network.gain
    return sum(_spent(piece, gain, factor) for piece in scenario.edge_weights.pieces(t0, t1) if not piece.is_idle)


def _spent(piece: Piece, gain: float, factor: NDArray[np.float64]) -> float:
    dose = piece.amplitudes * np.array([float(c.integral(piece.start, piece.end)) for c in piece.carriers])
    return gain * float(np.linalg.eigvalsh((factor * dose) @ factor.T)[-1])


def _counts(
    piece: Piece, gain: float, factor: NDArray[np.float64], resolution: float, longest: float
) -> tuple[int, int]:
    """Number of cells, and into how many parts each is cut so that the carriers are smooth over a part."""
    if piece.is_idle:
        return 1, 1
    length = piece.end - piece.start
    steps = max(_spent(piece, gain, factor) / resolution, length / longest)
    count, each = int(np.clip(np.ceil(steps), 1, _MOST_PER_PIECE)), 1
    if piece.shared_carrier is None:
        # The Magnus series needs carriers that are smooth over a part: 64 parts a half wave make its error negligible.
        fine = 64 * length * max(_rate(carrier) for carrier in piece.carriers) / np.pi
        each = int(np.clip(np.ceil(fine / count), 1, max(1, _MOST_PER_PIECE // count)))
    # Parts that may be joined later come in full groups.
    return count, each if each < _TOGETHER else -(-each // _TOGETHER) * _TOGETHER


def joined_flows(flows: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Products of `count` consecutive flows, the last of them of as many as are left."""
    padding, size = -len(flows) % count, flows.shape[1]
    padded = np.concatenate((flows, np.broadcast_to(np.eye(size), (padding, size, size))))
    parts = padded.reshape(-1, count, size, size)
    product = parts[:, 0]
    for k in range(1, count):
        product = parts[:, k] @ product
    return product


def _rate(carrier: Carrier) -> float:
    return float(getattr(carrier, "rate", 0.0))


def _flows(
    piece: Piece, gain: float, factor: NDArray[np.float64], times: NDArray[np.float64], dose: NDArray[np.float64]
) -> NDArray[np.float64]:
    size, cells = factor.shape[0], len(times) - 1
    if piece.is_idle:
        return np.broadcast_to(np.eye(size), (cells, size, size)).copy()
    carrier = piece.shared_carrier
    if carrier is not None:
        eigenvalues, vectors = np.linalg.eigh((factor * piece.amplitudes) @ factor.T)
        spans = np.asarray(carrier.integral(times[:-1], times[1:]))
        decay = np.exp(-gain * spans[:, None] * eigenvalues)
        return np.asarray((vectors * decay[:, None, :]) @ vectors.T)
    lengths = np.diff(times)
    middle, offset = (times[:-1] + times[1:]) / 2, lengths / (2 * np.sqrt(3.0))
    early, late = (_matrices(piece, factor, middle + sign * offset) for sign in (-1, 1))
    first = -gain * ((factor * dose[:, None, :]) @ factor.T)
    second = gain**2 * (np.sqrt(3.0) / 12 * lengths**2)[:, None, None] * (late @ early - early @ late)
    return np.asarray(expm(first + second))


def _matrices(piece: Piece, factor: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    weights = piece.amplitudes * np.stack([carrier.value(times) for carrier in piece.carriers], axis=-1)
    return np.asarray((factor * weights[:, None, :]) @ factor.T)

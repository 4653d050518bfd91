"""All edge weights of a network together, the diagonal of the paper's W(t): waveforms and switching in one place."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.clocks.periods import common_period
from hybrid_model.consensus.switching.base import Switching
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.consensus.weights.waveform import Waveform

__all__ = ["EdgeWeights", "Piece", "WeightPrimitive"]

_MERGE = 16 * np.finfo(float).eps


@dataclass(frozen=True)
class Piece:
    """A time interval without breakpoints; on it ``w_e(t) = amplitudes[e]*carriers[e].value(t)``.

    Parameters
    ----------
    start, end : float
        The interval [s].
    amplitudes : ndarray, shape (m,)
        Constant on the interval; 0 for an edge that is switched off or whose gate is closed.
    carriers : tuple of Carrier
        One for each edge.
    """

    start: float
    end: float
    amplitudes: NDArray[np.float64]
    carriers: tuple[Carrier, ...]

    @property
    def is_idle(self) -> bool:
        """Whether no edge carries weight."""
        return not self.amplitudes.any()

    @property
    def shared_carrier(self) -> Carrier | None:
        """The carrier of all edges that carry weight, or None if there is no such edge or they differ."""
        active = {carrier for carrier, amplitude in zip(self.carriers, self.amplitudes, strict=True) if amplitude > 0}
        return active.pop() if len(active) == 1 else None


@dataclass(frozen=True)
class EdgeWeights:
    """Weights of all m edges as functions of time, switching included.

    Parameters
    ----------
    waveforms : tuple of Waveform
        One for each edge.
    switching : Switching
        Which edges are active when.

    Raises
    ------
    ValueError
        If the switching is made for another number of edges.
    """

    waveforms: tuple[Waveform, ...]
    switching: Switching

    def __post_init__(self) -> None:
        """Check that both parts mean the same edges."""
        if self.switching.edge_count != len(self.waveforms):
            raise ValueError(
                f"there are {len(self.waveforms)} waveforms, but the switching is for {self.switching.edge_count} "
                "edges; give one waveform for each edge."
            )

    @property
    def carriers(self) -> tuple[Carrier, ...]:
        """The carrier of each edge."""
        return tuple(waveform.carrier for waveform in self.waveforms)

    @cached_property
    def period(self) -> float | None:
        """A common period [s] of all weights; 0.0 if all are constant; None if there is none."""
        return common_period([self.switching.period, *(waveform.period for waveform in self.waveforms)])

    def amplitudes(self, t: float) -> NDArray[np.float64]:
        """Amplitudes of the edges at `t` [s], shape (m,); zero where an edge is not active."""
        amplitudes = np.array([float(waveform.amplitude(t)) for waveform in self.waveforms])
        return amplitudes * self.switching.active_at(t)

    def value(self, t: float) -> NDArray[np.float64]:
        """Weights of the edges at `t` [s], shape (m,): the diagonal of W(t)."""
        values = np.array([float(waveform.value(t)) for waveform in self.waveforms])
        return values * self.switching.active_at(t)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which a weight may jump or have a kink.

        Times that agree up to rounding (a gate and a switching instant that mean the same number) are merged.
        """
        times = np.unique(
            np.concatenate(
                [self.switching.breakpoints(t0, t1), *(waveform.breakpoints(t0, t1) for waveform in self.waveforms)]
            )
        )
        scale = max(abs(t0), abs(t1))
        is_new = np.diff(times, prepend=t0) > _MERGE * scale
        return times[is_new & (t1 - times > _MERGE * scale)]

    def pieces(self, t0: float, t1: float) -> list[Piece]:
        """The interval from `t0` to `t1` [s], cut at the breakpoints."""
        times = [t0, *self.breakpoints(t0, t1).tolist(), t1]
        carriers, spans = self.carriers, [(a, b) for a, b in pairwise(times) if a < b]
        # The amplitude is taken at the middle, where rounding of a boundary cannot pick the neighbouring segment.
        middles = np.array([(a + b) / 2 for a, b in spans])
        levels = np.array([waveform.amplitude(middles) for waveform in self.waveforms]).T
        return [
            Piece(a, b, level * self.switching.active_at(t), carriers)
            for (a, b), t, level in zip(spans, middles.tolist(), levels, strict=True)
        ]

    def primitive(self, start: float, end: float) -> "WeightPrimitive":
        """The integrals from `start` [s] as a function that is quick to call, for many times up to `end` [s]."""
        return WeightPrimitive(self.pieces(start, end))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integrals of the weights from `t0` to `t1` [s], shape (..., m) for broadcast times of shape (...)."""
        begin, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        first, last = float(min(begin.min(), end.min())), float(max(begin.max(), end.max()))
        cuts = np.array([first, *self.switching.breakpoints(first, last).tolist(), last])
        masks = np.array([self.switching.active_at((a + b) / 2) for a, b in pairwise(cuts)])
        columns = [
            _masked_integral(waveform, cuts, masks[:, edge], begin, end) for edge, waveform in enumerate(self.waveforms)
        ]
        return np.stack(columns, axis=-1)


class WeightPrimitive:
    """The function ``t -> int_start^t w ds`` of all edges, from closed forms on pieces.

    Parameters
    ----------
    pieces : list of Piece
        An interval, cut at the breakpoints; at least one piece.
    """

    def __init__(self, pieces: list[Piece]) -> None:
        self._cuts = np.array([piece.start for piece in pieces])
        self._amplitudes = np.array([piece.amplitudes for piece in pieces])
        # Edges that share a carrier need its integral only once.
        self._carriers = list(dict.fromkeys(pieces[0].carriers))
        self._which = np.array([self._carriers.index(carrier) for carrier in pieces[0].carriers])
        ends = np.array([piece.end for piece in pieces])
        steps = self._amplitudes * self._spans(self._cuts, ends)
        self._before = np.concatenate((np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)))

    def __call__(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Integrals up to `times` [s], shape (s,), within the interval; shape (s, m)."""
        place = np.clip(np.searchsorted(self._cuts, times, side="right") - 1, 0, len(self._amplitudes) - 1)
        return np.asarray(self._before[place] + self._amplitudes[place] * self._spans(self._cuts[place], times))

    def _spans(self, begins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Integral of each edge's carrier from `begins` to `ends` [s], shape (s, m)."""
        parts = np.stack([carrier.integral(begins, ends) for carrier in self._carriers], axis=-1)
        return np.asarray(parts[:, self._which])


def _masked_integral(
    waveform: Waveform,
    cuts: NDArray[np.float64],
    mask: NDArray[np.bool_],
    begin: NDArray[np.float64],
    end: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Integral of one waveform over the dwell intervals between `cuts` in which `mask` is true."""
    if mask.all():
        return waveform.integral(begin, end)
    before = np.concatenate(([0.0], np.cumsum(mask * waveform.integral(cuts[:-1], cuts[1:]))))

    def primitive(t: NDArray[np.float64]) -> NDArray[np.float64]:
        index = np.clip(np.searchsorted(cuts, t, side="right") - 1, 0, len(mask) - 1)
        return np.asarray(before[index] + mask[index] * waveform.integral(cuts[index], t))

    below, above = primitive(np.stack((begin, end)))
    return np.asarray(above - below)

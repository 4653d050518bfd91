"""The integral of the spectral norm of ``F diag(w(t)) F^T``, a function of time that is not linear in the weights."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.weights.edge_weights import EdgeWeights, Piece

__all__ = ["NormPrimitive"]

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(8)
_TOLERANCE = 1e-12
_SMALLEST_SHARE = 2.0**-20


class NormPrimitive:
    """The function ``t -> int_start^t ||F diag(w) F^T|| ds`` on an interval.

    Parameters
    ----------
    factor : ndarray, shape (r, m)
        F.
    weights : EdgeWeights
        w(t).
    start, end : float
        The interval [s].

    Notes
    -----
    On a piece whose active edges share a carrier s(t), the norm is s(t) times a constant and the integral is exact.
    Elsewhere the piece is halved until Gauss quadrature with 8 nodes agrees with that on the halves to a share of
    1e-12 of the piece's integral. Where two eigenvalues cross, the norm has a kink; the halving then ends at a
    millionth of the piece, where the kink costs less than 1e-10.
    """

    def __init__(self, factor: NDArray[np.float64], weights: EdgeWeights, start: float, end: float) -> None:
        """Cut the interval and integrate over each part once."""
        self._factor = factor
        cuts, norms, integrals = [start], [], []
        self._pieces: list[Piece] = []
        for piece in weights.pieces(start, end):
            norm = float(self._norms(piece.amplitudes[None, :])[0])
            for part in self._parts(piece):
                self._pieces.append(part)
                norms.append(norm)
                cuts.append(part.end)
                integrals.append(self._within(part, norm, part.end))
        self._cuts = np.array(cuts[:-1])
        self._amplitude_norms = norms
        self._before = np.concatenate(([0.0], np.cumsum(integrals)))

    def __call__(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at `times` [s], which must lie in the interval."""
        places = np.clip(np.searchsorted(self._cuts, times, side="right") - 1, 0, len(self._pieces) - 1).tolist()
        return np.array(
            [
                self._before[k] + self._within(self._pieces[k], self._amplitude_norms[k], t)
                for k, t in zip(places, times.tolist(), strict=True)
            ]
        )

    def _within(self, piece: Piece, amplitude_norm: float, t: float) -> float:
        """The integral from the start of `piece` to `t`."""
        if piece.is_idle:
            return 0.0
        carrier = piece.shared_carrier
        if carrier is not None:
            return float(amplitude_norm * carrier.integral(piece.start, t))
        return self._quadrature(piece, piece.start, t)

    def _quadrature(self, piece: Piece, start: float, end: float) -> float:
        half = (end - start) / 2
        times = start + half * (1 + _NODES)
        values = np.stack([carrier.value(times) for carrier in piece.carriers], axis=-1) * piece.amplitudes
        return float(half * _NODE_WEIGHTS @ self._norms(values))

    def _norms(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Largest eigenvalues for weights of shape (s, m)."""
        matrices = (self._factor * weights[:, None, :]) @ self._factor.T
        return np.asarray(np.linalg.eigvalsh(matrices)[:, -1])

    def _parts(self, piece: Piece) -> list[Piece]:
        """The piece, cut where quadrature needs it."""
        if piece.is_idle or piece.shared_carrier is not None:
            return [piece]
        fastest = max(carrier.rate for carrier in piece.carriers)
        count = max(1, math.ceil((piece.end - piece.start) * fastest * 4 / math.pi))
        cells = list(pairwise(np.linspace(piece.start, piece.end, count + 1).tolist()))
        wholes = [self._quadrature(piece, *cell) for cell in cells]
        tolerance, shortest = _TOLERANCE * sum(wholes), _SMALLEST_SHARE * (piece.end - piece.start)
        finished: list[Piece] = []
        stack = list(zip(cells, wholes, strict=True))[::-1]
        while stack:
            (start, end), whole = stack.pop()
            middle = (start + end) / 2
            left, right = self._quadrature(piece, start, middle), self._quadrature(piece, middle, end)
            if abs(left + right - whole) <= tolerance or end - start <= shortest:
                finished.append(Piece(start, end, piece.amplitudes, piece.carriers))
            else:
                stack += [((middle, end), right), ((start, middle), left)]
        return finished

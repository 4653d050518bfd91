"""Affine modes by matrix exponentials, and their threshold crossings by a root finder: nothing is integrated."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


class AffineMode:
    """``x' = matrix x + offset``, evaluated as the exponential of the matrix bordered by the offset."""

    def __init__(self, matrix, offset=None):
        n = len(matrix)
        self.bordered = np.zeros((n + 1, n + 1))
        self.bordered[:n, :n] = matrix
        self.bordered[:n, n] = 0.0 if offset is None else offset

    def at(self, x, tau):
        """State after `tau` from `x`."""
        return (expm(self.bordered * tau) @ [*x, 1.0])[:-1]

    def first_rise(self, x, margin, reach, pieces=200):
        """First time in (0, reach] at which ``margin(state)`` rises to zero, to 4 ulp; None if there is none.

        `pieces` must be fine enough for the margins at hand: each rise is bracketed by two neighbouring points.
        """

        def along(tau):
            return margin(self.at(x, tau))

        # The grid only brackets, so its states may come step by step.
        step = expm(self.bordered * (reach / pieces))
        state, before = np.array([*x, 1.0]), margin(np.asarray(x))
        for k in range(pieces):
            state = step @ state
            after = margin(state[:-1])
            if before < 0.0 <= after:
                bracket = np.array([k, k + 1]) * (reach / pieces)
                return brentq(along, *bracket, xtol=1e-15 * bracket[1], rtol=4 * np.finfo(float).eps)
            before = after
        return None

"""What the flow of an automaton is made of, as far as its dependencies tell: nothing has to be declared for it.

Where rates depend on no continuous state, the flow is a quadrature; where they depend on states that are quadratures
themselves, it is one after another. The engine then integrates polynomials (hybrid_model/engine/methods/quadrature.c).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

__all__ = ["MOST_LEVELS", "levels_of_quadratures"]

MOST_LEVELS = 8
"""Longer chains count as none: each level costs the rates at all nodes of a step."""


def levels_of_quadratures(pattern: sparse.csr_array) -> int:
    """Return in how many quadratures, one after another, a flow is found.

    Parameters
    ----------
    pattern : csr_array of bool, shape (n, n)
        Which rates (rows) depend on which states (columns).

    Returns
    -------
    int
        1 where no rate depends on a state, 2 where some depend on states whose own rates do not, and so on; 0 where
        some states depend on themselves, or on each other in a circle, or where there are more than `MOST_LEVELS`, or
        no state.
    """
    depends = pattern.astype(np.int64)
    open_states = np.ones(pattern.shape[0], dtype=np.int64)
    for level in range(MOST_LEVELS + 1):
        if not open_states.any():
            return level
        waits = depends @ open_states > 0
        if np.array_equal(waits, open_states > 0):
            return 0
        open_states = waits.astype(np.int64)
    return 0

"""Set algebra on margins, in a form that runs on floats and traces on symbols."""

from __future__ import annotations

from functools import reduce

import numpy as np

from hybrid_model.declare.variables import Value
from hybrid_model.errors import DeclarationError


def least(*margins: Value) -> Value:
    """Return the smallest margin: the intersection of sets ("and").

    Parameters
    ----------
    *margins : float, array or symbol
        Margins of the sets; for arrays elementwise.
    """
    return reduce(np.minimum, _some(margins))


def greatest(*margins: Value) -> Value:
    """Return the largest margin: the union of sets ("or").

    Parameters
    ----------
    *margins : float, array or symbol
        Margins of the sets; for arrays elementwise.
    """
    return reduce(np.maximum, _some(margins))


def _some(margins: tuple[Value, ...]) -> tuple[Value, ...]:
    if not margins:
        raise DeclarationError(
            "no margin is given to least or greatest: write least(first, second), or *margins for a list."
        )
    return margins

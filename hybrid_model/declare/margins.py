"""What maps are written with beside numpy, on floats and on symbols: set algebra on margins, and tables."""

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


def lookup(table: Value, index: Value) -> Value:
    """Return the entry of a table at a place, such as a discrete state that counts.

    Parameters
    ----------
    table : array_like or symbol, shape (n,) or (n, m)
        The entries, or rows of entries.
    index : float, int or symbol
        The place, from 0; the nearest whole number of it. Before the first entry it is the first, beyond the last the
        last.

    Returns
    -------
    float or symbol, or of shape (m,) for a table of rows

    Raises
    ------
    DeclarationError
        If the table has no entries, or more than two dimensions.
    """
    shape = np.shape(table)
    if len(shape) not in (1, 2) or shape[0] == 0:
        raise DeclarationError(f"a table of shape {shape} cannot be looked up: give a list of entries, or of rows.")
    place = np.minimum(np.maximum(index, 0.0), shape[0] - 1.0)
    # The entry itself is chosen, not a sum with zeros, so that infinite entries stay what they are.
    entry = table[0]
    for number in range(1, shape[0]):
        entry = np.where(place >= number - 0.5, table[number], entry)
    return entry[()] if isinstance(entry, np.ndarray) else entry


def _some(margins: tuple[Value, ...]) -> tuple[Value, ...]:
    if not margins:
        raise DeclarationError(
            "no margin is given to least or greatest: write least(first, second), or *margins for a list."
        )
    text = next((margin for margin in margins if isinstance(margin, str)), None)
    if text is not None:
        raise DeclarationError(f"{text!r} is no margin: least and greatest take numbers, such as s.h.")
    return margins

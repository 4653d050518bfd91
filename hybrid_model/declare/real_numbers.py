"""What counts as a real number: Python's and NumPy's, but no text, no None, and nothing complex."""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np
import numpy.typing as npt

REAL = "biuf"
"""Kinds of NumPy types that are real numbers; yes and no count as 1 and 0."""
FLOATS = (float, np.float64)
"""What a map returns most often."""
LONGEST = 80
"""Characters of a value that a message shows; a number may have thousands of digits."""


def is_real(given: object) -> bool:
    """Whether something is one real number."""
    return isinstance(given, numbers.Real)


def real_array(given: Any) -> npt.NDArray[np.float64]:
    """Return numbers as an array of floats.

    NumPy alone reads the text ``"1"`` as 1, makes None a number that is none, and drops imaginary parts.

    Parameters
    ----------
    given : array_like
        Numbers of any type that has a float value, such as fractions.

    Returns
    -------
    ndarray
        Of the shape of `given`.

    Raises
    ------
    TypeError, ValueError, OverflowError
        If something in it is no real number, is ragged, or is too large for a float.
    """
    array = np.asarray(given)
    if array.dtype.kind == "O":
        if not all(hasattr(element, "__float__") for element in array.ravel()):
            raise TypeError("not all elements are real numbers")
    elif array.dtype.kind not in REAL:
        raise TypeError(f"{array.dtype} is no type of real numbers")
    return array.astype(np.float64)


def told(given: Any) -> str:
    """Return how a message shows what is no real number."""
    try:
        shown = repr(given)
    except ValueError:  # Python refuses to write a whole number with thousands of digits.
        return f"a whole number beyond {LONGEST} digits"
    shown = shown if len(shown) <= LONGEST else f"{shown[:LONGEST]}..."
    numeric = isinstance(given, (complex, np.ndarray, np.generic))
    return f"{shown}, a complex number" if numeric and np.iscomplexobj(given) else shown

"""What the maps of an automaton return, looked at in each call: slips of authors are told by name."""

from __future__ import annotations

import numbers
from collections.abc import Mapping, Sequence
from types import FunctionType

import numpy as np

from hybrid_model.declare.real_numbers import FLOATS, real_array, told
from hybrid_model.declare.transitions import Assignments
from hybrid_model.declare.variables import Value
from hybrid_model.errors import DeclarationError

NO_SYMBOLS = (str, bytes, numbers.Complex, tuple, list, dict, set, type(None), FunctionType, np.ndarray, np.generic)
"""What a map may return in the place of a number by mistake; anything else can be an expression of a trace."""


def explain(owner: str, cls: type, what: str, error: ValueError) -> None:
    """Say what is wrong if a map has written into what it was given, or names a number of the class as a variable.

    Parameters
    ----------
    owner, cls
        The automaton's name, and its class.
    what : str
        Which map.
    error : ValueError
        What the map raised.

    Raises
    ------
    DeclarationError
        With the remedy, if there is one to be added.
    """
    if isinstance(error, DeclarationError):
        held = vars(cls).get(str(error.name))
        if isinstance(held, numbers.Real):
            raise DeclarationError(
                f"{error} {cls.__name__}.{error.name} = {held!r} is a plain number, no declaration: write "
                f"{error.name} = hm.State({held!r}), or hm.Parameter({held!r}) for what is fixed in a run."
            ) from error
    elif "read-only" in str(error):
        raise DeclarationError(
            f"{what} of {owner} writes into a value that it was given: work on a copy, s.x.copy(), and return that."
        ) from error


def checked_assignments(
    owner: str, what: str, values: Assignments, allowed: Sequence[str], required: Sequence[str]
) -> Assignments:
    """Return what a map gives to variables: a dictionary of those allowed, with those required."""
    # One comparison in the good case: this runs in the inner loop of every execution.
    if not isinstance(values, Mapping):
        raise DeclarationError(f"{what} of {owner} returned {values!r}: return a dictionary, name -> value.")
    wrong = [key for key in values if key not in allowed]
    if wrong:
        raise DeclarationError(f"{what} of {owner} sets {wrong}, but may set only {list(allowed)}.", name=wrong[0])
    missing = [key for key in required if key not in values]
    if missing:
        raise DeclarationError(f"{what} of {owner} must also give {missing}.")
    return values


def checked_margin(owner: str, what: str, margin: Value) -> Value:
    """Return the margin of a set: a scalar, a number and no yes or no."""
    if type(margin) in FLOATS:
        return margin
    if _is_indicator(margin):
        raise DeclarationError(
            f"{what} of {owner} is {_kind_of(margin)}: return a margin instead, a number that is zero or above "
            "inside the set (for h <= 0 return -h; join conditions with least for 'and', greatest for 'or')."
        )
    if margin is None:
        raise DeclarationError(f"{what} of {owner} is None: return a margin, zero or above inside the set.")
    if isinstance(margin, np.ndarray) and margin.ndim > 0:
        raise DeclarationError(
            f"{what} of {owner} has shape {margin.shape}, but a margin is a scalar: join the elements with "
            "np.min for 'all of them', np.max for 'any of them'."
        )
    return checked_scalar(owner, what, "a margin, one number that is zero or above inside the set", margin)


def checked_scalar(owner: str, what: str, wanted: str, value: Value) -> Value:
    """Return one number, or an expression of a trace."""
    if type(value) in FLOATS:
        return value
    if not isinstance(value, NO_SYMBOLS) or (isinstance(value, np.ndarray) and value.dtype.kind == "O"):
        return value
    try:
        number = real_array(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(f"{what} of {owner} is {told(value)}: return {wanted}.") from error
    if number.shape:
        raise DeclarationError(f"{what} of {owner} has shape {number.shape}: return {wanted}.")
    return float(number)


def _is_indicator(margin: Value) -> bool:
    """Whether a margin says yes or no only: values of states are floats, so whole numbers come from conditions."""
    if isinstance(margin, (bool, int, np.bool_, np.integer)):
        return True
    return isinstance(margin, np.ndarray) and margin.dtype.kind in "biu"


def _kind_of(margin: Value) -> str:
    return "a boolean" if np.asarray(margin).dtype.kind == "b" else f"the whole number {margin}"

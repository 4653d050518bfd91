"""Scalars in arrays by the names that FMUs, tables and plots have for them: ``v[1]``, and row by row ``m[2,1]``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.errors import DeclarationError

FloatArray = npt.NDArray[np.float64]
_ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


def split_element(name: object) -> tuple[str, tuple[int, ...]] | None:
    """Return the array and the place, from 0, that the name of an element tells; None for other names."""
    found = _ELEMENT.fullmatch(name) if isinstance(name, str) else None
    return (found[1], tuple(int(number) - 1 for number in found[2].split(","))) if found else None


def no_element(owner: str, name: str, whole: str, shape: tuple[int, ...]) -> str:
    """Return the sentence for an element that the variable `whole` does not have."""
    last = ",".join(map(str, shape))
    what = f"an array of {whole}[{','.join('1' * len(shape))}] to {whole}[{last}]" if shape else "a scalar"
    return f"{owner} has no {name}: {whole} is {what}."


def require_element(owner: str, name: str, whole: str, place: tuple[int, ...], shape: tuple[int, ...]) -> None:
    """Refuse the name of an element that an array of that shape does not have.

    Raises
    ------
    DeclarationError
        With the elements that there are.
    """
    if len(place) != len(shape) or not all(0 <= k < length for k, length in zip(place, shape, strict=True)):
        raise DeclarationError(no_element(owner, name, whole, shape))


def filled(start: FloatArray, values: Mapping[tuple[int, ...], Any]) -> Any:
    """Return an array with other values at some places; they may be anything, and are judged where arrays are."""
    array = start.astype(object)
    for place, value in values.items():
        array[place] = value
    return array


def gathered(
    owner: str,
    arrays: Mapping[str, FloatArray],
    given: Mapping[str, Any],
    join: Callable[[FloatArray, Mapping[tuple[int, ...], Any]], Any] = filled,
) -> dict[str, Any]:
    """Return what is given by name, with what is given for elements joined to something for their array.

    Parameters
    ----------
    owner : str
        The automaton's name, for messages.
    arrays : mapping
        Variable -> its start value, which says its shape.
    given : mapping
        Name of a variable or of an element, such as ``v[1]`` -> anything.
    join : callable
        Start value, and place from 0 -> what is given there: what is given for the array.

    Raises
    ------
    DeclarationError
        For an element that its array does not have, or where the whole array is given as well.
    """
    found: dict[str, dict[tuple[int, ...], Any]] = {}
    whole_ones = {}
    for name, value in given.items():
        whole, place = split_element(name) or (name, ())
        if name in arrays or whole not in arrays:
            whole_ones[name] = value
            continue
        require_element(owner, name, whole, place, arrays[whole].shape)
        if whole in given:
            raise DeclarationError(f"{owner}: {whole} is given as a whole and as {name}: leave one of them out.")
        found.setdefault(whole, {})[place] = value
    return whole_ones | {whole: join(arrays[whole], values) for whole, values in found.items()}

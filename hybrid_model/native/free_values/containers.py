"""What containers and arrays hold, also those of subclasses, read without calling methods of theirs."""

from __future__ import annotations

from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable
from hashlib import blake2b
from typing import Any

import numpy as np

from hybrid_model.native.free_values.reading import Reading, UntoldError

_LONG = 100

Items = Callable[[Any], tuple[Any, ...]]

CONTAINERS: dict[type, Items] = {
    list: lambda value: tuple(list.__iter__(value)),
    defaultdict: lambda value: (value.default_factory, *dict.__iter__(value), *dict.values(value)),
    OrderedDict: lambda value: (*OrderedDict.__iter__(value), *OrderedDict.values(value)),
    dict: lambda value: (*dict.__iter__(value), *dict.values(value)),
    tuple: lambda value: tuple(tuple.__iter__(value)),
    set: lambda value: tuple(set.__iter__(value)),
    frozenset: lambda value: tuple(frozenset.__iter__(value)),
    deque: lambda value: tuple(deque.__iter__(value)),
    # Their elements are small numbers, which are the same objects always.
    bytearray: lambda value: tuple(bytearray.__iter__(value)),
}
"""Type -> function that returns all that one of its values holds; subclasses first."""


def items_of(reading: Reading, items: Items, value: Any) -> list[object]:
    """Return tokens of what a container holds, and watch it."""
    reading.watch.content(items, value)
    return reading.tokens(items(value))


def content(reading: Reading, array: np.ndarray[Any, Any]) -> list[object]:
    """Return tokens of the shape, the type and the elements of an array, and watch them.

    Raises
    ------
    UntoldError
        For arrays of records, whose fields can be renamed.
    """
    if array.dtype.names is not None:
        raise UntoldError("a map reads an array of records")
    if array.dtype.hasobject:
        return ["objects", array.shape, *items_of(reading, _objects, array)]
    reading.watch.array(array)
    elements = np.ndarray.tobytes(array)
    return ["array", array.dtype.str, array.shape, elements if len(elements) < _LONG else blake2b(elements).digest()]


def _objects(array: np.ndarray[Any, Any]) -> tuple[Any, ...]:
    return tuple(np.ndarray.ravel(array).tolist())

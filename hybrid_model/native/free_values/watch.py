"""What was read, beside what it is now: compared by identity, arrays by their content, in as few steps as possible.

Objects that are held here cannot give their identity to others. Nothing that was read is called or compared by a method
of its own. In doubt something has changed: an equal value in a new object counts as another one.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterable, Mapping
from itertools import chain
from operator import attrgetter, is_
from types import CellType, FunctionType, MemberDescriptorType
from typing import Any

import numpy as np

MISSING = object()
"""Stands for a name that is not there, and for an empty cell."""

Array = np.ndarray[Any, Any]

_attributes_of = attrgetter("__dict__")
_parts_of_function = attrgetter("__code__", "__name__", "__defaults__", "__kwdefaults__", "__dict__")
_parts_of_class = attrgetter("__mro__", "__name__", "__qualname__")


class Watch:
    """What a walk has come across, as it was then."""

    def __init__(self) -> None:
        self._objects: list[object] = []
        self._owners: list[object] = []
        self._dictionaries: list[dict[Any, Any]] = []
        self._functions: list[FunctionType] = []
        self._classes: list[type] = []
        self._cells: list[CellType] = []
        self._lookups: list[tuple[Mapping[str, Any], tuple[str, ...]]] = []
        self._contents: list[tuple[Callable[[Any], tuple[Any, ...]], Any]] = []
        self._arrays: list[tuple[Array, Any, tuple[int, ...], bytes]] = []
        self._kinship: object = None
        self._sizes: list[int] = []
        self._then: list[tuple[Any, ...]] = []

    def instance(self, value: object) -> None:
        """Watch the class of an object and its attributes."""
        self._objects.append(value)
        attributes = getattr(value, "__dict__", None)
        if isinstance(attributes, dict):
            self._owners.append(value)
            self._dictionaries.append(attributes)

    def dictionary(self, value: dict[Any, Any]) -> None:
        """Watch the keys and values of a dictionary, in order."""
        self._dictionaries.append(value)

    def content(self, read: Callable[[Any], tuple[Any, ...]], value: object) -> None:
        """Watch what a function of ours reads from a value."""
        self._contents.append((read, value))

    def array(self, value: Array) -> None:
        """Watch the content of an array of numbers."""
        self._arrays.append((value, value.dtype, value.shape, np.ndarray.tobytes(value)))

    def function(self, value: FunctionType) -> None:
        """Watch the code of a function, its name, its defaults and its attributes."""
        self._functions.append(value)
        self._dictionaries.append(vars(value))
        if value.__kwdefaults__:
            self._dictionaries.append(value.__kwdefaults__)

    def of_class(self, value: type) -> None:
        """Watch all attributes of a class, its name and its bases."""
        self._classes.append(value)

    def cell(self, value: CellType) -> None:
        """Watch a variable of an enclosing function."""
        self._cells.append(value)

    def names(self, where: Mapping[str, Any], names: Iterable[str]) -> None:
        """Watch what names stand for in a dictionary, such as that of a module."""
        self._lookups.append((where, tuple(names)))

    def kinship(self) -> None:
        """Watch which classes count as derived from abstract ones without being so."""
        self._kinship = abc.get_cache_token()

    def close(self) -> None:
        """Note what everything is now."""
        self._sizes = self._sizes_now()
        self._then = list(map(tuple, self._now()))

    def still_holds(self) -> bool:
        """Whether everything is what it was."""
        # Where all sizes are what they were, `map` leaves nothing out.
        return (
            self._kinship in (None, abc.get_cache_token())
            and self._sizes_now() == self._sizes
            and all(all(map(is_, now, then)) for now, then in zip(self._now(), self._then, strict=True))
            and all(_is_content(*array) for array in self._arrays)
        )

    def _sizes_now(self) -> list[int]:
        sizes = list(map(dict.__len__, self._dictionaries))
        sizes += [len(vars(cls)) for cls in self._classes]
        return sizes + [len(read(value)) for read, value in self._contents]

    def _now(self) -> list[Iterable[Any]]:
        bodies = [vars(cls) for cls in self._classes]
        return [
            map(type, self._objects),
            map(_attributes_of, self._owners),
            chain.from_iterable(map(dict.__iter__, self._dictionaries)),
            chain.from_iterable(map(dict.values, self._dictionaries)),
            chain.from_iterable(map(_parts_of_class, self._classes)),
            chain.from_iterable(bodies),
            chain.from_iterable([body.values() for body in bodies]),
            chain.from_iterable(map(_parts_of_function, self._functions)),
            map(_content_of_cell, self._cells),
            [where.get(name, MISSING) for where, names in self._lookups for name in names],
            chain.from_iterable([read(value) for read, value in self._contents]),
        ]


def _is_content(array: Array, dtype: Any, shape: tuple[int, ...], content: bytes) -> bool:
    return array.shape == shape and array.dtype == dtype and np.ndarray.tobytes(array) == content


def _content_of_cell(cell: CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:
        return MISSING


def slots_of(value: object) -> tuple[Any, ...]:
    """Return the attributes of an object that are in no dictionary, base classes last."""
    found = []
    for body in map(vars, type(value).__mro__):
        if "__slots__" not in body:
            continue
        for descriptor in body.values():
            if type(descriptor) is MemberDescriptorType:
                try:
                    found.append(descriptor.__get__(value))
                except AttributeError:
                    found.append(MISSING)
    return tuple(found)

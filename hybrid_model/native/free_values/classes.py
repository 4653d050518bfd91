"""What classes and their instances hold."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from operator import is_
from types import ClassMethodDescriptorType, GetSetDescriptorType, MethodDescriptorType, WrapperDescriptorType
from typing import Any, NamedTuple

import numpy as np

from hybrid_model.declare.transitions import Clock
from hybrid_model.declare.variables import ClassAttribute
from hybrid_model.native.free_values import known
from hybrid_model.native.free_values.containers import CONTAINERS, content, items_of
from hybrid_model.native.free_values.reading import Reading, UntoldError
from hybrid_model.native.free_values.watch import MISSING, slots_of

KEPT = "_kept_snapshot"
"""Attribute of an automaton that holds what was found out about it; no map reads it."""
_MAKING = frozenset(("__init__", "__new__", "__post_init__", "__init_subclass__", "__set_name__", "__class_getitem__"))
"""What runs when an instance or a subclass is made."""
_SIMPLE = (int, float, complex, str, bytes)
_ROOTS = (object, *CONTAINERS, np.ndarray, *_SIMPLE, BaseException, type)
_MADE_AT_RUN_TIME = 1 << 9
_OF_C = (WrapperDescriptorType, MethodDescriptorType, ClassMethodDescriptorType, GetSetDescriptorType)


class _Traits(NamedTuple):
    """What can be said of a class.

    It is `known`; all state of an instance can be seen, as it is `plain`; an instance is `fixed`, being one of a frozen
    class of the framework; any attribute may be `read` by code that is not looked at.
    """

    known: bool
    plain: bool
    fixed: bool
    read: bool


_found: dict[int, tuple[weakref.ref[type], tuple[type, ...], _Traits]] = {}
"""Identity of a class -> itself, its bases and its traits, as long as it lives."""


def describe_class(reading: Reading, number: int, cls: type) -> None:
    """Describe a class: its bases, and those of its attributes that code can read."""
    traits = _traits(cls)
    if traits.known:
        reading.known_code(cls)
        reading.record(number, "known class", cls.__module__, cls.__qualname__)
        return
    if not made_in_python(cls):
        raise UntoldError(f"a map reads the class {cls.__module__}.{cls.__qualname__}")
    reading.watch.of_class(cls)
    bases = map(reading.reference, cls.__mro__[1:])
    reading.record(number, "class", cls.__name__, cls.__qualname__, reading.reference(type(cls)), *bases)
    making: list[tuple[str, object]] = []
    for name, held in vars(cls).items():
        if name in _MAKING or issubclass(type(held), (ClassAttribute, Clock)):
            making.append((name, held))
        else:
            # Operators and the like are read without a name.
            reading.attribute(number, name, held, read=traits.read or name.startswith("__"))
    reading.making(number, cls, making)
    for word in vars(cls).get("__match_args__", ()):
        reading.word(word)


def describe_instance(reading: Reading, number: int, value: Any) -> None:
    """Describe an object: its class, what it holds as a container, and those of its attributes that code can read."""
    cls = type(value)
    traits = _traits(cls)
    if not traits.plain:
        raise UntoldError(f"a map reads a value of the class {cls.__module__}.{cls.__qualname__}")
    if not traits.fixed:
        reading.watch.instance(value)
    reading.record(number, "instance", reading.reference(cls), *_content_of(reading, value))
    slots = slots_of(value)
    if slots:
        reading.watch.content(slots_of, value)
        reading.record(number, "slots", *[("missing",) if item is MISSING else reading.token(item) for item in slots])
    attributes = getattr(value, "__dict__", None)
    if isinstance(attributes, dict):
        reading.attributes(number, {name: item for name, item in attributes.items() if name != KEPT}, read=traits.read)


def _content_of(reading: Reading, value: Any) -> list[object]:
    """Return tokens of what an instance of a subclass holds as a container, array, number or text."""
    for kind, items in CONTAINERS.items():
        if issubclass(type(value), kind):
            return [kind.__name__, *items_of(reading, items, value)]
    if issubclass(type(value), np.ndarray):
        return content(reading, value)
    simple: Callable[[Any], str] | None = next(
        (kind.__repr__ for kind in _SIMPLE if issubclass(type(value), kind)), None
    )
    return [] if simple is None else [simple(value)]


def _traits(cls: type) -> _Traits:
    found = _found.get(id(cls))
    bases = cls.__mro__[1:]
    if found is not None and found[0]() is cls and len(found[1]) == len(bases) and all(map(is_, found[1], bases)):
        return found[2]
    is_known = known.is_known(cls)
    is_fixed = is_known and getattr(vars(cls).get("__dataclass_params__"), "frozen", False)
    traits = _Traits(is_known, _is_plain(cls), is_fixed, known.has_reading_base(cls))
    key = id(cls)
    _found[key] = weakref.ref(cls, lambda _: _found.pop(key, None)), bases, traits
    return traits


def _is_plain(cls: type) -> bool:
    """Whether all state of an instance is in its attributes and in what containers of Python hold."""
    while cls not in _ROOTS:
        if not made_in_python(cls) or not _shows_attributes(cls):
            return False
        cls = cls.__base__ or object
    return True


def _shows_attributes(cls: type) -> bool:
    """Whether the attributes of an instance are those in its dictionary and slots, and no method is in the way."""
    body = vars(cls)
    return "__getattribute__" not in body and (
        "__dict__" not in body or isinstance(body["__dict__"], GetSetDescriptorType)
    )


def made_in_python(cls: type) -> bool:
    """Whether a class was written in Python: those written in C have methods in C, and room for state of their own."""
    if not cls.__flags__ & _MADE_AT_RUN_TIME:
        return False
    body = vars(cls)
    own = [name for name, held in body.items() if isinstance(held, _OF_C) and held.__objclass__ is cls]
    slots = body.get("__slots__", ())
    room = 8 * (2 + (1 if isinstance(slots, str) else len(slots)))
    base = cls.__base__ or object
    return set(own) <= {"__dict__", "__weakref__"} and cls.__basicsize__ - base.__basicsize__ <= room

"""Parts that need no trace of their own: those that differ from a traced part only in what its maps did not look at.

A trace follows from the classes of the objects whose maps run and from the attributes that these read. While a part is
traced its attributes are watched; another part of the same classes with equal values of the attributes read has the
same trace. In doubt - an attribute of a type that is not known here, a look at the whole ``__dict__`` - parts differ.
"""

from __future__ import annotations

import enum
import functools
import struct
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.hybrid_automaton import HybridAutomaton
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.modes import ModalAutomaton
from hybrid_model.declare.variables import Variable
from hybrid_model.native.trace import Trace

_MESSAGES = frozenset(cls.__module__ for cls in (HybridAutomaton, ModalAutomaton, Composition, Layout, Trace))
"""Modules that read an automaton's name for messages only."""
_SHAPE = ("shape", "size")
"""Properties of variables that read the start value for its shape only."""
_EVERYTHING = "__dict__"
_UNSEEN = ("start", "unit", "description")
"""What variables of kin may differ in, unless maps look at it."""

Reads = Mapping[int, set[str]]
"""Identity of an object -> names of the attributes that were read."""


class Kin:
    """A traced part, and what its maps looked at.

    Parameters
    ----------
    part : Automaton
        The part.
    reads : mapping
        As `watched` gives it.
    """

    def __init__(self, part: Automaton, reads: Reads) -> None:
        self._part, self._reads = part, reads

    def has(self, other: Automaton) -> bool:
        """Whether a trace of another part would give the same expressions."""
        return self._alike(self._part, other, set())

    def _alike(self, a: Any, b: Any, seen: set[tuple[int, int]]) -> bool:
        if type(a) is not type(b):
            return False
        if a is b or (id(a), id(b)) in seen:
            return True
        if isinstance(a, float):
            return struct.pack("d", a) == struct.pack("d", b)
        if a is None or isinstance(a, int | str | bytes | enum.Enum):
            return bool(a == b)
        seen.add((id(a), id(b)))
        compare = functools.partial(self._alike, seen=seen)
        if isinstance(a, np.ndarray | np.generic):
            return a.dtype == b.dtype and a.dtype != object and a.shape == b.shape and a.tobytes() == b.tobytes()
        if type(a) in (tuple, list):
            return len(a) == len(b) and all(map(compare, a, b))
        if type(a) is dict:
            return list(a) == list(b) and all(map(compare, a.values(), b.values()))
        if isinstance(a, Automaton):
            return self._alike_attributes(a, b, compare)
        if isinstance(a, Variable):
            return a.shape == b.shape and all(compare(getattr(a, name), getattr(b, name)) for name in self._visible(a))
        if is_dataclass(a) and hasattr(a, "__dict__") and _is_frozen(type(a)):
            return compare(vars(a), vars(b))
        return False

    def _alike_attributes(self, a: Automaton, b: Automaton, compare: Callable[[Any, Any], bool]) -> bool:
        read = self._reads.get(id(a), {_EVERYTHING})
        if _EVERYTHING in read:
            return False
        own, others = vars(a), vars(b)
        return all(
            (name in own) == (name in others) and (name not in own or compare(own[name], others[name])) for name in read
        )

    def _visible(self, variable: Variable) -> list[str]:
        names = [field.name for field in fields(variable) if field.name not in _UNSEEN]
        return names + sorted(self._reads.get(id(variable), set()))


@contextmanager
def watched(part: Automaton) -> Iterator[Reads]:
    """Watch which attributes of a part, and of the automata inside it, are read.

    Yields
    ------
    mapping
        Identity -> names; an automaton that could not be watched is not in it.
    """
    objects: dict[int, Any] = {}
    _collect(part, objects)
    reads: dict[int, set[str]] = {}
    classes = []
    try:
        for found in objects.values():
            own = type(found)
            watching = _WatchedVariable if isinstance(found, Variable) else _watching(own)
            if watching is None:
                continue
            try:
                object.__setattr__(found, "__class__", watching)
            except TypeError:
                continue
            classes.append((found, own))
            reads[id(found)] = set()
            _reads_of[id(found)] = reads[id(found)]
        yield reads
    finally:
        for found, own in classes:
            object.__setattr__(found, "__class__", own)
            del _reads_of[id(found)]


_reads_of: dict[int, set[str]] = {}
"""Of the objects that are watched at present."""


def _collect(value: Any, found: dict[int, Any]) -> None:
    """Find the automata in a part, and their variables."""
    if isinstance(value, Automaton | Variable):
        if id(value) not in found:
            found[id(value)] = value
            if isinstance(value, Automaton) and hasattr(value, "__dict__"):
                for attribute in vars(value).values():
                    _collect(attribute, found)
    elif type(value) in (tuple, list):
        for item in value:
            _collect(item, found)
    elif type(value) is dict:
        for item in value.values():
            _collect(item, found)


def _watching(cls: type[Automaton]) -> type[Automaton] | None:
    """Return the class with attribute access that is noted; None for classes that take part in these things."""
    if cls.__getattribute__ is not object.__getattribute__ or any(
        "__init_subclass__" in vars(b) for b in cls.__mro__[:-1]
    ):
        return None

    def note(self: Automaton, name: str) -> Any:
        if name != "__class__" and not (name == "name" and sys._getframe(1).f_globals.get("__name__") in _MESSAGES):
            _note(self, name)
        return cls.__getattribute__(self, name)

    def identify(self: Automaton) -> int:
        _note(self, _EVERYTHING)
        return cls.__hash__(self)

    body = {"__getattribute__": note, "__hash__": identify, "__module__": cls.__module__, "__doc__": cls.__doc__}
    make: Any = type(cls)
    watching: type[Automaton] = make(cls.__name__, (cls,), body)
    return watching


class _WatchedVariable(Variable):
    """A variable of which it is noted whether maps look at more than its name, kind, shape and flags."""

    def __getattribute__(self, name: str) -> Any:
        if name in (*_UNSEEN, _EVERYTHING):
            caller = sys._getframe(1)
            if caller.f_code.co_name not in _SHAPE or caller.f_globals.get("__name__") != Variable.__module__:
                _note(self, name)
        return super().__getattribute__(name)


def _note(watched: object, name: str) -> None:
    if id(watched) in _reads_of:
        _reads_of[id(watched)].add(name)


def _is_frozen(cls: type) -> bool:
    made = getattr(cls, "__dataclass_params__", None)
    return made is not None and made.frozen

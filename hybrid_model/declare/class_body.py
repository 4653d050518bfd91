"""What the class of an automaton may hold: slips in its body, each answered by one sentence.

Python takes any attribute in a class. A method that has the name of one of the framework's, a number in the place of a
declaration, or a jump that is in no list would break runs or be ignored in silence.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from weakref import WeakSet

from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.signatures import require_map
from hybrid_model.declare.transitions import Clock, Priority
from hybrid_model.declare.variables import Declaration, Dimension, Kind
from hybrid_model.errors import DeclarationError

MAPS = ("flow_map", "flow_set", "start_map", "outputs", "jump_set", "jump_map")
"""Methods that authors write; each takes the values at one instant."""
UNBOUND = ("jump_set", "jump_map")
"""Those of them that are called as functions of the instance, like those of a `Jump`."""
DECLARED = (Declaration, Dimension, Clock)
RESERVED = ("t", *UNBOUND)
"""Names with a meaning that no attribute of `HybridAutomaton` holds."""
MARK = "written_by_authors"
"""Attribute of the framework's classes: which of their attributes others may write."""

_sound: WeakSet[type] = WeakSet()


def require_sound_body(cls: type, listed: Mapping[str, tuple[type, ...]]) -> None:
    """Refuse what is written into a class of automata and would be ignored, or break the framework.

    Parameters
    ----------
    cls : type
        A subclass of `HybridAutomaton`.
    listed : mapping
        Attribute that holds a tuple -> types of its elements: ``transitions``, and for modes more.

    Raises
    ------
    DeclarationError
        With what to write instead.
    """
    if cls in _sound:
        return
    marked = next(k for k, base in enumerate(cls.__mro__) if MARK in vars(base))
    bodies, framework = cls.__mro__[:marked], cls.__mro__[marked]
    for body in bodies:
        for name, value in vars(body).items():
            if isinstance(value, DECLARED):
                _refuse_declared_name(cls, framework, name)
        for name, value in _attributes(body):
            _refuse_hiding(cls, body, name, value)
            _refuse_framework_name(cls, framework, name)
            _refuse_wrong_value(cls, name, value)
            _refuse_misspelt(cls, name, value)
            if name in MAPS:
                _require_arguments(cls, name, value)
    for name, kinds in listed.items():
        _require_elements(cls, name, kinds)
        _refuse_unlisted(cls, bodies, listed, name)
    _require_served(cls)
    _sound.add(cls)


def _attributes(body: type) -> Iterator[tuple[str, Any]]:
    for name, value in vars(body).items():
        if not (name.startswith(("__", "_abc_")) or isinstance(value, DECLARED)):
            yield name, value


def _refuse_hiding(cls: type, body: type, name: str, value: object) -> None:
    for base in body.__mro__[1:]:
        declared = vars(base).get(name)
        if isinstance(declared, DECLARED):
            raise DeclarationError(
                f"{cls.__name__}.{name} = {told(value)} would hide what {base.__name__} declares by that name: write "
                f"{name} = hm.{type(declared).__name__}(...), or choose another name."
            )


def _refuse_declared_name(cls: type, framework: type, name: str) -> None:
    anew = isinstance(getattr(framework, name, None), DECLARED)
    if name in RESERVED or (_is_of(framework, name) and not anew):
        raise DeclarationError(f"{cls.__name__} declares {name!r}, a name of the framework: choose another.")


def _is_of(framework: type, name: str) -> bool:
    return hasattr(framework, name) or any(name in inspect.get_annotations(base) for base in framework.__mro__)


def _refuse_framework_name(cls: type, framework: type, name: str) -> None:
    own = getattr(framework, MARK)
    if name not in own and _is_of(framework, name):
        raise DeclarationError(
            f"{cls.__name__} defines {name!r}, a name of the framework: choose another. Yours to write are "
            f"{', '.join(sorted({*own, *UNBOUND}))}."
        )


def _refuse_wrong_value(cls: type, name: str, value: object) -> None:
    if isinstance(value, type) and issubclass(value, DECLARED):
        raise DeclarationError(
            f"{cls.__name__}.{name} is the class {value.__name__}: write {name} = hm.{value.__name__}(...)."
        )
    if name == "priority" and not isinstance(value, Priority):
        raise DeclarationError(
            f"{cls.__name__}.priority is {told(value)}: write hm.Priority.JUMP (the default) or hm.Priority.FLOW."
        )
    if name == "stiff" and not (value is None or isinstance(value, bool)):
        raise DeclarationError(
            f"{cls.__name__}.stiff is {told(value)}: write True, False, or nothing where the run is to find it out."
        )


def _refuse_misspelt(cls: type, name: str, value: object) -> None:
    for written in MAPS:
        if callable(value) and _plain(name) == _plain(written) and not _has(cls, written):
            raise DeclarationError(
                f"{cls.__name__} has a method {name!r}, which nothing calls, and no {written!r}: rename it so."
            )


def _plain(name: str) -> str:
    return name.lower().replace("_", "").rstrip("s")


def _has(cls: type, written: str) -> bool:
    """Whether somebody has written a map."""
    base = next(base for base in reversed(cls.__mro__) if MARK in vars(base))
    return getattr(cls, written, None) is not getattr(base, written, None)


def _require_arguments(cls: type, name: str, written: Any) -> None:
    what = f"{name} of {cls.__name__}"
    if isinstance(written, staticmethod) and name not in UNBOUND:
        require_map(what, written.__func__, ("s",))
    elif isinstance(written, classmethod) and name not in UNBOUND:
        require_map(what, written.__func__, ("cls", "s"))
    else:
        require_map(what, written)


def _as_tuple(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, (tuple, list)) else (value,)


def _require_elements(cls: type, name: str, kinds: tuple[type, ...]) -> None:
    wanted = " or ".join(f"hm.{kind.__name__}" for kind in kinds)
    held = getattr(cls, name, ())
    for element in _as_tuple(held):
        if not isinstance(element, kinds):
            raise DeclarationError(
                f"{cls.__name__}.{name} holds {told(element)}, but lists {wanted}: write {name} = "
                f"(hm.{kinds[0].__name__}(...),)."
            )
    if not isinstance(held, tuple):
        # One that is not in a tuple stands for a tuple of one.
        setattr(cls, name, _as_tuple(held))


def _refuse_unlisted(cls: type, bodies: Sequence[type], listed: Mapping[str, tuple[type, ...]], where: str) -> None:
    known = {id(element) for element in getattr(cls, where, ())}
    for body in bodies:
        for name, value in _attributes(body):
            found = [item for item in _as_tuple(value) if isinstance(item, listed[where]) and id(item) not in known]
            # What a subclass lists anew need not be taken over from its base.
            if found and name not in listed:
                raise DeclarationError(
                    f"{cls.__name__}.{name} is a {type(found[0]).__name__} that is not in {where}, which alone is "
                    f"read: write {where} = ({name},) below it."
                )


def _require_served(cls: type) -> None:
    """Require the maps that declarations need."""
    declared = {n: d for base in reversed(cls.__mro__) for n, d in vars(base).items() if isinstance(d, Declaration)}
    outputs = [name for name, declaration in declared.items() if declaration.kind is Kind.OUTPUT]
    computed = [name for name, declaration in declared.items() if declaration.traits.get("computed")]
    if outputs and not _has(cls, "outputs"):
        raise DeclarationError(
            f"{cls.__name__} declares the outputs {', '.join(outputs)}, but no map gives their values: write def "
            f"outputs(self, s): return {{{outputs[0]!r}: ...}}; a state is an output by output=True."
        )
    if computed and not _has(cls, "start_map"):
        raise DeclarationError(
            f"{cls.__name__} declares {', '.join(computed)} as computed, but no map gives the start values: write def "
            f"start_map(self, s): return {{{computed[0]!r}: ...}}."
        )

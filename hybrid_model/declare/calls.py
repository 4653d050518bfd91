"""Calls with arguments that a function does not have, answered by one sentence."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.signatures import meant
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import SimulationError

P = ParamSpec("P")
R = TypeVar("R")


def explained(
    error_class: type[Exception] = SimulationError, /, **options: type
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of a function or a constructor: it says what to write where arguments are unknown or missing.

    Parameters
    ----------
    error_class : type
        What is raised.
    **options : type
        Argument -> class of what it takes; the fields of that class are often given to the function itself.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        parameters = signature.parameters.values()

        @functools.wraps(function)
        def call(*given: P.args, **named: P.kwargs) -> R:
            try:
                return function(*given, **named)
            except TypeError as error:
                # A run costs less than binding its arguments does, so that is done where something is wrong alone.
                if _fits(signature, given, named):
                    raise
                called, own = function.__name__, 0
                if called == "__init__":
                    called, own = type(given[0]).__name__, 1
                raise error_class(_sentence(called, list(parameters)[own:], options, given[own:], named)) from error

        return call

    return decorate


def _fits(signature: inspect.Signature, given: tuple[Any, ...], named: Mapping[str, Any]) -> bool:
    try:
        signature.bind(*given, **named)
    except TypeError:
        return False
    return True


def _sentence(
    called: str,
    parameters: Sequence[inspect.Parameter],
    options: Mapping[str, type],
    given: tuple[Any, ...],
    named: Mapping[str, Any],
) -> str:
    by_place = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    by_name = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    any_more = [f"*{p.name}" for p in parameters if p.kind is p.VAR_POSITIONAL]
    if len(given) > len(by_place):
        others = f"give the others by name, {'=..., '.join(by_name)}=..." if by_name else "leave the others out"
        return f"{called} takes {' and '.join(by_place)} by position, but {len(given)} arguments were given: {others}."
    for name, value in named.items():
        if name not in (*by_place, *by_name):
            owner = given[0] if given else named.get(by_place[0])
            return f"{called} has no option {name!r}{_instead(name, value, options, owner, by_name or by_place)}."
    needed = [p.name for p in parameters if p.default is p.empty]
    missing = [name for name in by_place[len(given) :] if name in needed and name not in named]
    if not missing:
        return f"{called} was given {by_place[0]} twice: give it by position or by name."
    return f"{called} needs {' and '.join(missing)}: write {called}({', '.join([*by_place, *any_more])})."


def _instead(name: str, value: Any, options: Mapping[str, type], owner: Any, known: list[str]) -> str:
    for option, kind in options.items():
        if dataclasses.is_dataclass(kind) and name in (field.name for field in dataclasses.fields(kind)):
            return f": write {option}=hm.{kind.__name__}({name}={told(value)})"
    fields = [(field.name, option) for option, kind in options.items() for field in dataclasses.fields(kind)]
    close = difflib.get_close_matches(name, [*known, *(field for field, _ in fields)], n=1, cutoff=0.8)
    for field, option in fields:
        if close == [field]:
            return f": write {option}=hm.{options[option].__name__}({field}={told(value)})"
    variables = {v.name: v for v in owner.variables} if isinstance(owner, Automaton) else {}
    if name in variables and variables[name].kind is Kind.INPUT:
        return f": write inputs={{{name!r}: {told(value)}}}"
    if name in variables:
        return f": values are given when an instance is made, {type(owner).__name__}({name}={told(value)})"
    return meant(name, known)

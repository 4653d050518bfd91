"""Functions and classes that are called in another way than they are written, answered by one sentence."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Mapping, Sequence
from types import FunctionType
from typing import Any, Self

from hybrid_model.errors import DeclarationError


def require_map(what: str, written: object, arguments: Sequence[str] = ("self", "s")) -> None:
    """Require something that can be called with the arguments of a map.

    Parameters
    ----------
    what : str
        Whose map, for the message.
    written : object
        What its author wrote.
    arguments : sequence of str
        Names of the positional arguments with which executions call it.

    Raises
    ------
    DeclarationError
        If it is no function, or takes other arguments.
    """
    if not callable(written):
        raise DeclarationError(
            f"{what} is {written!r}, but must be a function: write lambda {', '.join(arguments)}: ..., or the name of "
            "a function."
        )
    if isinstance(written, FunctionType) and written.__code__.co_argcount == len(arguments) and _no_more(written):
        return
    try:
        signature = inspect.signature(written)
        signature.bind(*arguments)
    except ValueError:
        return  # Functions written in C need not tell.
    except TypeError as error:
        called = ", ".join(arguments)
        name = getattr(written, "__name__", "<lambda>")
        remedy = f"lambda {called}: ..." if name == "<lambda>" else f"def {name}({called})"
        raise DeclarationError(f"{what} takes {signature}, but is called with ({called}): write {remedy}.") from error


def _no_more(function: FunctionType) -> bool:
    return not function.__code__.co_kwonlyargcount


def require_call(called: str, cls: type, given: Sequence[object], options: Mapping[str, object]) -> None:
    """Require arguments that a class and its bases know.

    Parameters
    ----------
    called : str
        What it is called in the message.
    cls : type
        The class; its keyword options are those of its bases, too.
    given : sequence
        Positional arguments.
    options : mapping
        Arguments by name.

    Raises
    ------
    DeclarationError
        With the options that there are.
    """
    written = [vars(base).get("__init__") for base in cls.__mro__]
    constructors = [function for function in written if isinstance(function, FunctionType)]
    own = constructors[0].__code__
    positional = own.co_varnames[1 : own.co_argcount]
    known = [*positional, *dict.fromkeys(name for function in constructors for name in function.__kwdefaults__ or {})]
    unknown = [name for name in options if name not in known]
    if unknown:
        raise DeclarationError(f"{called} has no option {unknown[0]!r}{meant(unknown[0], known)}.")
    if len(given) > len(positional):
        raise DeclarationError(
            f"{called} takes {len(positional)} value{'s' * (len(positional) != 1)} by position, but {given!r} was "
            f"given: name the others, which are {', '.join(known[len(positional) :])}."
        )
    needed = len(positional) - len(constructors[0].__defaults__ or ())
    missing = [name for name in positional[len(given) : needed] if name not in options]
    if missing:
        raise DeclarationError(f"{called} needs {' and '.join(missing)}: write {called}({', '.join(positional)}).")


class ExplainedCall:
    """Base of classes whose constructor says what it takes where it is called with something else."""

    __slots__ = ()

    def __new__(cls, *given: Any, **options: Any) -> Self:
        """Look at the arguments before the constructor does."""
        require_call(f"hm.{cls.__name__}", cls, given, options)
        return super().__new__(cls)

    def __reduce__(self) -> tuple[Any, ...]:
        # Copies are filled in behind the constructor, so nothing is called that would miss its arguments.
        return object.__new__, (type(self),), vars(self)


def meant(name: str, known: Sequence[str]) -> str:
    """Return the end of a sentence about an unknown name: what was probably meant, or all that there is."""
    close = difflib.get_close_matches(name, known, n=1)
    return f": write {close[0]!r}" if close else f"; it has {', '.join(known) or 'none'}"

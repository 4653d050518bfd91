"""Slips in the arguments of a run: the class of an automaton for an instance, a name for options, text for a number."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from typing import Any

import numpy as np

from hybrid_model.declare.automaton import Automaton, require_made
from hybrid_model.declare.real_numbers import told
from hybrid_model.errors import DeclarationError, SimulationError


def require_automaton(caller: str, given: Any) -> None:
    """Require an instance of an automaton.

    Parameters
    ----------
    caller : str
        Name of the function that was given it, for the message.
    given : object
        What it was given.

    Raises
    ------
    DeclarationError
        If it is the class, or no automaton.
    """
    if isinstance(given, Automaton):
        require_made(given)
        return
    if isinstance(given, type) and issubclass(given, Automaton):
        raise DeclarationError(
            f"{caller} was given the class {given.__name__}, but takes an instance: write {given.__name__}()."
        )
    raise DeclarationError(
        f"{caller} was given {told(given)}, but takes an automaton: give an instance of a HybridAutomaton or a "
        "Composition."
    )


def require_options(name: str, given: Any, kind: type, *, first: str) -> None:
    """Require that an option is None or an instance of its class.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    given : object
        What was given for it.
    kind : type
        Class of the option.
    first : str
        Name of the field of `kind` that the given value was probably meant for.

    Raises
    ------
    SimulationError
        If it is something else.
    """
    if given is None or isinstance(given, kind):
        return
    field = f"{first}={given!r}" if isinstance(given, (str, int, float)) else "..."
    raise SimulationError(
        f"{name} = {given!r} is no {kind.__name__}: write {name}={kind.__name__}({field}), or leave {name} out."
    )


def require_inputs(given: Any) -> None:
    """Require that inputs are None or a mapping.

    Raises
    ------
    SimulationError
        If they are something else.
    """
    if given is not None and not isinstance(given, Mapping):
        raise SimulationError(f'inputs = {given!r} is no mapping: write inputs={{"name of the input": value}}.')


def require_starts(given: Any) -> None:
    """Require that start values are None or a mapping.

    Raises
    ------
    SimulationError
        If they are something else.
    """
    if given is not None and not isinstance(given, Mapping):
        raise SimulationError(f'starts = {given!r} is no mapping: write starts={{"name of the variable": value}}.')


def real_number(name: str, given: Any) -> float:
    """Return a number as a float.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    given : object
        What was given for it.

    Returns
    -------
    float

    Raises
    ------
    SimulationError
        If it is no real number; text that reads like one is none.
    """
    is_scalar = isinstance(given, np.ndarray) and given.shape == () and given.dtype.kind in "iuf"
    if not (is_scalar or isinstance(given, numbers.Real)):
        both = isinstance(given, (tuple, list)) and len(given) == 2
        remedy = "a number in s, and the start by t_start=..." if both else "a number in s"
        raise SimulationError(f"{name} = {told(given)} is not a number: give {remedy}.")
    try:
        return float(given)
    except OverflowError as error:
        raise SimulationError(f"{name} = {told(given)} is too large: give a number in s.") from error


def require_choice(name: str, given: object, choices: tuple[str, ...]) -> None:
    """Raise SimulationError for a value that is none of the choices."""
    if given not in choices:
        raise SimulationError(f"{name} = {told(given)}: give one of {', '.join(map(repr, choices))}.")

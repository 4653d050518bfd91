"""Automata by the name of their class, in modules and in files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cosim.errors import UsageError
from hybrid_model import Automaton
from hybrid_model.declare.automaton import require_made
from hybrid_model.errors import DeclarationError
from hybrid_model.named_objects import named_object


def find_automaton(target: str, starts: Mapping[str, Any]) -> Automaton:
    """Return an automaton.

    Parameters
    ----------
    target : str
        ``module:ClassName`` or ``file.py:ClassName``; instances as well.
    starts : mapping
        What the class is called with.

    Raises
    ------
    NamingError
        If there is none of that name.
    UsageError
        If it is no automaton.
    ImportFailedError
        If its module fails when it is imported.
    """
    found = named_object(target)
    if isinstance(found, Automaton):
        if starts:
            raise UsageError(f"--start-value goes with a class, and {target} is an instance, which has its values.")
        return found
    if not (isinstance(found, type) and issubclass(found, Automaton)):
        raise UsageError(f"{target} is not an automaton class: derive it from hybrid_model.HybridAutomaton.")
    try:
        automaton = found(**starts)
    except (TypeError, DeclarationError) as error:
        if not starts:
            raise
        raise UsageError(f"{target} cannot be made with the start values given: {str(error).rstrip('.')}.") from error
    require_made(automaton)
    return automaton

"""Weights that a scenario file names as a function of the user's own."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.function import FunctionWeight

__all__ = ["read_own_weights"]


def read_own_weights(table: Entries, edges: int, folder: Path) -> tuple[FunctionWeight, ...]:
    """Read the table ``[weights]`` whose kind names a function ``weight(t, **numbers)``.

    Parameters
    ----------
    table : Entries
        Everything that is given: ``kind`` is ``file.py:function``, the file counted from `folder`, or
        ``module:function``; ``kinks`` and ``period`` as for `FunctionWeight`, and arguments of the function by
        name, each one number for all edges or a list of one for each.
    edges : int
        Number of edges.
    folder : Path
        Folder of the scenario file.

    Raises
    ------
    ScenarioError
        If the function cannot be found, imported or called with the numbers, or its values are no weights.
    """
    target, function = table.text("kind"), table.named("kind", folder)
    if not callable(function) or isinstance(function, type):
        raise ScenarioError(f"[weights] kind is '{target}', which is {function!r}; it must be a function of time.")
    given = {key: table.per_edge(key, edges) for key in table if key not in ("kind", "kinks", "period")}
    kinks = table.numbers("kinks") if "kinks" in table else ()
    period = table.number("period") if "period" in table else None
    found = []
    for edge in range(edges):
        own = {key: values[edge] for key, values in given.items()}
        try:
            found.append(FunctionWeight(partial(function, **own) if own else function, kinks, period))
        except (TypeError, ValueError) as error:
            raise ScenarioError(f"[weights] of edge {edge + 1}: '{target}' cannot be used: {error}") from error
    return tuple(found)

"""Weights and switching that follow a table, as automata: the row is looked up at its beginning and then held.

The held row is a discrete state, so the flow between two rows costs no search through the table.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.weights.clockwork import not_negative
from hybrid_model.consensus.weights.row_clock import row_begin, row_number, row_place
from hybrid_model.declare.variables import Value


class TableClock(hm.HybridAutomaton):
    """Goes through the rows of a table, over and over or once; subclasses say what they hold of a row."""

    degree = hm.Dimension("number of edges")
    rows = hm.Dimension("number of rows of the table")
    row = hm.DiscreteState(0, integer=True, internal=True, computed=True, description="number of the row in force")
    starts = hm.Parameter(0.0, shape="rows", unit="s", description="times at which the rows begin for the first time")
    period = hm.Parameter(0.0, unit="s", description="time after which the rows repeat; 0 if the last one stays")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges")

    def held(self, row: Value, s: hm.Values) -> dict[str, Value]:
        """The values that are held while row number `row` is in force."""
        return {}

    @abstractmethod
    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The row that holds the start time."""
        row = row_number(s.t, s.starts, s.period)
        return {"row": row, **self.held(row, s)}

    def next_row(self, s: hm.Values) -> Value:
        """Time at which the next row begins; infinity if there is none."""
        return row_begin(s.row + 1, s.starts, s.period)

    def move_on(self, s: hm.Values) -> dict[str, Value]:
        """Go on to the next row."""
        return {"row": s.row + 1, **self.held(s.row + 1, s)}

    transitions = (hm.TimeEvent("row", next_row, move_on, internal=True),)


class TabulatedWeights(TableClock):
    """Weights that are constant or run straight in each row: piecewise constant and sampled ones."""

    values = hm.Parameter(
        1.0, shape=("rows", "degree"), unit="1/s", minimum=0.0, description="weights at the beginning of each row"
    )
    slopes = hm.Parameter(0.0, shape=("rows", "degree"), unit="1/s2", description="slopes of the weights in each row")
    since = hm.DiscreteState(0.0, unit="s", internal=True, computed=True, description="beginning of the row")
    value = hm.DiscreteState(
        0.0, shape="degree", unit="1/s", internal=True, computed=True, description="weights at its beginning"
    )
    slope = hm.DiscreteState(
        0.0, shape="degree", unit="1/s2", internal=True, computed=True, description="slopes of the weights in it"
    )

    def held(self, row: Value, s: hm.Values) -> dict[str, Value]:
        """Beginning, value and slope of the row."""
        chosen = _chosen(row, s)
        return {
            "since": row_begin(row, s.starts, s.period),
            "value": chosen @ s["values"],
            "slope": chosen @ s.slopes,
        }

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights; before the first row those of its beginning."""
        return {"weights": not_negative(s.value + s.slope * np.maximum(s.t - s.since, 0.0))}


class SequenceSwitching(TableClock):
    """Edges that are active row by row of a table, each row for its own time (paper, section 6)."""

    raw = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges if they were always active")
    active = hm.Parameter(1.0, shape=("rows", "degree"), description="1 where an edge is active in a graph, else 0")
    mask = hm.DiscreteState(
        0.0, shape="degree", internal=True, computed=True, description="1 where an edge is active now, else 0"
    )

    def held(self, row: Value, s: hm.Values) -> dict[str, Value]:
        """The active edges."""
        return {"mask": _chosen(row, s) @ s.active}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights of the active edges."""
        return {"weights": s.mask * s.raw}


class FunctionWeights(TableClock):
    """Weights that are functions of time given in Python; the rows begin where one of them has a kink.

    Parameters
    ----------
    functions : sequence of callable
        For each edge ``function(t)`` in numpy style, continuous; what is below 0 counts as 0.
    name : str, optional
        Name of the instance.
    **values
        ``starts`` (the kinks) and ``period``.
    """

    def __init__(self, functions: Sequence[Callable[[Any], Any]], name: str | None = None, **values: Any) -> None:
        self.functions = tuple(functions)
        super().__init__(name, degree=len(self.functions), **{"starts": [0.0], **values})

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": np.stack([not_negative(function(s.t) + 0.0 * s.t) for function in self.functions])}


def _chosen(row: Value, s: hm.Values) -> Value:
    """1 at the place of row number `row` in the table, else 0."""
    return np.where(np.arange(s.starts.shape[0]) == row_place(row, s.starts), 1.0, 0.0)

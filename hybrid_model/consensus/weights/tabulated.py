"""The automaton of weights that follow a table, row by row, and the table that several weights have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import in_turn
from hybrid_model.consensus.clocks.periods import common_period
from hybrid_model.consensus.clocks.rows import RowAutomaton, RowClock, on_line, row_begin
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.edge_automata import EdgeAutomaton
from hybrid_model.declare.variables import Value

__all__ = ["TabulatedWeights", "common_clock"]

_MOST_ROWS = 10_000


class TabulatedWeights(RowAutomaton, EdgeAutomaton):
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
        chosen = in_turn(row, s.starts.shape[0])
        return {
            "since": row_begin(row, s.starts, s.period),
            "value": chosen @ s["values"],
            "slope": chosen @ s.slopes,
        }

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights; before the first row those of its beginning."""
        return {"weights": on_line(s.value, s.slope, s.since, s.t)}

    @classmethod
    def are_columns(cls, waveforms: Sequence[Any]) -> bool:
        """Whether all have one clock; else each agent has the rows of its own edges."""
        return len({waveform.clock for waveform in waveforms}) == 1

    @classmethod
    def columns(cls, waveforms: Sequence[Any]) -> dict[str, Any]:
        """Values and slopes in the rows of all; ScenarioError if they have no common period."""
        clock = common_clock([waveform.clock for waveform in waveforms])
        begins = np.array(clock.starts)
        # A row is looked up at its middle, where rounding of its beginning cannot pick the neighbouring one.
        lengths = clock.lengths()
        middles = begins + np.where(np.isfinite(lengths), lengths, 1.0) / 2
        values, slopes = zip(*(waveform.lines(begins, middles) for waveform in waveforms), strict=True)
        return {"values": np.stack(values, axis=1), "slopes": np.stack(slopes, axis=1)}

    @classmethod
    def of(cls, waveforms: Sequence[Any]) -> Self:
        """One table of the rows of all; ScenarioError if they have no common period."""
        clock = common_clock([waveform.clock for waveform in waveforms])
        return cls(starts=clock.starts, period=clock.period or 0.0, **cls.columns(waveforms))


def common_clock(clocks: Sequence[RowClock]) -> RowClock:
    """A clock whose rows begin whenever a row of one of the `clocks` begins."""
    if len(set(clocks)) == 1:
        return clocks[0]
    periods = [clock.period for clock in clocks]
    if all(period is None for period in periods):
        return RowClock(tuple(sorted({start for clock in clocks for start in clock.starts})))
    period = common_period(periods)
    if period is None:
        shown = ", ".join("none" if period is None else f"{period:.6g} s" for period in periods)
        raise ScenarioError(
            f"[weights] the tables of one agent's edges repeat with the periods {shown} without a common multiple; "
            "let all of them repeat, with periods whose quotients are simple fractions."
        )
    origin = clocks[0].starts[0]
    inner = np.unique(np.concatenate([clock.breakpoints(origin, origin + period) for clock in clocks]))
    apart = 1e-12 * (abs(origin) + period)
    inner = inner[(np.diff(inner, prepend=origin) > apart) & (origin + period - inner > apart)]
    if len(inner) >= _MOST_ROWS:
        raise ScenarioError(
            f"[weights] the tables of one agent's edges repeat together after {len(inner) + 1} rows only; "
            f"choose periods that give at most {_MOST_ROWS}."
        )
    return RowClock((origin, *inner.tolist()), period)

"""From the data of weights and switching to the automata of one agent's edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.automata import (
    ConstantWeights,
    GatedAbsoluteSineWeights,
    GatedSineWeights,
    PeriodicSwitching,
    SineWeights,
    SquareWeights,
)
from hybrid_model.consensus.weights.functions import FunctionWeight
from hybrid_model.consensus.weights.gated_sine import ConstantWeight, GatedSine, WeightMap
from hybrid_model.consensus.weights.periods import common_period
from hybrid_model.consensus.weights.row_clock import RowClock
from hybrid_model.consensus.weights.switching import NoSwitching, Switching, SwitchingSequence
from hybrid_model.consensus.weights.switching import PeriodicSwitching as CyclicGraphs
from hybrid_model.consensus.weights.table_automata import FunctionWeights, SequenceSwitching, TabulatedWeights
from hybrid_model.consensus.weights.tables import PiecewiseWeight, SampledWeight
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.consensus.weights.waves import SineWeight, SquareWeight
from hybrid_model.declare.variables import FloatArray

__all__ = ["switching_block", "weights_block"]

_MOST_ROWS = 10_000


def weights_block(waveforms: Sequence[Waveform]) -> hm.Automaton:
    """Make the automaton with an output ``weights``, one element for each waveform.

    Raises
    ------
    ScenarioError
        If no single block makes them all: different kinds, both maps of the gated sine, or tables without a common
        period.
    """
    kinds = {_block_of(waveform) for waveform in waveforms}
    if not waveforms:
        return ConstantWeights(degree=0, value=np.zeros(0))
    if len(kinds) > 1:
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise ScenarioError(
            f"[weights] the edges of one agent need the blocks {names}; give all edges of an agent weights of one kind."
        )
    block = kinds.pop()
    if block is FunctionWeights:
        return _function_block([w for w in waveforms if isinstance(w, FunctionWeight)])
    if block is TabulatedWeights:
        return _table_block([w for w in waveforms if isinstance(w, PiecewiseWeight | SampledWeight)])
    automaton: hm.Automaton = block(degree=len(waveforms), **_columns(waveforms, _PARAMETERS[block]))
    return automaton


def switching_block(switching: Switching, edges: Sequence[int]) -> hm.Automaton | None:
    """Make the automaton that lets through the weights of the active ones of `edges` (from 0); None if all always are.

    Raises
    ------
    ScenarioError
        If the switching is of a kind that there is no automaton for.
    """
    if isinstance(switching, NoSwitching) or not edges:
        return None
    if isinstance(switching, CyclicGraphs):
        return PeriodicSwitching(dwell=switching.dwell, active=_masks(switching.active, edges))
    if isinstance(switching, SwitchingSequence):
        clock = switching.clock
        return SequenceSwitching(
            starts=clock.starts, period=clock.period or 0.0, active=_masks(switching.active, edges)
        )
    raise ScenarioError(f"[switching] {type(switching).__name__} has no automaton; use one of the library's kinds.")


_PARAMETERS: dict[Callable[..., hm.Automaton], dict[str, str]] = {
    ConstantWeights: {"value": "level"},
    SineWeights: {name: name for name in ("mean", "depth", "rate", "phase")},
    SquareWeights: {name: name for name in ("high", "low", "gate_rate", "duty_percent", "phase")},
    GatedSineWeights: {name: name for name in ("gate_rate", "sine_rate", "duty_percent", "phase")},
    GatedAbsoluteSineWeights: {name: name for name in ("gate_rate", "sine_rate", "duty_percent", "phase")},
}
"""Parameter of the block -> attribute of the waveform."""


def _block_of(waveform: Waveform) -> Any:
    if isinstance(waveform, GatedSine):
        return GatedSineWeights if waveform.map is WeightMap.SQUARE else GatedAbsoluteSineWeights
    blocks = {
        ConstantWeight: ConstantWeights,
        SineWeight: SineWeights,
        SquareWeight: SquareWeights,
        PiecewiseWeight: TabulatedWeights,
        SampledWeight: TabulatedWeights,
        FunctionWeight: FunctionWeights,
    }
    if type(waveform) not in blocks:
        raise ScenarioError(f"[weights] {type(waveform).__name__} has no automaton; use one of the library's kinds.")
    return blocks[type(waveform)]


def _columns(waveforms: Sequence[Waveform], names: dict[str, str]) -> dict[str, FloatArray]:
    return {key: np.array([getattr(waveform, name) for waveform in waveforms]) for key, name in names.items()}


def _masks(active: Sequence[Sequence[int]], edges: Sequence[int]) -> list[list[float]]:
    return [[float(edge + 1 in row) for edge in edges] for row in active]


def _function_block(waveforms: Sequence[FunctionWeight]) -> FunctionWeights:
    functions = [waveform.function for waveform in waveforms]
    clocks = [waveform.carrier.clock for waveform in waveforms if waveform.carrier.clock is not None]
    clock = _common_clock(clocks) if clocks else RowClock((0.0,))
    return FunctionWeights(functions, starts=clock.starts, period=clock.period or 0.0)


def _table_block(waveforms: Sequence[PiecewiseWeight | SampledWeight]) -> TabulatedWeights:
    clocks = [w.clock if isinstance(w, PiecewiseWeight) else w.carrier.clock for w in waveforms]
    clock = _common_clock(clocks)
    begins = np.array(clock.starts)
    # A row is looked up at its middle, where rounding of its beginning cannot pick the neighbouring one.
    lengths = clock.lengths()
    middles = begins + np.where(np.isfinite(lengths), lengths, 1.0) / 2
    lines = [_line(waveform, begins, middles) for waveform in waveforms]
    return TabulatedWeights(
        starts=clock.starts,
        period=clock.period or 0.0,
        values=np.stack([values for values, _ in lines], axis=1),
        slopes=np.stack([slopes for _, slopes in lines], axis=1),
    )


def _line(
    waveform: PiecewiseWeight | SampledWeight, begins: FloatArray, middles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Values at the beginnings of rows, and slopes in them."""
    if isinstance(waveform, PiecewiseWeight):
        return waveform.value(middles), np.zeros(len(begins))
    carrier, scale = waveform.carrier, float(waveform.amplitude(0.0))
    place, own = carrier.clock.place(middles), carrier.clock.begin(carrier.clock.number(middles))
    slopes = np.where(middles < own, 0.0, scale * carrier.slopes[place])
    values = scale * carrier.levels[place] + slopes * (begins - own)
    return np.maximum(values, 0.0), slopes


def _common_clock(clocks: Sequence[RowClock]) -> RowClock:
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

"""The automaton of an agent's edges: their weights as outputs, and what is common to those that can be computed ahead.

Breakpoints are time events, never searched for. The index of the present piece is a discrete state: the flow between
two breakpoints is smooth, the breakpoints are computed from the index, and the value at a breakpoint belongs to the
piece that the index says.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.declare.variables import Value

__all__ = ["PIECE_EVENTS", "EdgeAutomaton", "ForeseenWeights"]


class EdgeAutomaton(hm.HybridAutomaton):
    """Weights of an agent's edges."""

    degree = hm.Dimension("number of edges")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges")

    @abstractmethod
    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""

    @classmethod
    def are_columns(cls, waveforms: Sequence[Any]) -> bool:
        """Whether automata of as many of these edges differ in their `columns` alone."""
        return True

    @classmethod
    def columns(cls, waveforms: Sequence[Any]) -> dict[str, Any]:
        """Parameters out of the data of the edges, the edges along the last axis."""
        return {key: np.array([getattr(waveform, key) for waveform in waveforms]) for key in waveforms[0].numbers}

    @classmethod
    def of(cls, waveforms: Sequence[Any]) -> Self:
        """The automaton of the weights given as data, one for each edge."""
        return cls(degree=len(waveforms), **cls.columns(waveforms))


class ForeseenWeights(EdgeAutomaton):
    """Weights that can be computed ahead: on each piece an amplitude that stays, times a carrier.

    Subclasses with breakpoints list `pieces`, write `pieces_at` and `piece_end`, and take over `PIECE_EVENTS` as their
    transitions.
    """

    pieces: ClassVar[tuple[str, ...]] = ()
    """The discrete states that hold the indices of the present pieces."""

    @abstractmethod
    def amplitude(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """The factor of the carrier on the `pieces`."""

    @abstractmethod
    def carrier(self, s: hm.Values) -> Carrier:
        """The shapes of the edges' weights."""

    def pieces_at(self, s: hm.Values) -> dict[str, Value]:
        """Indices of the pieces that hold the present time."""
        return {}

    def piece_end(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """Time of the first breakpoint behind the `pieces`."""
        return np.inf

    def present(self, s: hm.Values) -> dict[str, Value]:
        """Indices of the present pieces."""
        return {key: s[key] for key in self.pieces}

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The pieces that hold the start time."""
        return self.pieces_at(s)

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": self.amplitude(s, self.present(s)) * self.carrier(s).value(s.t)}

    def next_piece(self, s: hm.Values) -> Value:
        """Time of the next breakpoint."""
        return self.piece_end(s, self.present(s))

    def enter_piece(self, s: hm.Values) -> dict[str, Value]:
        """Move on to the pieces that begin now, past those of length zero."""
        now = self.present(s)
        return {key: np.maximum(index, now[key]) for key, index in self.pieces_at(s).items()}


PIECE_EVENTS = (hm.TimeEvent("piece", ForeseenWeights.next_piece, ForeseenWeights.enter_piece, internal=True),)
"""The transitions of `ForeseenWeights` with breakpoints."""

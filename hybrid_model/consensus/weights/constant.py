"""Weights that do not change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.edge_automata import ForeseenWeights
from hybrid_model.consensus.weights.waveform import Waveform, each_edge
from hybrid_model.declare.variables import Value

__all__ = ["ConstantWeight", "ConstantWeights"]


class ConstantWeights(ForeseenWeights):
    """Weights that do not change."""

    value = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="weight of each edge")

    def amplitude(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """The weights."""
        return s.value

    def carrier(self, s: hm.Values) -> UnitCarrier:
        """1."""
        return UnitCarrier()

    @classmethod
    def columns(cls, waveforms: Sequence[Any]) -> dict[str, Any]:
        """The levels."""
        return {"value": np.array([waveform.level for waveform in waveforms])}


@dataclass(frozen=True)
class ConstantWeight(Waveform):
    """A weight that does not change: ``w(t) = level``.

    Parameters
    ----------
    level : float
        The weight, finite and not negative.

    Raises
    ------
    ValueError
        If the level is negative or not finite.
    """

    level: float
    automaton = ConstantWeights
    carrier = UnitCarrier()
    period = 0.0
    further_keys: ClassVar[tuple[str, ...]] = ("value",)

    def __post_init__(self) -> None:
        """Check the values."""
        require("the constant weight", self.level, self.level >= 0, "must not be negative")

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The level, in the shape of `t` [s]."""
        return np.full(np.shape(t), float(self.level))

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """See `Waveform.read`."""
        values = entries.per_edge("value", edges)
        for number, value in enumerate(values, start=1):
            if value < 0:
                key = f"value[{number}]" if entries.lists("value") else "value"
                raise entries.error(key, value, "must not be negative")
        return each_edge(cls, zip(values, strict=True))

"""The kinds of weights, each with the name that a scenario file gives it; reading them, and their automata.

A new kind is a subclass of `Waveform` in a file of its own, and a line in `WeightKind`.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from pathlib import Path

import hybrid_model as hm
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.constant import ConstantWeight, ConstantWeights
from hybrid_model.consensus.weights.function import FunctionWeight
from hybrid_model.consensus.weights.gated_sine import GatedSine
from hybrid_model.consensus.weights.own_weight import read_own_weights
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sampled import SampledWeight
from hybrid_model.consensus.weights.sine import SineWeight
from hybrid_model.consensus.weights.square import SquareWeight
from hybrid_model.consensus.weights.waveform import Waveform

__all__ = ["WeightKind", "read_weights", "weights_block"]


class WeightKind(enum.Enum):
    """The kinds of weights; for FUNCTION a scenario file names the function itself, as ``file.py:function``."""

    GATED_SINE = "gated-sine", GatedSine
    CONSTANT = "constant", ConstantWeight
    SINE = "sine", SineWeight
    SQUARE = "square", SquareWeight
    PIECEWISE = "piecewise", PiecewiseWeight
    SAMPLED = "sampled", SampledWeight
    FUNCTION = "function", FunctionWeight

    waveform: type[Waveform]

    def __new__(cls, name: str, waveform: type[Waveform]) -> WeightKind:
        """The value of a kind is its name."""
        kind = object.__new__(cls)
        kind._value_ = name
        kind.waveform = waveform
        return kind

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the table ``[weights]`` of this kind."""
        return "kind", *self.waveform.further_keys, *self.waveform.numbers


def read_weights(
    make_entries: Callable[[tuple[str, ...] | None], Entries], edges: int, folder: Path
) -> tuple[Waveform, ...]:
    """Read the weights of all edges; docs/scenarios.md lists the keys of each kind.

    Parameters
    ----------
    make_entries : callable
        Makes the entries of the table ``[weights]`` from the keys that it may have; None: any.
    edges : int
        Number of edges.
    folder : Path
        Folder that the name of a file of samples counts from.

    Raises
    ------
    ScenarioError
        If a key is unknown or missing, or a value is of the wrong type or out of range; the message names it.
    """
    # The kind decides which keys are known, so it is read from a table that accepts whatever is given.
    anything = make_entries(None)
    if anything.target("kind") is not None:
        return read_own_weights(anything, edges, folder)
    any_kind = make_entries(tuple(dict.fromkeys(key for kind in WeightKind for key in kind.keys)))
    kind = any_kind.choice("kind", WeightKind)
    return kind.waveform.read(make_entries(kind.keys), edges, folder)


def weights_block(waveforms: Sequence[Waveform]) -> hm.Automaton:
    """Make the automaton with an output ``weights``, one element for each waveform.

    Raises
    ------
    ScenarioError
        If no single block makes them all: different kinds, both maps of the gated sine, or tables without a common
        period.
    """
    if not waveforms:
        return ConstantWeights(degree=0, value=[])
    blocks = {waveform.automaton for waveform in waveforms}
    if len(blocks) > 1:
        names = ", ".join(sorted(block.__name__ for block in blocks))
        raise ScenarioError(
            f"[weights] the edges of one agent need the blocks {names}; give all edges of an agent weights of one kind."
        )
    return blocks.pop().of(waveforms)

"""What every weight of an edge offers, whatever its shape: the interface that integrals, bounds and exact flows use."""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.clocks.over_time import OverTime, require
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.carriers import Carrier
from hybrid_model.consensus.weights.edge_automata import EdgeAutomaton

__all__ = ["Waveform", "each_edge", "require_values"]


class Waveform(OverTime):
    """A weight ``w(t) = amplitude(t)*carrier(t) >= 0`` whose amplitude is constant between breakpoints.

    On a piece on which all edges share one carrier, the weighted Laplacian is a constant matrix times a scalar, and the
    flow of the consensus dynamics is a matrix exponential of the carrier's integral (audit, section 7).

    A kind of weight is a subclass, and a line in `hybrid_model.consensus.weights.kinds`.
    """

    numbers: ClassVar[Mapping[str, float | None]] = {}
    """Names of the numbers that each edge has, in files, here and in the automaton: the default, or None for none."""
    further_keys: ClassVar[tuple[str, ...]] = ()
    """Other keys of the table ``[weights]``."""

    @property
    @abstractmethod
    def carrier(self) -> Carrier:
        """The shape between breakpoints."""

    @property
    @abstractmethod
    def automaton(self) -> type[EdgeAutomaton]:
        """The class of automata for edges with such weights."""

    @abstractmethod
    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """The factor of the carrier at `t` [s], in the shape of `t`."""

    def value(self, t: ArrayLike) -> NDArray[np.float64]:
        """The weight at `t` [s], in the shape of `t`; at a breakpoint the value that begins there."""
        time = np.asarray(t, dtype=float)
        return np.asarray(self.amplitude(time) * self.carrier.value(time))

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s]; the two broadcast against each other. Here for an amplitude that stays."""
        carried = self.carrier.integral(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        return np.asarray(self.amplitude(0.0) * carried)

    def changes(self, end: float) -> Iterator[tuple[str, float]]:
        """See `OverTime.changes`: each of the rates makes changes."""
        for key in self.numbers:
            if key.endswith("rate"):
                yield key, end * (getattr(self, key) / (2 * math.pi))

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """Read the weights of all edges from the table ``[weights]``; files in it lie in the `folder`."""
        columns = [entries.per_edge(key, edges, default) for key, default in cls.numbers.items()]
        return each_edge(cls, zip(*columns, strict=True))


Kind = TypeVar("Kind", bound=Waveform)


def each_edge(kind: Callable[..., Kind], rows: Iterable[Any], source: str = "") -> tuple[Kind, ...]:
    """Make the weight of each edge from its row of arguments; ScenarioError that names the edge that is refused."""
    waveforms = []
    for number, row in enumerate(rows, start=1):
        try:
            waveforms.append(kind(*row))
        except ValueError as error:
            where = f"{source} of edge {number}" if source else f"of edge {number}"
            raise ScenarioError(f"[weights] {where}: {error}") from error
    return tuple(waveforms)


def require_values(values: tuple[float, ...], count: int, others: str) -> None:
    """Check a list of weights, one for each of `count` others."""
    if len(values) != count:
        raise ValueError(f"values lists {len(values)} numbers for {count} {others}; give one for each.")
    for number, value in enumerate(values, start=1):
        require(f"values[{number}]", value, value >= 0, "must not be negative")

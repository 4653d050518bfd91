"""The events of a network's run as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray
from hybrid_model.native.network_run import NO_JUMP, EventColumns

Numbers = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class NetworkEvents:
    """Jumps in the order in which they happened; breakpoints of flows, which nobody outside sees, are not among them.

    Attributes
    ----------
    t : ndarray of float, shape (events,)
        Times in s.
    part : ndarray of int, shape (events,)
        Number of the part, from 0, in the order of the network.
    jump : ndarray of int, shape (events,)
        Number of its jump, in the order of the part's declaration.
    values : ndarray of float, shape (events, signals)
        What the part sends after the jump, in the order of `signals`; not a number where a part has fewer.
    jumps : tuple of tuple of str
        Names of the jumps of each kind of part.
    kind_of : sequence of int or int
        The kind of each part; one number where all parts are of that kind.
    signals : tuple of tuple of str
        Names of what the parts of each kind send.
    """

    t: FloatArray
    part: Numbers
    jump: Numbers
    values: FloatArray
    jumps: tuple[tuple[str, ...], ...]
    kind_of: npt.NDArray[np.uint32]
    signals: tuple[tuple[str, ...], ...]

    @classmethod
    def of_columns(
        cls,
        columns: EventColumns,
        *,
        jumps: Sequence[Sequence[str]],
        kind_of: Sequence[int] | Numbers | int,
        signals: Sequence[Sequence[str]],
    ) -> NetworkEvents:
        """Leave out what is sent without a jump."""
        rows = np.flatnonzero(np.asarray(columns.jump) != NO_JUMP)
        return cls(
            np.asarray(columns.t[rows]),
            np.asarray(columns.part[rows]),
            np.asarray(columns.jump[rows]),
            np.asarray(columns.values[rows]),
            tuple(map(tuple, jumps)),
            np.asarray(kind_of, np.uint32),
            tuple(map(tuple, signals)),
        )

    def __len__(self) -> int:
        return len(self.t)

    def named(self, jump: str) -> npt.NDArray[np.bool_]:
        """Return which events are jumps of a name."""
        most = max(map(len, self.jumps), default=0)
        table = np.array([[name == jump for name in row] + [False] * (most - len(row)) for row in self.jumps], bool)
        if not len(self):
            return np.zeros(0, bool)
        kinds = self.kind_of if self.kind_of.ndim == 0 else self.kind_of[self.part]
        return np.asarray(table.reshape(-1, most)[kinds, self.jump], bool)

    def counts(self, parts: int) -> npt.NDArray[np.int64]:
        """Return how many events each of so many parts had."""
        return np.bincount(self.part, minlength=parts)

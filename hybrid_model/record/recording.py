"""What a run leaves behind, collected while it goes on."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_piece import FlowPiece
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.jump_record import JumpRecord


class Recording:
    """The flows and jumps of a run, in order; one flow more than jumps.

    Parameters
    ----------
    t, j : float, int
        Hybrid time of the start.
    x, z : ndarray
        Continuous and discrete states there.
    held : ndarray
        The constants in the inputs.
    keep : bool
        Whether to keep anything at all.

    Attributes
    ----------
    jumps : list of JumpRecord
        In order.
    received : list of (float, int, ndarray)
        Hybrid time from which on, and the constants in the inputs.
    """

    def __init__(self, t: float, j: int, x: FloatArray, z: FloatArray, held: FloatArray, *, keep: bool = True) -> None:
        self._keep = keep
        self.jumps: list[JumpRecord] = []
        self._closed: list[FlowRecord] = []
        self._open = FlowRecord(t, x, z, ())
        self._pieces: list[FlowPiece] = []
        self.received = [(t, j, held)]

    def flowed(self, pieces: Sequence[FlowPiece]) -> None:
        """Note steps of the present flow."""
        if self._keep:
            self._pieces += pieces

    def jumped(self, jump: JumpRecord) -> None:
        """Note a jump: another flow begins."""
        if not self._keep:
            return
        self.jumps.append(jump)
        self._closed.append(self._open.extended(self._pieces))
        self._open, self._pieces = FlowRecord(jump.t, jump.x_after, jump.z_after, ()), []

    def receive(self, t: float, j: int, held: FloatArray) -> None:
        """Note that inputs changed at (t, j), t in s: the constants in them from now on."""
        if self._keep:
            self.received.append((t, j, held))

    @property
    def flows(self) -> list[FlowRecord]:
        """All flows, the present one last."""
        return [*self._closed, self._open.extended(self._pieces)]

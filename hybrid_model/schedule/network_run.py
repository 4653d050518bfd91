"""What a run of a network leaves: events as arrays, and an arc for each part."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray, unknown_name
from hybrid_model.errors import WiringError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.stop import Stop

if TYPE_CHECKING:
    from hybrid_model.schedule.network_events import NetworkEvents


@dataclass(frozen=True, eq=False)
class NetworkRun:
    """A run of a network: its events, and one hybrid arc for each part, on the part's own hybrid time.

    Attributes
    ----------
    arcs : mapping
        Part -> its arc. What a part received is in its inputs; a reception is no jump of the receiver. After a run on
        the native engine an arc is made from the events when it is first asked for.
    stop : Stop
        Why the run ended; `message` has the particulars.
    t : float
        Time in s at which it ended. When one part ends the run, the others end at their last event before.
    engine : str
        What ran, and why.
    """

    arcs: Mapping[str, HybridArc]
    stop: Stop
    message: str
    t: float
    engine: str = ""
    _make_events: Callable[[], NetworkEvents] | None = field(default=None, repr=False)
    _make_final: Callable[[str], FloatArray] | None = field(default=None, repr=False)

    @property
    def jumps(self) -> list[tuple[str, JumpRecord]]:
        """All jumps with the parts that took them, in time; those of one instant in the order of the parts."""
        found = [(part, jump) for part, arc in self.arcs.items() for jump in arc.jumps]
        return sorted(found, key=lambda entry: entry[1].t)

    @functools.cached_property
    def events(self) -> NetworkEvents:
        """All jumps but breakpoints of flows, as arrays, in the order in which they happened."""
        assert self._make_events is not None
        return self._make_events()

    def event_times(self, part: str, jump: str | None = None) -> FloatArray:
        """Return the times in s of one part's jumps, shape ``(number of them,)``; see `HybridArc.event_times`."""
        return self._arc(part).event_times(jump)

    def final(self, name: str) -> FloatArray:
        """Return a state of all parts at the end of the run, shape ``(parts, *shape of the state)``."""
        if self._make_final is not None:
            return self._make_final(name)
        return np.array([arc.at(name, arc.t[-1]) for arc in self.arcs.values()])

    def at(self, name: str, times: npt.ArrayLike, parts: Sequence[str] | None = None) -> FloatArray:
        """Return a variable of some parts at times in s, shape ``(parts, times, *shape of the variable)``.

        Parameters
        ----------
        name : str
            Of the variable.
        times : array_like, shape (times,)
            In s.
        parts : sequence of str, optional
            Default: all of them.
        """
        grid = np.atleast_1d(np.asarray(times, dtype=np.float64))
        return np.array([self._arc(part).at(name, grid) for part in (self.arcs if parts is None else parts)])

    def _arc(self, part: str) -> HybridArc:
        if part not in self.arcs:
            shown = list(self.arcs)[:20] if len(self.arcs) > 20 else list(self.arcs)
            raise WiringError(unknown_name("the network (parts)", part, dict.fromkeys(shown)))
        return self.arcs[part]

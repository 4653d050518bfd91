"""Signals that depend on each other at once: carried round until they settle, or told where they do not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cosim.errors import CosimError
from cosim.feedthrough import told_loop
from cosim.system import Connection, System

ENDLESS = 1e100
"""Size of signals that are on their way to infinity."""


class Settling:
    """Looks at signals that are carried in rounds, at one instant.

    Parameters
    ----------
    system : System
    wires : sequence of Connection
        What is carried.
    t : float, optional
        Time in s; none for start values.
    """

    def __init__(self, system: System, wires: Sequence[Connection], t: float | None = None) -> None:
        self._system, self._wires, self._t = system, wires, t
        self._rounds = 0
        self._moved: dict[Connection, tuple[int, Any, Any]] = {}

    def is_done(self, before: Sequence[Any], values: Sequence[Any]) -> bool:
        """Return whether the signals of a round are those of the round before it.

        Raises
        ------
        CosimError
            If they were carried as often as they may be, or run away.
        """
        if all(map(self._system.settled, values, before)):
            return True
        self._rounds += 1
        rows = zip(self._wires, before, values, strict=True)
        self._moved |= {wire: (self._rounds, old, new) for wire, old, new in rows if old != new}
        chain, most = len(self._system.slaves), self._system.most_rounds
        if self._rounds >= most or (self._rounds > chain and any(map(_is_endless, values))):
            raise self._unsettled()
        return False

    def _unsettled(self) -> CosimError:
        # A change goes round a loop of n slaves in n rounds.
        since = self._rounds - len(self._system.slaves)
        values = {
            wire: f" (last {_told(new)}, before it {_told(old)})"
            for wire, (at, old, new) in self._moved.items()
            if at > since
        }
        what = "the start values" if self._t is None else f"the signals at t = {self._t:.9g} s"
        return CosimError(
            f"{what} do not settle in {self._rounds} rounds: {told_loop(values)} in which they depend on each other at "
            "once. Break it by a state, or have it iterated more often (loop_iterations), which settles loops whose "
            "gain is below one."
        )


def _is_endless(value: Any) -> bool:
    return isinstance(value, float) and not abs(value) < ENDLESS


def _told(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else repr(value)

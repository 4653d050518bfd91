"""What a co-simulation gives."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import Event, Tick

Watch = Callable[["CosimResult"], None]
"""Told of a run after each row, with the result so far."""


class Ended(enum.Enum):
    """Why a co-simulation ended; the value is the remedy."""

    HORIZON = "The stop time was reached."
    ZENO = "The jumps of a slave accumulate: end the run before that time, or change the slave as its message says."
    TERMINATED = "A slave cannot go on: its message says why and what to change."
    FINISHED = "A slave ended the run, as it may: run on without it, or take what there is."


@dataclass
class CosimResult:
    """A co-simulation's events and signals.

    Attributes
    ----------
    ended : Ended
        Why it ended; `message` has the particulars.
    t : float
        Time in s at which it ended.
    ticks : list of Tick
        Ticks of output clocks, in order.
    times, signals : list of float, dict
        Output times in s, and the outputs there by ``slave.output``.
    final : dict
        Outputs at the end by ``slave.output``.
    steps : int
        Steps made by all slaves together.
    events : list of Event
        Instants at which slaves had events, in order, with how these became known; of masters that handle events. Those
        that come of what a slave received (``received``) are there as far as the slave shows them.
    treatment : dict
        Slave -> how its events are treated, in words.
    engine : str
        What had the queue of events, in a sentence; of the event-exact master.
    watch : callable, optional
        Called with this result after each row.
    """

    ended: Ended = Ended.HORIZON
    message: str = ""
    t: float = 0.0
    ticks: list[Tick] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    signals: dict[str, list[float]] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)
    steps: int = 0
    events: list[Event] = field(default_factory=list)
    treatment: dict[str, str] = field(default_factory=dict)
    engine: str = ""
    watch: Watch | None = field(default=None, repr=False, compare=False)

    def keep(self, t: float, names: Sequence[str], values: Sequence[Any]) -> None:
        """Append a row: the named outputs at `t` in s."""
        self.times.append(t)
        if not self.signals:
            self.signals.update((name, []) for name in names)
        signals = self.signals
        for name, value in zip(names, values, strict=True):
            signals[name].append(value)
        if self.watch is not None:
            self.watch(self)

    def terminate(self, slave: str, t: float, why: Termination) -> None:
        """Note that a slave ended the run at `t` in s."""
        self.t = t
        if why.zeno or why.failed:
            self.ended = Ended.ZENO if why.zeno else Ended.TERMINATED
            self.message = f"{slave}: {why.message}"
        else:
            self.ended = Ended.FINISHED
            self.message = f"{slave} ended the run at t = {t:.9g} s{f': {why.message}' if why.message else ''}"

    def event_times(self, slave: str) -> npt.NDArray[np.float64]:
        """Return the times in s at which a slave had events."""
        return np.array([event.t for event in self.events if event.block == slave])

    def tick_times(self, slave: str, clock: str) -> npt.NDArray[np.float64]:
        """Return the times in s at which a clock ticked."""
        return np.array([tick.t for tick in self.ticks if tick.slave == slave and tick.clock == clock])

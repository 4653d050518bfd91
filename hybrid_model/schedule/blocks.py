"""What a scheduler of events sees of a block: an automaton in this process, an FMU, or anything that predicts."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple


@dataclass(frozen=True)
class Termination:
    """Why a block ended the run.

    Attributes
    ----------
    message : str
        In the block's words.
    zeno : bool
        Whether a Zeno guard did, as far as the block says.
    failed : bool
        Whether it did because it could not go on; else it came to an end of its own.
    """

    message: str
    zeno: bool
    failed: bool = True


class Update(NamedTuple):
    """What one event iteration of a block gave.

    Attributes
    ----------
    again : bool
        Whether the block needs another iteration at this instant.
    ticks : tuple of str
        Output clocks that ticked.
    next_event : float or None
        Absolute time in s of the block's next event as long as its inputs stay; None if it does not know.
    terminated : Termination or None
        Why the block ended the run, if it did.
    idle : bool
        Whether the block knows that nothing happened: there was no event.
    """

    again: bool
    ticks: tuple[str, ...] = ()
    next_event: float | None = None
    terminated: Termination | None = None
    idle: bool = False


class Step(NamedTuple):
    """What one step of a block gave.

    Attributes
    ----------
    reached : float
        Time in s that the block is at now.
    event : bool
        Whether it has an event to be handled there.
    terminated : Termination or None
        Why the block ended the run, if it did.
    """

    reached: float
    event: bool
    terminated: Termination | None = None


class StiffPart(Exception):
    """The flow of a part of a network in C is stiff, and its compiled maps have no derivatives."""


class Block(ABC):
    """A block that is stepped from event to event; the calls and their order are those of FMI.

    Attributes
    ----------
    name : str
        Unique among the blocks of a run.
    foresees : bool
        Whether the next event that it names is the first of all of its events; FMI asks that of time events alone.
    can_restore : bool
        Whether `save` and `restore` work.
    tells_jumps : bool
        Whether the `idle` of its updates says of each of them whether it has jumped; else it says so of the first.
    """

    name: str
    foresees: bool = True
    can_restore: bool = True
    tells_jumps: bool = False

    @abstractmethod
    def set(self, name: str, value: float) -> None:
        """Set a scalar input."""

    @abstractmethod
    def get(self, name: str) -> float:
        """Return the present value of a scalar variable."""

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """Return what gives the present values of scalars, for one who reads the same ones often in one run."""
        return lambda: [self.get(name) for name in names]

    def writer(self, name: str) -> Callable[[Any], None]:
        """Return what sets a scalar input, for one who sets it often in one run."""
        return functools.partial(self.set, name)

    @abstractmethod
    def enter_event_mode(self) -> None:
        """Go from step mode to event mode."""

    @abstractmethod
    def enter_step_mode(self) -> None:
        """Go from event mode to step mode."""

    @abstractmethod
    def update(self) -> Update:
        """Do one event iteration: at most one jump."""

    @abstractmethod
    def step(self, t: float, t_next: float) -> Step:
        """Go from `t` to `t_next`, or to the first event before it."""

    @abstractmethod
    def save(self) -> Any:
        """Return the block's whole state."""

    @abstractmethod
    def restore(self, state: Any) -> None:
        """Return to a saved state, which may be restored again."""

    @abstractmethod
    def release(self, state: Any) -> None:
        """Free a saved state."""

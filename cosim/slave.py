"""What a master sees of a block: one interface for FMUs and for automata in this process."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cosim.errors import MisfitError


@dataclass(frozen=True)
class Port:
    """A scalar input or output.

    Attributes
    ----------
    name, unit : str
        As the block declares them.
    discrete : bool
        Whether it changes only at events.
    """

    name: str
    unit: str = ""
    discrete: bool = False


@dataclass(frozen=True)
class Termination:
    """Why a block ended the run.

    Attributes
    ----------
    message : str
        In the block's words.
    zeno : bool
        Whether a Zeno guard did, as far as the block says.
    """

    message: str
    zeno: bool


@dataclass(frozen=True)
class Update:
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
    """

    again: bool
    ticks: tuple[str, ...] = ()
    next_event: float | None = None
    terminated: Termination | None = None


@dataclass(frozen=True)
class Step:
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


class Slave(ABC):
    """A block in a co-simulation.

    The order of calls is FMI's: `set` start values, `start` (initialization mode), `set` inputs, `begin` (event mode,
    or step mode where events stay inside), then event iterations (`update`) and steps, and at last `close`.

    Parameters
    ----------
    name : str
        Name in the system.
    inputs, outputs : sequence of Port
        Scalars by name; elements of vectors are separate, ``w[1]``.
    clocks : sequence of str
        Names of the output clocks.
    """

    has_event_mode: bool
    """Whether events can be handled by the master, at their exact times."""
    can_restore: bool
    """Whether `save` and `restore` work."""

    def __init__(self, name: str, inputs: Sequence[Port], outputs: Sequence[Port], clocks: Sequence[str]) -> None:
        self.name = name
        self.inputs: Mapping[str, Port] = {port.name: port for port in inputs}
        self.outputs: Mapping[str, Port] = {port.name: port for port in outputs}
        self.clocks = tuple(clocks)

    @abstractmethod
    def start(self, t_start: float, t_stop: float, *, events: bool) -> None:
        """Enter initialization mode.

        Parameters
        ----------
        t_start, t_stop : float
            Times in s.
        events : bool
            Whether the master handles events; if not, the block handles them inside.
        """

    @abstractmethod
    def begin(self) -> None:
        """Leave initialization mode: into event mode if the master handles events, else into step mode."""

    @abstractmethod
    def set(self, name: str, value: float) -> None:
        """Set an input, or before `start` a start value or parameter."""

    @abstractmethod
    def get(self, name: str) -> float:
        """Return the present value of a variable."""

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

    @abstractmethod
    def close(self) -> None:
        """Free everything the block holds."""

    def unknown(self, name: str) -> MisfitError:
        """Return the error for a name that the block does not have."""
        return MisfitError(f"{self.name} has no variable {name!r}; it has {', '.join(self.variable_names)}.")

    @property
    @abstractmethod
    def variable_names(self) -> list[str]:
        """Names of all variables, parameters included."""

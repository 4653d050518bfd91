"""What a master sees of a block: one interface for FMUs and for automata in this process."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cosim.errors import MisfitError
from hybrid_model.blocks import Block, Step, Termination, Update

__all__ = ["Port", "Slave", "Step", "Termination", "Update"]


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


class Slave(Block):
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
    def close(self) -> None:
        """Free everything the block holds."""

    def unknown(self, name: str) -> MisfitError:
        """Return the error for a name that the block does not have."""
        return MisfitError(f"{self.name} has no variable {name!r}; it has {', '.join(self.variable_names)}.")

    @property
    @abstractmethod
    def variable_names(self) -> list[str]:
        """Names of all variables, parameters included."""

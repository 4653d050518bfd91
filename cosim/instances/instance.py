"""What the slave of an FMU needs of an instance of it, whatever version of the standard it is written for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosim.errors import CosimError

Getter = tuple[Callable[..., list[Any]], tuple[Any, ...]]
"""A function of fmpy, and the arguments with which it returns all elements of one variable."""


class Advance(NamedTuple):
    """What one call of DoStep gave.

    Attributes
    ----------
    reached : float
        Time in s that the FMU is at.
    event : bool
        Whether it asks for event mode.
    terminate : bool
        Whether it ends the run.
    early : bool
        Whether it returned before the end of the step.
    """

    reached: float
    event: bool
    terminate: bool
    early: bool


class FmuInstance(ABC):
    """An FMU whose binary is loaded; at most one instance of it at a time.

    Methods raise fmpy's ``FMICallException`` when the FMU answers with an error, or whatever fmpy raises when it
    cannot be loaded or instantiated.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
        Of the FMU.
    folder : Path
        The FMU, unpacked.
    name : str
        Of the instance.
    log : callable
        Told the status and the text of each message of the FMU.
    """

    def __init__(self, description: Any, folder: Path, name: str, log: Callable[[int, str], None]) -> None:
        self.name = name
        identifier = description.coSimulation.modelIdentifier
        self.fmu = self._load(description, folder, modelIdentifier=identifier, instanceName=name)
        self.log = log

    @abstractmethod
    def _load(self, description: Any, folder: Path, **arguments: Any) -> Any:
        """Return fmpy's object, with the binary loaded."""

    @abstractmethod
    def instantiate(self, events: bool) -> None:
        """Make the instance; `events` says whether the master handles events."""

    @abstractmethod
    def enter_initialization(self, t_start: float, t_stop: float) -> None:
        """Enter initialization mode; times in s."""

    def exit_initialization(self) -> None:
        """Leave initialization mode."""
        self.fmu.exitInitializationMode()

    @abstractmethod
    def getter(self, variable: Any, size: int) -> Getter:
        """Return what reads a variable of `size` elements."""

    @abstractmethod
    def set(self, variable: Any, values: Sequence[Any]) -> None:
        """Write all elements of a variable."""

    @abstractmethod
    def step(self, t: float, size: float) -> Advance:
        """Step from `t` towards `t + size`."""

    @abstractmethod
    def save(self) -> Any:
        """Return the state."""

    @abstractmethod
    def restore(self, state: Any) -> None:
        """Return to a state."""

    @abstractmethod
    def release(self, state: Any) -> None:
        """Free a state."""

    @abstractmethod
    def free(self) -> None:
        """Free the instance; the binary stays loaded."""

    # Structural parameters and events: of FMI 3.0 only.

    def enter_configuration(self) -> None:
        """Go to the mode in which structural parameters are set."""
        raise self._no_configuration()

    def exit_configuration(self) -> None:
        """Leave that mode."""
        raise self._no_configuration()

    def ticks(self, references: Sequence[int]) -> list[bool]:
        """Return which clocks tick."""
        raise self._no_events()

    def update(self) -> tuple[bool, bool, float | None]:
        """Do one event iteration; return whether it needs one more, whether it ends the run, the next event's time."""
        raise self._no_events()

    def enter_event_mode(self) -> None:
        """Go from step mode to event mode."""
        raise self._no_events()

    def enter_step_mode(self) -> None:
        """Go from event mode to step mode."""
        raise self._no_events()

    def _no_configuration(self) -> CosimError:
        return CosimError(f"{self.name} has no configuration mode: FMI 2.0 knows no structural parameters.")

    def _no_events(self) -> CosimError:
        return CosimError(f"{self.name} has no event mode: use the fixed-step master.")

"""What a master sees of a block: one interface for FMUs and for automata in this process."""

from __future__ import annotations

import weakref
from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from cosim.errors import CosimError, MisfitError
from cosim.measure import Measure
from fmu.importer.values import Value
from hybrid_model.schedule.blocks import Block

SHOWN = 20
"""Most names of variables in a message."""


@dataclass(frozen=True)
class Port:
    """A scalar input or output.

    Attributes
    ----------
    name, unit : str
        As the block declares them.
    discrete : bool
        Whether it changes only at events.
    kind : str
        What it carries: ``number``, ``truth`` (a Boolean), ``text`` or ``bytes``.
    whole : bool
        Whether its numbers are whole.
    array : str
        Name of the array that it is an element of, if it is one.
    measure : Measure or None
        What its unit is in SI units, as far as the block says.
    nominal : float
        Its usual size, as far as the block says; else 0.
    """

    name: str
    unit: str = ""
    discrete: bool = False
    kind: str = "number"
    whole: bool = False
    array: str = ""
    measure: Measure | None = None
    nominal: float = 0.0


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
    tunable : sequence of str
        Names of the parameters, scalars as well, that may be set during a run.
    """

    has_event_mode: bool
    """Whether events can be handled by the master, at their exact times."""
    failed_at_end: str = ""
    """What went wrong when it was closed; the run was over then."""
    stops_after_events: bool = False
    """Whether a block that handles its events inside ends its step after each one, if it may (`early` in `start`)."""
    variable_step: bool = True
    """Whether steps may differ in length."""
    internal_step: float | None = None
    """Length in s of the steps that its solver makes, if they have one: between them its outputs stand still."""
    direct: Mapping[str, Collection[str]] = MappingProxyType({})
    """Output -> inputs that it depends on at once, as far as the block says; scalars that are no elements of arrays."""
    sloped: Collection[str] = ()
    """Outputs whose derivatives by time it gives, with `slopes`."""
    interpolating: Collection[str] = ()
    """Inputs that may change along straight lines within a step, with `lead`."""
    default_start_time: float | None = None
    default_stop_time: float | None = None
    default_step: float | None = None
    """Times in s that the block proposes for a run: start, stop, and the step of communication."""

    def __init__(
        self,
        name: str,
        inputs: Sequence[Port],
        outputs: Sequence[Port],
        clocks: Sequence[str],
        tunable: Sequence[str] = (),
    ) -> None:
        self.name = name
        self.inputs: Mapping[str, Port] = {port.name: port for port in inputs}
        self.outputs: Mapping[str, Port] = {port.name: port for port in outputs}
        self.clocks = tuple(clocks)
        self.tunable = tuple(tunable)
        self._told_of_sizes: list[weakref.ReferenceType[Callable[[], None]]] = []

    def tell_of_sizes(self, told: weakref.ReferenceType[Callable[[], None]]) -> None:
        """Have something called, for as long as it is there, when arrays among the inputs and outputs are resized."""
        self._told_of_sizes = [*(other for other in self._told_of_sizes if other() is not None), told]

    def _tell_of_sizes(self) -> None:
        for reference in self._told_of_sizes:
            if (told := reference()) is not None:
                told()

    @abstractmethod
    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """Enter initialization mode.

        Parameters
        ----------
        t_start, t_stop : float
            Times in s.
        events : bool
            Whether the master handles events; if not, the block handles them inside.
        early : bool
            Whether steps may end early where the block handles its events inside; a step that does has `event` set.

        Raises
        ------
        CosimError
            If the block refuses, or has no event mode where the master handles events.
        """

    @abstractmethod
    def begin(self) -> None:
        """Leave initialization mode: into event mode if the master handles events, else into step mode."""

    @abstractmethod
    def set(self, name: str, value: Value) -> None:
        """Set an input or a tunable parameter; until `begin` any parameter, and before `start` a start value.

        What the change brings about happens at the present time: in the next `update` in event mode, else in the next
        step, before time goes on.

        Raises
        ------
        MisfitError
            If there is no such variable, it does not hold the value exactly, or it is fixed by now.
        """

    @abstractmethod
    def get(self, name: str) -> Any:
        """Return the present value of a scalar variable: a `Value`."""

    def slopes(self, names: Sequence[str]) -> Callable[[], list[float]]:
        """Return what gives the present derivatives by time of outputs among `sloped`.

        Raises
        ------
        CosimError
            If the block gives no derivatives of its outputs.
        """
        raise CosimError(f"{self.name} gives no derivatives of its outputs: ask for those in its list `sloped` alone.")

    def lead(self, lines: Mapping[str, tuple[float, float]]) -> None:
        """Let inputs among `interpolating` have values at the start of the next step, and slopes in it.

        Raises
        ------
        CosimError
            If the block holds its inputs in a step.
        """
        raise CosimError(f"{self.name} holds its inputs in a step: lead those in its list `interpolating` alone.")

    def parse(self, name: str, text: str) -> Value:
        """Return the value of a variable that a text says, for `set`.

        Raises
        ------
        MisfitError
            If it says none of the variable's type.
        """
        try:
            return float(text)
        except ValueError:
            raise MisfitError(f"{self.name}.{name} is set to {text!r}: give a number.") from None

    @abstractmethod
    def close(self) -> None:
        """Free everything the block holds."""

    def has(self, name: str) -> bool:
        """Return whether there is a variable of that name: a scalar, or an array."""
        return any(own == name or own.startswith(f"{name}[") for own in self.variable_names)

    def unknown(self, name: str) -> MisfitError:
        """Return the error for a name that the block does not have."""
        names = self.variable_names
        near = get_close_matches(name, names, 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        return MisfitError(f"{self.name} has no variable {name!r}; it has {', '.join(names[:SHOWN])}{more}.{meant}")

    @property
    @abstractmethod
    def variable_names(self) -> list[str]:
        """Names of all variables, parameters included."""

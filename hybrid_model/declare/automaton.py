"""What every execution of an automaton uses: its variables, its jumps, and its maps on values by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.transitions import Assignments, ClockInfo, JumpInfo, Priority
from hybrid_model.declare.variables import Kind, Value, Values, Variable
from hybrid_model.errors import DeclarationError

_SHOWN = 4
"""As many names of a kind as a person reads."""


class Automaton(ABC):
    """What every execution of an automaton uses; `HybridAutomaton` and `Composition` implement it.

    Each map takes the values of all variables at one instant and must work on floats, arrays and symbols alike.

    Attributes
    ----------
    name : str
        Name of the automaton, for messages and as the name of an FMU.
    variables : tuple of Variable
        In declaration order.
    jumps : tuple of JumpInfo
        In the fixed order in which simultaneous jumps are taken.
    clocks : tuple of ClockInfo
        Outputs that tick.
    priority : Priority
        What happens where flow set and jump set overlap.
    stiff : bool, optional
        Whether time scales of the flow differ so much that an explicit method would go by the fastest; None: found out
        in the run.
    """

    name: str
    variables: tuple[Variable, ...]
    jumps: tuple[JumpInfo, ...]
    clocks: tuple[ClockInfo, ...]
    priority: Priority
    stiff: bool | None = None
    joined: ClassVar[Callable[[Automaton, str, object], Automaton]]
    """What the operators do: a composition, which is an automaton itself and so comes after it."""

    @property
    @abstractmethod
    def has_flow_set(self) -> bool:
        """Whether flow is restricted at all."""

    @abstractmethod
    def start_values(self, s: Values) -> Assignments:
        """Return the start values of the computed states."""

    @abstractmethod
    def derivatives(self, s: Values) -> Assignments:
        """Return the time derivative of every continuous state."""

    @abstractmethod
    def flow_margin(self, s: Values) -> Value:
        """Return the flow set's margin (scalar, >= 0 inside)."""

    @abstractmethod
    def jump_margins(self, s: Values) -> list[Value]:
        """Return the margins of the jumps on state, in the order of `jumps` (scalars, >= 0 enabled)."""

    @abstractmethod
    def event_times(self, s: Values) -> list[Value]:
        """Return the absolute times in s of the jumps on time, in the order of `jumps`."""

    @abstractmethod
    def reset(self, jump: int, s: Values) -> Assignments:
        """Return the new values that jump number `jump` gives to states."""

    @abstractmethod
    def output_values(self, s: Values) -> Assignments:
        """Return the values of the computed outputs."""

    def output_value(self, name: str, s: Values) -> Value:
        """Return the value of one computed output; a composition computes only what that one needs."""
        return self.output_values(s)[name]

    def of_kind(self, *kinds: Kind) -> list[Variable]:
        """Return the variables of the given kinds, in declaration order."""
        return [v for v in self.variables if v.kind in kinds]

    # Block diagrams, as in python-control: see `hybrid_model.declare.diagrams.operators`.

    def __mul__(self, first: object) -> Automaton:
        """Return ``second * first``: the outputs of the first drive the inputs of the second, in their order."""
        return self.joined("*", first)

    def __rmul__(self, gain: object) -> Automaton:
        """Return the automaton with its outputs times a number."""
        return self.joined("gain", gain)

    def __neg__(self) -> Automaton:
        """Return the automaton with its outputs negated."""
        return self.joined("gain", -1.0)

    def __add__(self, other: object) -> Automaton:
        """Return both on the same inputs, with their outputs added."""
        return self.joined("+", other)

    def __sub__(self, other: object) -> Automaton:
        """Return both on the same inputs, with the outputs of the other taken away."""
        return self.joined("-", other)

    def __repr__(self) -> str:
        if not hasattr(self, "variables"):
            return object.__repr__(self)
        named = {kind.value: [variable.name for variable in self.of_kind(kind)] for kind in Kind}
        named["jumps"] = [jump.name for jump in self.jumps]
        listed = [f"{what} {_some(names)}" for what, names in named.items() if names]
        return f"{type(self).__name__}({self.name}: {'; '.join(listed)})"


def _some(names: list[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def require_automaton(given: object) -> None:
    """Refuse what is no automaton, such as a class instead of an instance.

    Raises
    ------
    DeclarationError
        With what to write.
    """
    if isinstance(given, type):
        raise DeclarationError(f"{given.__name__} is a class: make an instance of it, {given.__name__}().")
    if not isinstance(given, Automaton):
        raise DeclarationError(f"{told(given)} is not an automaton: give a HybridAutomaton or a Composition.")
    require_made(given)


def require_made(given: Automaton) -> None:
    """Refuse an automaton whose class has an ``__init__`` of its own that does not call that of its base.

    Raises
    ------
    DeclarationError
        With what to write.
    """
    if not hasattr(given, "variables"):
        cls = type(given).__name__
        raise DeclarationError(
            f"{cls} has an __init__ that leaves the variables out: call super().__init__(...) in it."
        )

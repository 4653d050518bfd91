"""Transitions and clocks: what authors of automata declare, and what executions see of it."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hybrid_model.declare.signatures import ExplainedCall, require_map
from hybrid_model.declare.variables import Value, Values
from hybrid_model.errors import DeclarationError

Assignments = Mapping[str, Value]
"""Variable name -> value: what flow, jump, start and output maps return."""


class Priority(enum.Enum):
    """What happens where flow set and jump set overlap."""

    JUMP = "a state in the jump set jumps"
    FLOW = "a state in the flow set flows on; it jumps when it cannot flow"


class Trigger(enum.Enum):
    """What makes a jump happen."""

    STATE = "its margin is zero or above"
    TIME = "its time has come"


@dataclass(frozen=True)
class JumpInfo:
    """A jump of an automaton as executions see it.

    Attributes
    ----------
    name : str
        Unique in the automaton; in a composition scoped by dots.
    trigger : Trigger
        State margin or known time.
    internal : bool
        A breakpoint of the flow: it depends on time, parameters and discrete states only, and nobody outside sees it.
    """

    name: str
    trigger: Trigger
    internal: bool = False


@dataclass(frozen=True)
class Jump(ExplainedCall):
    """A jump on a state margin, for automata with several: jump set (margin) and jump map by name.

    Attributes
    ----------
    name : str
        Name of the jump.
    jump_set : callable
        ``jump_set(self, s) -> margin``; the jump is enabled where the margin is zero or above.
    jump_map : callable
        ``jump_map(self, s) -> {state: new value}``; states not named are kept.
    """

    name: str
    jump_set: Callable[[Any, Values], Value]
    jump_map: Callable[[Any, Values], Assignments]

    def __post_init__(self) -> None:
        require_maps(self, "jump_set", "jump_map")


@dataclass(frozen=True)
class TimeEvent(ExplainedCall):
    """A jump at a known time.

    Attributes
    ----------
    name : str
        Name of the jump.
    time : callable
        ``time(self, s) -> absolute time`` in s of the next one, from parameters and discrete states; infinity for
        never. The jump map must move it on.
    jump_map : callable
        As in `Jump`.
    internal : bool
        Whether it is only a breakpoint of the flow (a weight that switches): runs stop at it and go on, and it is not
        an event for anybody outside.
    """

    name: str
    time: Callable[[Any, Values], Value]
    jump_map: Callable[[Any, Values], Assignments]
    internal: bool = False

    def __post_init__(self) -> None:
        require_maps(self, "time", "jump_map")


def require_maps(transition: Any, *maps: str) -> None:
    """Require that a transition or a mode has a name, and functions of the instance and its values.

    Parameters
    ----------
    transition : Jump, TimeEvent, Mode, Switch or TimedSwitch
        What an author wrote.
    *maps : str
        Names of its functions.

    Raises
    ------
    DeclarationError
        With what to write.
    """
    kind = type(transition).__name__
    if not isinstance(transition.name, str):
        raise DeclarationError(f"{kind} has the name {transition.name!r}: give a text first, hm.{kind}('name', ...).")
    for name in maps:
        require_map(f"{name} of {kind} {transition.name!r}", getattr(transition, name))


class Clock(ExplainedCall):
    """An output that ticks with a jump, and holds no value.

    Parameters
    ----------
    jump : str
        Name of the jump that it ticks with.
    description : str
        For people and for the FMU's description.
    """

    def __init__(self, jump: str, description: str = "") -> None:
        self.jump = jump
        self.description = description


@dataclass(frozen=True)
class ClockInfo:
    """A clock of an automaton as executions see it: ticks with jump number `jump`."""

    name: str
    jump: int
    description: str = ""

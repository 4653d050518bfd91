"""What a file keeps of an automaton: its names, variables and jumps, without its maps."""

from __future__ import annotations

from typing import Any, NoReturn

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.transitions import ClockInfo, JumpInfo, Priority
from hybrid_model.declare.variables import Variable
from hybrid_model.errors import DeclarationError


def _refusing(what: str) -> Any:
    """Return a method that says that it is not in the file."""

    def refuse(self: LoadedAutomaton, *given: object) -> NoReturn:
        raise DeclarationError(
            f"{self.name} comes from a file, which holds a run and not the {what}: use the automaton that ran."
        )

    return refuse


class LoadedAutomaton(Automaton):
    """The automaton of a loaded arc: it can be read, and not run.

    Parameters
    ----------
    name, variables, jumps, clocks, priority
        See `Automaton`.
    has_flow_set : bool
        Whether the automaton that ran restricts flow.
    """

    def __init__(
        self,
        name: str,
        variables: tuple[Variable, ...],
        jumps: tuple[JumpInfo, ...],
        clocks: tuple[ClockInfo, ...],
        priority: Priority,
        *,
        has_flow_set: bool,
    ) -> None:
        self.name = name
        self.variables = variables
        self.jumps = jumps
        self.clocks = clocks
        self.priority = priority
        self._has_flow_set = has_flow_set

    @property
    def has_flow_set(self) -> bool:
        """See `Automaton.has_flow_set`."""
        return self._has_flow_set

    start_values = _refusing("start map")
    derivatives = _refusing("flow map")
    flow_margin = _refusing("flow set")
    jump_margins = _refusing("jump sets")
    event_times = _refusing("time events")
    reset = _refusing("jump maps")
    output_values = _refusing("output map")

"""What a file keeps of an automaton: its names, variables and jumps, without its maps."""

from __future__ import annotations

from typing import NoReturn

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.transitions import Assignments, ClockInfo, JumpInfo, Priority
from hybrid_model.declare.variables import Value, Values, Variable
from hybrid_model.errors import DeclarationError


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

    def start_values(self, s: Values) -> Assignments:
        """Refuse, see `Automaton.start_values`."""
        self._refuse("start map")

    def derivatives(self, s: Values) -> Assignments:
        """Refuse, see `Automaton.derivatives`."""
        self._refuse("flow map")

    def flow_margin(self, s: Values) -> Value:
        """Refuse, see `Automaton.flow_margin`."""
        self._refuse("flow set")

    def jump_margins(self, s: Values) -> list[Value]:
        """Refuse, see `Automaton.jump_margins`."""
        self._refuse("jump sets")

    def event_times(self, s: Values) -> list[Value]:
        """Refuse, see `Automaton.event_times`."""
        self._refuse("time events")

    def reset(self, jump: int, s: Values) -> Assignments:
        """Refuse, see `Automaton.reset`."""
        self._refuse("jump maps")

    def output_values(self, s: Values) -> Assignments:
        """Refuse, see `Automaton.output_values`."""
        self._refuse("output map")

    def _refuse(self, what: str) -> NoReturn:
        raise DeclarationError(
            f"{self.name} comes from a file, which holds a run and not the {what}: use the automaton that ran."
        )

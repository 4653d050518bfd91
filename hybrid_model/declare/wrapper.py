"""An automaton that hands its maps on to another one: what subclasses change is all that they say."""

from __future__ import annotations

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.transitions import Assignments
from hybrid_model.declare.variables import Value, Values


class Wrapper(Automaton):
    """Another automaton, with all that is its own.

    Parameters
    ----------
    automaton : Automaton
        The other one.
    """

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.name, self.variables = automaton.name, automaton.variables
        self.jumps, self.clocks, self.priority = automaton.jumps, automaton.clocks, automaton.priority
        self.stiff = automaton.stiff

    def inner(self, s: Values) -> Values:
        """Return the values that the other automaton's maps are to see."""
        return s

    @property
    def has_flow_set(self) -> bool:
        """See `Automaton.has_flow_set`."""
        return self.automaton.has_flow_set

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`."""
        return self.automaton.start_values(self.inner(s))

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`."""
        return self.automaton.derivatives(self.inner(s))

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`."""
        return self.automaton.flow_margin(self.inner(s))

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`."""
        return self.automaton.jump_margins(self.inner(s))

    def event_times(self, s: Values) -> list[Value]:
        """See `Automaton.event_times`."""
        return self.automaton.event_times(self.inner(s))

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`."""
        return self.automaton.reset(jump, self.inner(s))

    def output_values(self, s: Values) -> Assignments:
        """See `Automaton.output_values`."""
        return self.automaton.output_values(self.inner(s))

"""One of many automata with the same maps: its own name, start values and parameters, and the maps of a template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.transitions import Assignments
from hybrid_model.declare.variables import FloatArray, Value, Values


class Copy(Automaton):
    """An automaton that differs from another one in its name and in numbers.

    Parameters
    ----------
    template : Automaton
        Whose maps it has.
    name : str
        Its own.
    starts : mapping
        Variable -> start value, for those in which it differs.
    """

    def __init__(self, template: Automaton, name: str, starts: Mapping[str, FloatArray]) -> None:
        self.template, self.name = template, name
        self.variables = tuple(
            replace(variable, start=starts[variable.name]) if variable.name in starts else variable
            for variable in template.variables
        )
        self.jumps, self.clocks = template.jumps, template.clocks
        self.priority, self.stiff = template.priority, template.stiff

    @property
    def has_flow_set(self) -> bool:
        """Whether flow is restricted at all."""
        return self.template.has_flow_set

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`."""
        return self.template.start_values(s)

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`."""
        return self.template.derivatives(s)

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`."""
        return self.template.flow_margin(s)

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`."""
        return self.template.jump_margins(s)

    def event_times(self, s: Values) -> list[Value]:
        """See `Automaton.event_times`."""
        return self.template.event_times(s)

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`."""
        return self.template.reset(jump, s)

    def output_values(self, s: Values) -> Assignments:
        """See `Automaton.output_values`."""
        return self.template.output_values(s)

    def output_value(self, name: str, s: Values) -> Value:
        """See `Automaton.output_value`."""
        return self.template.output_value(name, s)

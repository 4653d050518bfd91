"""An automaton that hands its maps on to another one: what subclasses change is all that they say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.transitions import Assignments
from hybrid_model.declare.variables import Kind, Value, Values, element_names
from hybrid_model.errors import DeclarationError


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


def with_starts(automaton: Automaton, values: Mapping[str, float]) -> Automaton:
    """Return an automaton with other start values and parameters as its own.

    Parameters
    ----------
    automaton : Automaton
    values : mapping
        Scalar, such as ``x`` or ``w[2]`` -> value.

    Raises
    ------
    DeclarationError
        For what is no variable, or is computed by the automaton.
    """
    made, left = Wrapper(automaton), dict(values)
    variables = []
    for variable in automaton.variables:
        elements = element_names(variable)
        given = [left.pop(name, None) for name in elements]
        if any(value is not None for value in given):
            if variable.computed or variable.kind is Kind.OUTPUT:
                raise DeclarationError(
                    f"{automaton.name}.{variable.name} is computed, so its start value cannot be given: give the "
                    "values that it is computed from."
                )
            old = variable.start.ravel()
            new = np.array([k if value is None else value for k, value in zip(old, given, strict=True)])
            variable = replace(variable, start=new.reshape(variable.shape))
        variables.append(variable)
    if left:
        raise DeclarationError(f"{automaton.name} has nothing named {next(iter(left))!r} to set.")
    made.variables = tuple(variables)
    return made

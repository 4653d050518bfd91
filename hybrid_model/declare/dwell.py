"""Minimum dwell time: a regularisation that bounds the rate of jumps, and shows in the result that it did."""

from __future__ import annotations

import math

import numpy as np

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.margins import greatest, least
from hybrid_model.declare.real_numbers import is_real
from hybrid_model.declare.transitions import Assignments, Trigger
from hybrid_model.declare.variables import Kind, Value, Values, Variable
from hybrid_model.declare.wrapper import Wrapper
from hybrid_model.errors import DeclarationError

SINCE, HELD, DWELL = "since_jump", "held_jumps", "minimum_dwell"
EXPIRED = 1e-9
"""Part of the dwell time: a jump so soon after it is over was waiting for it."""


class MinimumDwell(Wrapper):
    """An automaton whose jumps on state keep a minimum time apart (temporal regularisation).

    A timer runs since the last jump on state; before it has reached the dwell time, no jump on state is taken and flow
    goes on, outside the flow set as well (Johansson, Egerstedt, Lygeros, Sastry 1999, section 4; Goebel, Sanfelice,
    Teel, Hybrid Dynamical Systems, section 2.4). So a Zeno automaton has solutions for all times, which are those of a
    changed system: the state ``held_jumps`` counts the jumps that came late, and the name tells the dwell time. Jumps
    at known times are not held back.

    Parameters
    ----------
    automaton : Automaton
        What to regularise: a whole system, or one part of a composition.
    dwell : float
        Minimum time between two jumps on state, in s.

    Raises
    ------
    DeclarationError
        If `dwell` is not positive, or a variable has the name of one that is added: ``since_jump``, ``held_jumps``,
        ``minimum_dwell``.
    """

    def __init__(self, automaton: Automaton, dwell: float) -> None:
        require_automaton(automaton)
        if not (is_real(dwell) and math.isfinite(dwell) and dwell > 0.0):
            raise DeclarationError(f"the minimum dwell time of {automaton.name} is {dwell!r} s: give a positive time.")
        taken = {SINCE, HELD, DWELL} & {variable.name for variable in automaton.variables}
        if taken:
            raise DeclarationError(f"{automaton.name} has a variable {min(taken)!r} already: rename it.")
        super().__init__(automaton)
        self.name = f"{automaton.name} (minimum dwell time {dwell:g} s)"
        self.variables = (
            *automaton.variables,
            Variable(SINCE, Kind.STATE, np.array(0.0), "s", "time since the last jump on state", computed=True),
            Variable(HELD, Kind.DISCRETE, np.array(0.0), "", "jumps that waited", integer=True, output=True),
            Variable(DWELL, Kind.PARAMETER, np.array(float(dwell)), "s", "minimum time between two jumps on state"),
        )

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`; the first jump has nothing to wait for."""
        return {**super().start_values(s), SINCE: 2.0 * s[DWELL]}

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`: the automaton's, and the timer runs."""
        return {**super().derivatives(s), SINCE: 1.0}

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`: the flow set, and everything before the dwell time is over."""
        return greatest(super().flow_margin(s), s[DWELL] - s[SINCE])

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`: the jump sets after the dwell time is over."""
        return [least(margin, s[SINCE] - s[DWELL]) for margin in super().jump_margins(s)]

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`: a jump on state starts the timer anew, and is counted if it waited."""
        new = super().reset(jump, s)
        if self.jumps[jump].trigger is Trigger.TIME:
            return new
        waited = np.where(s[SINCE] - s[DWELL] <= EXPIRED * s[DWELL], 1.0, 0.0)
        return {**new, SINCE: 0.0, HELD: s[HELD] + waited}

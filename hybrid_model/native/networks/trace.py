"""Traces of the parts of a network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import TraceError
from hybrid_model.native.networks.groups import Group
from hybrid_model.native.networks.members import Members
from hybrid_model.native.networks.pattern import NetworkPattern
from hybrid_model.native.networks.trace_reuse import Kin, watched
from hybrid_model.native.trace import Trace, _Tracer, steady_trace, trace

_MOST_KIN = 8


class _PartTracer(_Tracer):
    """Traces a part without asking where its inputs come from: over a wire, an input may be a discrete state."""

    def _times(self) -> ca.SX:
        return self._scalars(self._call(self.automaton.event_times, "an event's time"), "an event's time")

    def _reset(self, index: int) -> ca.Function:
        info = self.automaton.jumps[index]
        x, z = self._new_states(lambda s: self.automaton.reset(index, s), f"the jump map of {info.name!r}")
        return self._function(f"reset{index}", x, z)


def part_traces(parts: Sequence[Automaton]) -> tuple[list[Trace], list[int]]:
    """Trace the parts of a network.

    Returns
    -------
    traces : list of Trace
        Of parts whose maps may differ.
    alike : list of int
        For each part the number of its trace.
    """
    traces: list[Trace] = []
    alike: list[int] = []
    kin: dict[tuple[object, ...], list[tuple[Kin, int]]] = {}
    for part in parts:
        known = kin.setdefault((type(part), *Layout(part).sizes.values(), len(part.jumps)), [])
        number = next((number for one, number in known if one.has(part)), None)
        if number is None:
            number = len(traces)
            with watched(part) as reads:
                traces.append(steady_trace(_PartTracer, part))
            # Parts that all differ are not compared with all others.
            known[:] = [(Kin(part, reads), number), *known[: _MOST_KIN - 1]]
        alike.append(number)
    return traces, alike


def require_known_times(
    composition: Composition,
    members: Members,
    groups: Sequence[Group],
    group_of: Sequence[int],
    patterns: NetworkPattern,
) -> None:
    """Refuse event times that are not known beforehand, and internal events that are more than breakpoints.

    Raises
    ------
    TraceError
        See `hybrid_model.native.trace.trace`.
    """
    for number, member in enumerate(members.members):
        for use in _uses(groups[group_of[number]]):
            if use.own:
                # The part itself says what is wrong with it.
                trace(member.automaton)
            if patterns.outside(patterns.of_inputs(number, use.inputs), time=use.is_time):
                raise TraceError(
                    f"{composition.name}: an event of {member.path} ({use.event}) depends, by its inputs, on the time, "
                    "a continuous state or an input of the whole: known times, and breakpoints that nobody sees, come "
                    "from parameters and discrete states; use a jump set otherwise."
                )


@dataclass(frozen=True)
class _Use:
    """What the time of a time event, or an internal event, makes use of."""

    event: str
    is_time: bool
    own: bool
    inputs: list[int]


def _uses(group: Group) -> list[_Use]:
    found = []
    place = 0
    for k, info in enumerate(group.traced.automaton.jumps):
        if info.trigger is Trigger.TIME:
            t, x, u = (group.rows("times", 0, argument)[place] for argument in (0, 1, 3))
            found.append(_Use(info.name, True, bool(t or x), list(u)))
            place += 1
        if info.internal:
            own = group.changes(f"reset{k}", Kind.STATE) or bool(group.columns(f"reset{k}", 1, 1))
            found.append(_Use(info.name, False, own, group.columns(f"reset{k}", 1, 3)))
    return found

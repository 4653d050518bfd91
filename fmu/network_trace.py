"""Traces of the parts of a network."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from fmu.errors import TraceError
from fmu.network_groups import Group
from fmu.network_kin import Kin, watched
from fmu.network_members import Members
from fmu.network_pattern import NetworkPattern
from fmu.trace import Trace, _Tracer, trace
from hybrid_model import Automaton, Composition
from hybrid_model.layout import Layout
from hybrid_model.transitions import Trigger
from hybrid_model.variables import Kind

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
                traces.append(_PartTracer(part).trace())
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
        See `fmu.trace.trace`.
    """
    for number, member in enumerate(members.members):
        group = groups[group_of[number]]
        for what, uses in _restricted(group):
            inputs = patterns.of_inputs(number, uses["u"])
            forbidden = uses["t"] or uses["x"] or uses["changes"] or patterns.outside(inputs, time=what == "time")
            if forbidden:
                # The part says it best, if it is its own doing.
                trace(member.automaton)
                raise TraceError(
                    f"{composition.name}: the time of an event of {member.path}, or one of its internal events, "
                    "depends over a wire on more than parameters and discrete states: use a jump set, or wire a sample."
                )


def _restricted(group: Group) -> list[tuple[str, dict[str, list[int]]]]:
    jumps = group.traced.automaton.jumps
    found = []
    if any(info.trigger is Trigger.TIME for info in jumps):
        found.append(("time", {name: group.columns("times", 0, k) for name, k in (("t", 0), ("x", 1), ("u", 3))}))
        found[-1][1]["changes"] = []
    for k, info in enumerate(jumps):
        if info.internal:
            uses = {name: group.columns(f"reset{k}", 1, at) for name, at in (("x", 1), ("u", 3))}
            changes = [0] if group.changes(f"reset{k}", Kind.STATE) else []
            found.append(("internal", {"t": [], "changes": changes, **uses}))
    return found

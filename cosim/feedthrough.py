"""Which signals of a system depend on each other at once: the order in which start values go, and loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from cosim.errors import CosimError
from cosim.system import Connection, System

Leads = Callable[[Connection, Connection], bool]
"""Whether what arrives over one connection is in what leaves over the other."""


def in_order(system: System) -> Sequence[Connection]:
    """Return the connections so that each comes after those that its value is made of, as far as slaves say it.

    With loops, and where no slave says anything, they are in the order of the system.
    """
    found = _sorted(system.connections, _leads_by_description(system))
    return found if isinstance(found, tuple) else system.connections


def refuse_loops(system: System) -> None:
    """Refuse continuous signals that depend on each other at once by what the descriptions of their slaves say.

    Raises
    ------
    CosimError
        With all of the loop, if the system does not have loops iterated.
    """
    if system.loop_iterations:
        return
    flows = [connection for connection in system.connections if system.is_continuous(connection)]
    found = _sorted(flows, _leads_by_description(system))
    if isinstance(found, list):
        loop = _listed(list(map(str, found)))
        raise CosimError(
            f"{loop} depend on each other at once, in a loop. Break it by a state, or have it iterated "
            "(--loop-iterations 100)."
        )


def told_loop(unsettled: Mapping[Connection, str]) -> str:
    """Return words for the loop among connections whose signals do not settle, each with what is said of it."""
    found = _sorted(list(unsettled), lambda one, other: one.target == other.source)
    if isinstance(found, list):
        return f"{_listed([f'{wire}{unsettled[wire]}' for wire in found])} form a loop"
    first = next(iter(unsettled))
    return f"{first}{unsettled[first]} and others form a loop"


def _leads_by_description(system: System) -> Leads:
    direct = {name: slave.direct for name, slave in system.slaves.items()}
    return lambda one, other: one.target == other.source and one.input in direct[one.target].get(other.output, ())


def _sorted(connections: Sequence[Connection], leads: Leads) -> tuple[Connection, ...] | list[Connection]:
    """Return the connections in order; as a list the ones of a loop, if there is one."""
    leaving: dict[str, list[Connection]] = {}
    for connection in connections:
        leaving.setdefault(connection.source, []).append(connection)
    sorter: TopologicalSorter[Connection] = TopologicalSorter({connection: () for connection in connections})
    for one in connections:
        for other in leaving.get(one.target, ()):
            if leads(one, other):
                sorter.add(other, one)
    try:
        return tuple(sorter.static_order())
    except CycleError as error:
        loop: list[Connection] = error.args[1][:-1]
        return loop


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]

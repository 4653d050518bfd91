"""Connections from terminal to terminal, taken apart to those of their members (FMI 3.0.2 section 2.4.9)."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.errors import MisfitError
from cosim.slave import Slave
from cosim.sources import Source
from cosim.systems.definition import FMU, SystemDefinition
from fmu.archives.reading import ArchiveError
from fmu.importer.plain_xml import PlainXmlError
from fmu.importer.terminals import SIGNAL, Terminal, read_terminals

RULES = ("plug", "bus", "sequence")


def unplugged(definition: SystemDefinition, slaves: Mapping[str, Slave]) -> dict[str, Source]:
    """Return the connections of a system from variable to variable.

    A connection is one of terminals where its input's name is no variable: then members that have one name, or one
    place in a sequence, are connected, from the one that is an output to the one that is an input. Clocks tell of
    their own FMU's events and are left unconnected.

    Parameters
    ----------
    definition : SystemDefinition
    slaves : mapping
        Its slaves by name, not started.

    Raises
    ------
    MisfitError
        If terminals do not match by their rule, have members that are no signals or ends that go the same way, or an
        input is driven twice.
    """
    known: dict[str, dict[str, Terminal]] = {}
    sources = {component.name: component.source for component in definition.components if component.kind == FMU}

    def terminal(name: str) -> tuple[Slave, Terminal] | None:
        owner = next((n for n in sorted(slaves, key=len, reverse=True) if name.startswith(f"{n}.")), None)
        if owner is None or owner not in sources:
            return None
        if owner not in known:
            known[owner] = _terminals(owner, sources[owner])
        found = known[owner].get(name[len(owner) + 1 :])
        return None if found is None else (slaves[owner], found)

    connections: dict[str, Source] = {}
    for target, source in definition.connections.items():
        into = None if _is_variable(target, slaves) else terminal(target)
        if into is None:
            connections[target] = source
            continue
        out_of = terminal(source) if isinstance(source, str) else None
        if out_of is None:
            raise MisfitError(
                f"{target} is a terminal, and is to be connected to {source!r}: name a terminal of an FMU."
            )
        for own, other in _joined(f"{source} -> {target}", out_of, into).items():
            if own in connections or own in definition.connections:
                raise MisfitError(f"{other} -> {own}, of {source} -> {target}, is driven twice: leave one out.")
            connections[own] = other
    return connections


def _is_variable(name: str, slaves: Mapping[str, Slave]) -> bool:
    return any(name.startswith(f"{own}.") and slave.has(name[len(own) + 1 :]) for own, slave in slaves.items())


def _terminals(name: str, path: str) -> dict[str, Terminal]:
    try:
        return read_terminals(path)
    except (ArchiveError, PlainXmlError) as error:
        raise MisfitError(f"{name}: its terminals cannot be read: {error}.") from error


def _joined(told: str, one: tuple[Slave, Terminal], other: tuple[Slave, Terminal]) -> dict[str, Source]:
    (first, a), (second, b) = one, other
    if a.rule != b.rule or a.rule not in RULES:
        raise MisfitError(
            f"{told}: the terminals match by {a.rule!r} and {b.rule!r}: give two of one of {', '.join(RULES)}."
        )
    alone = sorted(set(a.members) ^ set(b.members))
    if alone and a.rule != "bus":
        raise MisfitError(
            f"{told}: the member {alone[0]} is in one of the terminals only, which a {a.rule} does not allow."
        )
    connections: dict[str, Source] = {}
    for member, (out, kind) in a.members.items():
        into, other_kind = b.members.get(member, (out, kind))
        if {kind, other_kind} != {SIGNAL}:
            raise MisfitError(
                f"{told}: {member} is of kind {kind!r} and {other_kind!r}, and signals alone are connected."
            )
        if member in b.members:
            connections |= _wire(f"{told}: {member}", first, out, second, into)
    if not connections:
        raise MisfitError(f"{told}: the terminals have no signals in common.")
    return connections


def _wire(told: str, first: Slave, a: str, second: Slave, b: str) -> dict[str, Source]:
    """Return the connection of two members, whichever of them is the output."""
    if any(variable in slave.clocks for slave, variable in ((first, a), (second, b))):
        return {}
    for source, out, target, into in ((first, a, second, b), (second, b, first, a)):
        if _among(out, source.outputs) and _among(into, target.inputs):
            return {f"{target.name}.{into}": f"{source.name}.{out}"}
    raise MisfitError(f"{told} is {first.name}.{a} and {second.name}.{b}, and not an output and an input.")


def _among(name: str, ports: Mapping[str, object]) -> bool:
    return name in ports or any(port.startswith(f"{name}[") for port in ports)

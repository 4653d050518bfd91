"""A described system made into slaves with connections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cosim.automaton_slave import AutomatonSlave
from cosim.errors import MisfitError
from cosim.exchange_slave import ExchangeSlave
from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import PATIENCE, IsolatedSlave
from cosim.slave import Slave
from cosim.system import System
from cosim.systems.automaton_files import find_automaton
from cosim.systems.definition import FMU, Component, SystemDefinition
from cosim.systems.plugs import unplugged
from fmu.importer.loading import UNREADABLE, read_description
from hybrid_model.named_objects import imports_from


def assemble(
    definition: SystemDefinition,
    *,
    validate: bool = True,
    isolate: bool = False,
    patience: float = PATIENCE,
    loop_iterations: int = 0,
    prepare: Callable[[dict[str, Slave]], None] | None = None,
) -> System:
    """Make a system: its slaves with their start values, and its connections.

    Parameters
    ----------
    definition : SystemDefinition
    validate : bool
        Whether to hold descriptions of FMUs against the schema.
    isolate : bool
        Whether to run each FMU in a process of its own.
    patience : float
        Seconds that one call of an isolated FMU may take.
    loop_iterations : int
        See `System`.
    prepare : callable, optional
        Given the slaves by name before they are connected: what else is set in them may change the sizes of arrays.

    Raises
    ------
    CosimError
        If an FMU cannot be used; MisfitError if a value, a connection or a terminal does not fit.
    UsageError, ExportError
        If an automaton cannot be found or made.
    """
    slaves = [_slave(component, validate, patience if isolate else None) for component in definition.components]
    for component, slave in zip(definition.components, slaves, strict=True):
        for name in sizes_first(component.start):
            set_start(slave, name, component.start[name])
    by_name = {slave.name: slave for slave in slaves}
    if prepare is not None:
        prepare(by_name)
    connections = unplugged(definition, by_name)
    return System(slaves, connections, loop_iterations=loop_iterations)


def sizes_first(start: Mapping[str, Any]) -> list[str]:
    """Return the names of start values, those of arrays and elements last: their sizes may be among the others."""
    return sorted(start, key=lambda name: "[" in name or isinstance(start[name], (list, tuple)))


def set_start(slave: Slave, name: str, value: Any) -> None:
    """Give a slave a start value: a number, a text that says a value, or a sequence for an array.

    Raises
    ------
    MisfitError
        If there is no such variable, or it does not hold the value.
    """
    if isinstance(value, Mapping):
        raise MisfitError(f"{slave.name}.{name} is given a table: quote names with points, or give a value.")
    if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
        slave.set(name, slave.parse(name, value) if isinstance(value, str) else value)
        return
    elements = [own for own in slave.variable_names if own.startswith(f"{name}[")]
    if not elements:
        if name not in slave.variable_names:
            raise slave.unknown(name)
        raise MisfitError(f"{slave.name}.{name} is no array, but is given a list of {len(value)}: give one value.")
    if len(elements) != len(value):
        raise MisfitError(
            f"{slave.name}.{name} has {len(elements)} elements, {elements[0]} to {elements[-1]}, but is given a list "
            f"of {len(value)}: give one for each, row by row."
        )
    for element, part in zip(elements, value, strict=True):
        set_start(slave, element, part)


def _exchanges(component: Component) -> bool:
    """Return whether an FMU is used by Model Exchange: as is wished, else where it has no Co-Simulation."""
    if component.interface is not None:
        return component.interface == "me"
    try:
        description = read_description(component.source, validate=False)
    except UNREADABLE:  # the slave says what is wrong
        return False
    return description.coSimulation is None and description.modelExchange is not None


def _slave(component: Component, validate: bool, patience: float | None) -> Slave:
    if component.kind == FMU:
        kind = ExchangeSlave if _exchanges(component) else FmuSlave
        if patience is not None:
            return IsolatedSlave(component.name, component.source, validate=validate, kind=kind.kind, patience=patience)
        return kind(component.name, component.source, validate=validate)
    with imports_from(component.source):
        automaton = find_automaton(component.source, component.arguments)
    return AutomatonSlave(component.name, automaton)

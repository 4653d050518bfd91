"""Systems written for other tools: FMUs in the place of automata, with the values that the system gives them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.automaton_slave import AutomatonSlave
from cosim.cli.progress import Work
from cosim.system import System
from cosim.systems.definition import AUTOMATON, FMU, Component, SystemDefinition
from fmu.export import export_fmu
from hybrid_model.declare.wrapper import with_starts


def with_fmus(definition: SystemDefinition, system: System, folder: Path, fmi: str) -> SystemDefinition:
    """Return a system with an FMU for each component that is an automaton.

    Its start values and parameters are the FMU's own, in the description and in the binary, for most tools that run
    systems leave out what the system says of them. Components with one set of values share one FMU.

    Parameters
    ----------
    definition : SystemDefinition
    system : System
        Made of it.
    folder : Path
        Where the FMUs are written.
    fmi : str
        Version of the standard.

    Raises
    ------
    ExportError, BuildError
        If an automaton cannot be exported.
    DeclarationError
        If a start value is given that the automaton computes.
    """
    made: list[tuple[Any, Path]] = []
    components = []
    automata = [c for c in definition.components if c.kind == AUTOMATON]
    with Work(len(automata)) as work:
        for component in definition.components:
            slave = system.slaves[component.name]
            if not isinstance(slave, AutomatonSlave):
                components.append(component)
                continue
            work.begin(f"exporting {component.name}")
            key = component.source, component.arguments, slave.starts
            path = next((path for known, path in made if known == key), None)
            if path is None:
                automaton = with_starts(slave.automaton, slave.starts) if slave.starts else slave.automaton
                path = export_fmu(automaton, folder / f"{len(made)}.fmu", fmi=fmi)
                made.append((key, path))
            components.append(Component(component.name, FMU, str(path), component.start))
    return replace(definition, components=components)

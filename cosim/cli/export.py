"""`hybrid-fmu export`: write FMUs."""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any

from cosim.cli.exits import Exit, UsageError, progress, start_values
from fmu.export import Fmi, export_fmu
from hybrid_model import Automaton
from hybrid_model.consensus.network import scenario_agents
from hybrid_model.consensus.scenario import load_scenario


def add_parser(commands: Any) -> None:
    """Add the command to the command line."""
    parser = commands.add_parser("export", help="export an automaton or a scenario's agents", allow_abbrev=False)
    parser.add_argument("target", metavar="TARGET", help="module:ClassName, name of a preset, or path of a TOML file")
    parser.add_argument("--fmi", choices=[version.value for version in Fmi], default=Fmi.V3_0.value)
    parser.add_argument("--kind", choices=("cs",), action="append", help="kind of FMU: cs, co-simulation")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the FMUs")
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start value, parameter or length of a class's instance; repeatable",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    stop_time, automata = _automata(options.target, start_values(options.start_value))
    options.out.mkdir(parents=True, exist_ok=True)
    for name, automaton in automata.items():
        progress(f"exporting {name}")
        print(export_fmu(automaton, options.out / f"{name}.fmu", fmi=options.fmi, stop_time=stop_time))
    return Exit.DONE


def _automata(target: str, starts: dict[str, float]) -> tuple[float | None, dict[str, Automaton]]:
    module, colon, name = target.partition(":")
    if not colon:
        if starts:
            raise UsageError("--start-value goes with module:ClassName; a scenario has its values in its file.")
        scenario = load_scenario(target)
        return scenario.stop_time, dict(scenario_agents(scenario))
    try:
        found = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise UsageError(f"{target} cannot be found: {error}. Give module:ClassName.") from error
    if not (isinstance(found, type) and issubclass(found, Automaton)):
        raise UsageError(f"{target} is not an automaton class: derive it from hybrid_model.HybridAutomaton.")
    automaton = found(**starts)
    return None, {automaton.name: automaton}

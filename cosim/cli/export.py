"""`hybrid-fmu export`: write FMUs."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path

from cosim.cli.exits import Exit, progress, start_values
from cosim.errors import UsageError
from cosim.systems.automaton_files import find_automaton
from fmu.archives.checks import no_device
from fmu.archives.writing import check_target
from fmu.build.platforms import PLATFORMS
from fmu.describe.variables import Fmi
from fmu.export import export_fmu
from hybrid_model import Automaton
from hybrid_model.named_objects import imports_from, is_target

KINDS = ("cs", "me")
ALL = "all"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = "Write an automaton, or each agent of a scenario, as a native FMU. Prints the files written."
    parser.add_argument(
        "target",
        metavar="TARGET",
        help="module:ClassName or file.py:ClassName, name of a preset, or path of a TOML file",
    )
    parser.add_argument(
        "--fmi", choices=[version.value for version in Fmi], default=Fmi.V3_0.value, help="version of the standard"
    )
    parser.add_argument(
        "--kind",
        choices=KINDS,
        action="append",
        help="cs: co-simulation, me: model exchange; repeatable; default: both",
    )
    parser.add_argument(
        "--platform",
        choices=[*PLATFORMS, ALL],
        action="append",
        help="where the FMU shall run; repeatable; others than this machine's, the default, need the package ziglang",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the FMUs")
    parser.add_argument(
        "--stop-time", type=_seconds, help="stop time in s that the FMU proposes; default: a scenario's"
    )
    parser.add_argument("--step-size", type=_seconds, help="communication step in s that the FMU proposes")
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start value, parameter or length of a class's instance; repeatable",
    )
    parser.add_argument("--no-clocks", action="store_true", help="no clocks, for importers that know none (FMI 3.0)")
    parser.set_defaults(run=run)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number of seconds above zero")
    return value


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with imports_from(options.target):
        stop_time, automata = _automata(options.target, start_values(options.start_value))
        files = {name: options.out / f"{_file_name(name)}.fmu" for name in automata}
        for file in files.values():
            check_target(file)
        for count, (name, automaton) in enumerate(automata.items(), 1):
            progress(f"exporting {name} ({count} of {len(automata)})")
            written = export_fmu(
                automaton,
                files[name],
                fmi=options.fmi,
                kinds=tuple(kind for kind in KINDS if kind in (options.kind or KINDS)),
                platforms=_platforms(options.platform),
                stop_time=stop_time if options.stop_time is None else options.stop_time,
                step_size=options.step_size,
                clocks=not options.no_clocks,
                progress=progress,
            )
            print(written)
    return Exit.DONE


def _platforms(names: list[str] | None) -> tuple[str, ...] | None:
    if names is None:
        return None
    return tuple(PLATFORMS) if ALL in names else tuple(name for name in PLATFORMS if name in names)


def _file_name(name: str) -> str:
    # The name of an automaton is free; that of a file must stay in the folder.
    return no_device(re.sub(r"[^\w.+-]", "_", name).lstrip(".") or "_")


def _automata(target: str, starts: dict[str, float]) -> tuple[float | None, dict[str, Automaton]]:
    if not is_target(target):
        if starts:
            raise UsageError("--start-value goes with module:ClassName; a scenario has its values in its file.")
        # Of what a class of one's own does not need.
        from hybrid_model.consensus.laws.closed_loop import scenario_agents
        from hybrid_model.consensus.scenario.files import load_scenario

        scenario = load_scenario(target)
        return scenario.stop_time, dict(scenario_agents(scenario))
    automaton = find_automaton(target, starts)
    return None, {automaton.name: automaton}

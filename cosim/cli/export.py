"""`hybrid-fmu export`: write FMUs."""

from __future__ import annotations

import argparse
import json
import re

from cosim.cli.exits import Exit, start_values
from cosim.cli.options.export import ALL, KINDS
from cosim.cli.progress import Work
from cosim.errors import UsageError
from cosim.systems.automaton_files import find_automaton
from fmu.archives.checks import no_device
from fmu.archives.writing import check_target
from fmu.build.platforms import PLATFORMS
from fmu.export import export_fmu
from hybrid_model import Automaton
from hybrid_model.named_objects import imports_from, is_target


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with imports_from(options.target):
        stop_time, automata = _automata(options.target, start_values(options.start_value))
        files = {name: options.out / f"{_file_name(name)}.fmu" for name in automata}
        for file in files.values():
            check_target(file)
        written = []
        with Work(len(automata)) as work:
            for name, automaton in automata.items():
                work.begin(f"exporting {name}")
                file = export_fmu(
                    automaton,
                    files[name],
                    fmi=options.fmi,
                    kinds=tuple(kind for kind in KINDS if kind in (options.kind or KINDS)),
                    platforms=_platforms(options.platform),
                    stop_time=stop_time if options.stop_time is None else options.stop_time,
                    step_size=options.step_size,
                    clocks=not options.no_clocks,
                    progress=work.say,
                )
                written.append(str(file))
    print(json.dumps({"fmi": options.fmi, "fmus": written}, indent=2) if options.json else "\n".join(written))
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

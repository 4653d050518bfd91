"""`hybrid-fmu completion`: scripts for shells, which shtab makes of the parser."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import shtab

from cosim.cli.exits import Exit
from cosim.cli.main import COMMANDS, parser_of
from hybrid_model.consensus.scenario.sources import preset_names

_BASH = """
_hybrid_fmu_scenarios() {{
  compgen -f -- "$1"
  compgen -W "{presets}" -- "$1"
}}
"""


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    parser = parser_of(tuple(COMMANDS))
    for command in _commands(parser):
        for action in command._actions:
            files = _completed(action)
            if files is not None:
                action.complete = files  # type: ignore[attr-defined]
    preamble = _BASH.format(presets=" ".join(preset_names())) if options.shell == "bash" else ""
    print(shtab.complete(parser, shell=options.shell, preamble=preamble))
    return Exit.DONE


def _commands(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    groups = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return [command for group in groups for command in group.choices.values()]


def _completed(action: argparse.Action) -> Mapping[str, Any] | None:
    if action.metavar == "DIR":
        return shtab.DIRECTORY
    if action.metavar in ("SCENARIO", "SYSTEM", "TARGET"):
        return {**shtab.FILE, "bash": "_hybrid_fmu_scenarios"}
    return shtab.FILE if action.type is Path else None

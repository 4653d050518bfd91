"""Options of `hybrid-fmu simulate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.cli.options.values import add_folder, add_json, add_scenario, require_scenario, require_table, seconds
from cosim.errors import UsageError

EXAMPLES = (
    "hybrid-fmu simulate paper-a",
    "hybrid-fmu simulate paper-a --stop-time 10 --out run",
    "hybrid-fmu simulate paper-a --output-file run.mat",
    "hybrid-fmu simulate paper-a --animation run.gif",
    "hybrid-fmu simulate ring.toml --engine network --events events",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--engine",
        choices=("auto", "automaton", "network"),
        default="auto",
        help="automaton: the closed loop as one automaton; network: agent by agent, event by event (default: "
        "%(default)s, by the number of agents)",
    )
    parser.add_argument("--stop-time", type=seconds, metavar="S", help="end of the run in s (default: the scenario's)")
    parser.add_argument(
        "--output-interval",
        type=seconds,
        metavar="S",
        default=0.1,
        help="spacing of the trajectory in s (default: %(default)s)",
    )
    add_json(parser, "the run")
    parser.add_argument(
        "--output-file", type=Path, metavar="F", help="write the trajectory there: .csv, .npz, .mat or .nc by the name"
    )
    parser.add_argument(
        "--animation", type=Path, metavar="F", help="write the run as a film there: .gif, or .mp4 where there is ffmpeg"
    )
    add_folder(parser, "--out", "write run.json and trajectory.csv there")
    add_folder(
        parser,
        "--events",
        "write the events of a network there as they come (hybrid_model.load_network_events reads them)",
    )


def require_named(options: argparse.Namespace) -> None:
    """Refuse what is no scenario, and files of other kinds than are written."""
    require_scenario(options)
    require_table(options.output_file)
    if options.animation is not None and options.animation.suffix.lower() not in (".gif", ".mp4"):
        raise UsageError(f"{options.animation}: films are .gif or .mp4 files; give one of these endings.")

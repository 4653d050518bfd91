"""Options of `hybrid-fmu paper`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.cli.options.values import add_folder, add_formats, add_json, require_folder

EXAMPLES = ("hybrid-fmu paper", "hybrid-fmu paper --out results")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_folder(parser, "--out", "folder for all results (default: %(default)s)", Path("results"))
    add_json(parser, "what is in summary.json")
    add_formats(parser)


def require_named(options: argparse.Namespace) -> None:
    """Refuse a folder that cannot be one."""
    require_folder(options.out)

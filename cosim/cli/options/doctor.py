"""Options of `hybrid-fmu doctor`."""

from __future__ import annotations

import argparse

from cosim.cli.options.values import add_json

DESCRIPTION = (
    "Tell what this machine has: Python, compilers, the cache, extras, platforms, and whether a model runs natively.\n"
    "Exit status 1 if there is no compiler or the model does not run natively."
)
EXAMPLES = ("hybrid-fmu doctor", "hybrid-fmu doctor --json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_json(parser, "what there is")

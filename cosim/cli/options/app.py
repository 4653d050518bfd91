"""Options of `hybrid-fmu app`."""

from __future__ import annotations

import argparse

from cosim.cli.options.values import whole

DESCRIPTION = "Serve an interactive page on this machine until Ctrl-C; needs the extra 'app'."
EXAMPLES = ("hybrid-fmu app", "hybrid-fmu app --port 8080 --no-browser")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "--port",
        type=whole(1),
        metavar="N",
        default=2718,
        help="where it listens, on this machine alone (default: %(default)s)",
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser")

"""Options of `hybrid-fmu certify`."""

from __future__ import annotations

import argparse

from cosim.cli.options.values import (
    add_folder,
    add_formats,
    add_json,
    add_most_jumps,
    add_scenario,
    positive,
    require_scenario,
)

EXAMPLES = ("hybrid-fmu certify paper-a", "hybrid-fmu certify ring.toml --json --details --out certificates")
PATIENCE = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    add_json(parser, "the certificates")
    parser.add_argument(
        "--details",
        action="store_true",
        help="with --json: add unit, source and hypotheses of each value, and all hypotheses checked",
    )
    add_most_jumps(parser, "the run beside the bounds")
    parser.add_argument(
        "--patience",
        metavar="S",
        type=positive,
        default=PATIENCE,
        help="CPU time in s that each quantity may take which does not scale, in networks of 16 agents or more; what "
        "would take longer is left out (default: %(default)s)",
    )
    add_folder(parser, "--out", "write certificates.json, and figures of the run with its bounds, there")
    add_formats(parser)


require_named = require_scenario

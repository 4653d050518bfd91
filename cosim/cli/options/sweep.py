"""Options of `hybrid-fmu sweep`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.cli.options.values import add_json, add_most_jumps, require_file, require_scenario, whole

EXAMPLES = (
    "hybrid-fmu sweep paper-a --vary trigger.threshold=0.1:1:10:log --csv thresholds.csv",
    "hybrid-fmu sweep paper-a --vary trigger.threshold=0.1:1:10 --vary network.gain=0.5,1,2 --figures maps",
    "hybrid-fmu sweep paper-a.sqlite",
)
DESIGNS = ("grid", "random", "latin-hypercube")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="name of a preset, path of a TOML file, or the .sqlite file of a sweep to go on with",
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="a key of the scenario and its values: low:high:count, low:high:count:log, a,b,c, a list in TOML, or "
        "seeds; repeatable",
    )
    parser.add_argument(
        "--design",
        choices=DESIGNS,
        default=DESIGNS[0],
        help="which points are run (default: %(default)s)",
    )
    parser.add_argument("--runs", type=whole(1), metavar="N", help="number of points that are drawn")
    parser.add_argument(
        "--repeats",
        type=whole(1),
        default=1,
        metavar="N",
        help="runs of each point, with other seeds (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=whole(0), metavar="N", default=0, help="of draws and of seeds (default: %(default)s)"
    )
    parser.add_argument(
        "--bounds",
        default="",
        metavar="NAMES",
        help="columns with certified values, separated by commas, such as radius.energy: see docs/sweeps.md",
    )
    add_most_jumps(parser, "a run")
    parser.add_argument(
        "--table",
        "--out",
        type=Path,
        metavar="F.sqlite",
        help="file of the rows; a sweep that ended early is gone on with (default: the scenario's name)",
    )
    parser.add_argument("--workers", type=whole(1), metavar="N", help="processes (default: one a processor)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler, whose workers run instead")
    parser.add_argument("--csv", type=Path, metavar="F.csv", help="write the rows there at the end")
    parser.add_argument("--parquet", type=Path, metavar="F.parquet", help="write the rows there at the end")
    parser.add_argument(
        "--figures",
        type=Path,
        metavar="DIR",
        help="write maps over the first two keys there, and broadcasts against radii of a sweep over thresholds",
    )
    add_json(parser, "the table's file and the numbers of runs")


def require_named(options: argparse.Namespace) -> None:
    """Refuse what is neither a scenario nor the table of a sweep."""
    if Path(options.scenario).suffix == ".sqlite":
        require_file(Path(options.scenario), "a sweep's table, or of a scenario")
    else:
        require_scenario(options)

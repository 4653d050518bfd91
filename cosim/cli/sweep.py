"""`hybrid-fmu sweep`: many runs of a scenario with other values under its keys, as a table in a file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cosim.cli.eta import Eta
from cosim.cli.exits import Exit
from cosim.errors import UsageError
from hybrid_model.consensus.figures.study import save_study_figures
from hybrid_model.consensus.sweeps.designs import Design
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.execute import run_sweep
from hybrid_model.consensus.sweeps.export import write_csv, write_parquet
from hybrid_model.consensus.sweeps.study import BOUND_NAMES, Study, study
from hybrid_model.consensus.sweeps.table import SweepTable


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
        choices=[design.value for design in Design],
        default=Design.GRID.value,
        help="which points are run (default %(default)s)",
    )
    parser.add_argument("--runs", type=int, metavar="N", help="number of points that are drawn")
    parser.add_argument("--repeats", type=int, default=1, metavar="N", help="runs of each point, with other seeds")
    parser.add_argument("--seed", type=int, default=0, help="of draws and of seeds (default %(default)s)")
    parser.add_argument(
        "--bounds",
        default="",
        metavar="NAMES",
        help=f"columns with certified values, separated by commas, out of {', '.join(BOUND_NAMES)}",
    )
    parser.add_argument(
        "--max-jumps",
        metavar="N",
        type=int,
        default=20_000,
        help="jumps (broadcasts and breakpoints) after which a run ends (default %(default)s)",
    )
    parser.add_argument(
        "--table",
        type=Path,
        metavar="F.sqlite",
        help="file of the rows; a sweep that ended early is gone on with (default: the scenario's name)",
    )
    parser.add_argument("--workers", type=int, metavar="N", help="processes (default: one a processor)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler, whose workers run instead")
    parser.add_argument("--csv", type=Path, metavar="F.csv", help="write the rows there at the end")
    parser.add_argument("--parquet", type=Path, metavar="F.parquet", help="write the rows there at the end")
    parser.add_argument(
        "--figures",
        type=Path,
        metavar="DIR",
        help="write maps over the first two keys there, and broadcasts against radii of a sweep over thresholds",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    try:
        wanted, path = _study(options)
        eta = Eta("runs")
        with run_sweep(wanted, path, workers=options.workers, scheduler=options.scheduler, progress=eta) as table:
            if options.csv:
                write_csv(table, options.csv)
            if options.parquet:
                write_parquet(table, options.parquet)
            if options.figures and not save_study_figures(table, options.figures):
                print(
                    "hybrid-fmu: there is nothing to draw of this sweep: vary two keys with numbers.", file=sys.stderr
                )
            failures, count = table.failures, len(table)
    except SweepError as error:
        raise UsageError(str(error)) from error
    print(f"{path}: {count} runs, {failures} failed" if failures else f"{path}: {count} runs")
    return Exit.DONE


def _study(options: argparse.Namespace) -> tuple[Study, Path]:
    """The sweep, and the file of its table."""
    if Path(options.scenario).suffix == ".sqlite":
        if options.vary or options.table:
            raise UsageError(
                f"{options.scenario} says itself what varies, and is the table: leave --vary and --table out."
            )
        path = Path(options.scenario)
        with SweepTable(path) as table:
            return table.study, path
    bounds = [name.strip() for name in options.bounds.split(",") if name.strip()]
    wanted = study(
        options.scenario,
        options.vary,
        design=options.design,
        runs=options.runs,
        repeats=options.repeats,
        seed=options.seed,
        bounds=bounds,
        max_jumps=options.max_jumps,
    )
    return wanted, options.table or Path(f"{Path(options.scenario).stem}.sqlite")

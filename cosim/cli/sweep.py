"""`hybrid-fmu sweep`: many runs of a scenario with other values under its keys, as a table in a file."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from cosim.cli.exits import Exit
from cosim.cli.progress import Work
from cosim.errors import UsageError
from hybrid_model.consensus.figures.study import save_study_figures
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.execute import run_sweep
from hybrid_model.consensus.sweeps.export import write_csv, write_parquet
from hybrid_model.consensus.sweeps.study import Study, study
from hybrid_model.consensus.sweeps.table import SweepTable


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    try:
        wanted, path = _study(options)
        with (
            Work() as work,
            run_sweep(wanted, path, workers=options.workers, scheduler=options.scheduler, progress=work) as table,
        ):
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
    told = f"{path}: {count} runs, {failures} failed" if failures else f"{path}: {count} runs"
    print(json.dumps({"table": str(path), "runs": count, "failed": failures}, indent=2) if options.json else told)
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

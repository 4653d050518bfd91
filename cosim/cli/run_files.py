"""What `hybrid-fmu cosim` writes beside its text: rows as they come, progress, the log of events, a picture."""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.cli.exits import Exit
from cosim.result import CosimResult
from cosim.system import System
from cosim.tables.comparison import deviations
from cosim.tables.picture import draw
from cosim.tables.row_file import Columns, RowFile

QUIET, EVERY = 2.0, 0.5
"""Seconds of a run before its progress is told, and between two lines of it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "--output-file",
        type=Path,
        metavar="F.csv",
        help="write all outputs over time, with both rows of a jump; rows are there as soon as they are known",
    )
    parser.add_argument("--event-log", type=Path, metavar="F.csv", help="write the events: time, component, clocks")
    parser.add_argument(
        "--reference-file", type=Path, metavar="REF.csv", help="compare with a table; status 1 if they differ"
    )
    parser.add_argument(
        "--reference-tolerance",
        type=float,
        default=1e-3,
        metavar="PART",
        help="of the largest value of each variable, for --reference-file; default: 1e-3",
    )
    parser.add_argument("--plot", type=Path, metavar="F.png", help="draw the outputs")
    parser.add_argument("--show-plot", action="store_true", help="draw them in a window")


class RunFiles:
    """The files of one run.

    Parameters
    ----------
    options : argparse.Namespace
    system : System
    t_stop : float
        Time in s that the run is to reach.
    """

    def __init__(self, options: argparse.Namespace, system: System, t_stop: float) -> None:
        self._options, self._arrays, self._t_stop = options, system.arrays, t_stop
        single = next(iter(system.slaves)) if len(system.slaves) == 1 else None
        # One FMU by itself has the columns that fmpy and fmusim write.
        self._short = {name: name.removeprefix(f"{single}.") for name in [*system.output_names, *self._arrays.values()]}
        if single is None:
            self._short = {name: name for name in self._short}
        self._title = single or "co-simulation"
        columns = Columns(system.output_names, self._arrays, self._short)
        self._rows = RowFile(options.output_file, columns) if options.output_file else None
        self._began = self._told = time.monotonic()
        self.result: CosimResult | None = None

    def watch(self, result: CosimResult) -> None:
        """Take the last row of a run."""
        self.result = result
        if self._rows is not None:
            self._rows.take(result)
        now = time.monotonic()
        if now - self._began > QUIET and now - self._told > EVERY:
            self._told = now
            self._tell(result, now - self._began)

    def close(self) -> None:
        """Write what is left of the rows; further files are for runs that came to an end."""
        if self._rows is not None:
            self._rows.close()
        if self._told > self._began and sys.stderr.isatty():
            print(file=sys.stderr)

    def finish(self, result: CosimResult) -> int:
        """Write the other files, and compare; return the exit status that this gives."""
        signals = self._named(result.signals)
        if self._options.event_log:
            _write_events(self._options.event_log, result)
        if self._options.plot or self._options.show_plot:
            draw(result.times, signals, self._title, self._options.plot, show=self._options.show_plot)
        if self._options.reference_file is None:
            return int(Exit.DONE)
        return self._compare(result.times, signals)

    def _named(self, signals: Mapping[str, Sequence[Any]]) -> dict[str, Sequence[Any]]:
        return {self._short[name]: values for name, values in signals.items()}

    def _compare(self, times: Sequence[float], signals: Mapping[str, Sequence[Any]]) -> int:
        tolerance, worst = self._options.reference_tolerance, Exit.DONE
        compared, missing = deviations(self._options.reference_file, times, signals)
        if missing:
            print(f"  not compared, as the run has none of that form: {', '.join(missing)}")
        for found in compared:
            beyond = not found.largest <= tolerance
            worst = Exit.FAILED if beyond else worst
            line = f"{found.name} differs from {self._options.reference_file.name} by {found.largest:.3g} of its size"
            print(f"  {line}, at {found.t:.9g} s{f': beyond {tolerance:g}' if beyond else ''}")
        return int(worst)

    def _tell(self, result: CosimResult, seconds: float) -> None:
        start, now = result.times[0], result.times[-1]
        if sys.stderr.isatty() and now > start:
            left = seconds * (self._t_stop - now) / (now - start)
            text = f"  t = {now:.6g} of {self._t_stop:.6g} s, {len(result.events)} events, {left:.0f} s left   "
            print(f"\r{text}", end="", file=sys.stderr, flush=True)


def _write_events(path: Path, result: CosimResult) -> None:
    ticks: dict[tuple[float, str], list[str]] = {}
    for tick in result.ticks:
        ticks.setdefault((tick.t, tick.slave), []).append(tick.clock)
    places = sorted({(event.t, event.block) for event in result.events} | set(ticks))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "component", "clocks"])
        writer.writerows([t, slave, " ".join(ticks.get((t, slave), []))] for t, slave in places)

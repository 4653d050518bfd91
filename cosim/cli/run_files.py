"""What `hybrid-fmu cosim` writes beside its text: rows as they come, progress, the log of events, a picture."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.cli.exits import Exit
from cosim.cli.progress import Work
from cosim.result import CosimResult, Ended
from cosim.system import System
from cosim.tables.comparison import deviations
from cosim.tables.picture import draw
from cosim.tables.row_file import Columns, RowFile
from fmu.archives.writing import replacing
from hybrid_model.record.column_files import write_columns
from hybrid_model.schedule.scheduler import RECEIVED


class RunFiles:
    """The files of one run.

    Parameters
    ----------
    options : argparse.Namespace
    system : System
    t_stop : float
        Time in s that the run is to reach.

    Raises
    ------
    DataError
        Before the run, if a picture is to be PGF and there is no TeX.
    """

    def __init__(self, options: argparse.Namespace, system: System, t_stop: float) -> None:
        if options.plot is not None and options.plot.suffix.lower() == ".pgf":
            from hybrid_model.plots.tex import tex_system

            tex_system()
        self._options, self._arrays, self._t_stop = options, system.arrays, t_stop
        single = next(iter(system.slaves)) if len(system.slaves) == 1 else None
        # One FMU by itself has the columns that fmpy and fmusim write.
        self._short = {name: name.removeprefix(f"{single}.") for name in [*system.output_names, *self._arrays.values()]}
        if single is None:
            self._short = {name: name for name in self._short}
        self._title = single or "co-simulation"
        columns = Columns(system.output_names, self._arrays, self._short)
        # Rows of text are there as they come; other tables are written at the end.
        csv = options.output_file is not None and options.output_file.suffix.lower() == ".csv"
        self._rows = RowFile(options.output_file, columns) if csv else None
        self._work = Work().__enter__()
        self._work.begin(self._title)
        self.result: CosimResult | None = None

    def watch(self, result: CosimResult) -> None:
        """Take the last row of a run."""
        self.result = result
        if self._rows is not None:
            self._rows.take(result)
        start, now = result.times[0], result.times[-1]
        if self._t_stop > start:
            told = f"t = {now:.6g} of {self._t_stop:.6g} s, {len(result.events)} events"
            self._work.part((now - start) / (self._t_stop - start), told)

    def close(self) -> None:
        """Write what is left of the rows, and the events so far; further files are for runs that came to an end."""
        if self._rows is not None:
            self._rows.close()
        if self._options.event_log and self.result is not None:
            _write_events(self._options.event_log, self.result)
        self._work.__exit__(None, None, None)

    def finish(self, result: CosimResult) -> tuple[int, list[str]]:
        """Write the other files, and compare; return the exit status that this gives, and what was compared."""
        signals = self._named(result.signals)
        if self._options.output_file and self._rows is None:
            _write_table(self._options.output_file, result.times, signals)
        if self._options.plot or self._options.show_plot:
            draw(result.times, signals, self._title, self._options.plot, show=self._options.show_plot)
        if self._options.reference_file is None:
            return int(Exit.DONE), []
        return self._compare(result, signals)

    def _named(self, signals: Mapping[str, Sequence[Any]]) -> dict[str, Sequence[Any]]:
        return {self._short[name]: values for name, values in signals.items()}

    def _compare(self, result: CosimResult, signals: Mapping[str, Sequence[Any]]) -> tuple[int, list[str]]:
        file, tolerance, lines = self._options.reference_file, self._options.reference_tolerance, []
        compared = deviations(file, result.times, signals)
        if compared.missing:
            lines.append(f"  not compared, as the run has none of that form: {', '.join(compared.missing)}")
        for found in compared.found:
            beyond = f": beyond {tolerance:g}" if not found.largest <= tolerance else ""
            line = (
                f"{found.name} differs from {file.name} by {found.largest:.3g} of its size, at {found.t:.9g} s{beyond}"
            )
            lines.append(f"  {found.name} is as in {file.name}" if found.largest == 0.0 else f"  {line}")
        # A run that was to be shorter is as good as its part of the table; one that broke off is not.
        broke_off = result.ended is not Ended.HORIZON and compared.goes_on
        if told := compared.told():
            lines.append(f"  {file.name}: {told}{', since it ended before its time' if broke_off else ''}")
            print(f"hybrid-fmu: {file}: {told}.", file=sys.stderr)
        failed = broke_off or any(not found.largest <= tolerance for found in compared.found)
        return int(Exit.FAILED if failed else Exit.DONE), lines


def _write_table(path: Path, times: Sequence[float], signals: Mapping[str, Sequence[Any]]) -> None:
    numbers = {name: np.array(values) for name, values in signals.items()}
    others = [name for name, column in numbers.items() if column.dtype.kind not in "biuf"]
    numbers = {name: column for name, column in numbers.items() if name not in others}
    if others:
        print(
            f"hybrid-fmu: {path} holds numbers alone, and is without {', '.join(others)}: .csv has all.",
            file=sys.stderr,
        )
    write_columns(path, {"time": np.array(times), **numbers}, {"time": "s"})


def _write_events(path: Path, result: CosimResult) -> None:
    ticks: dict[tuple[float, str], list[str]] = {}
    for tick in result.ticks:
        ticks.setdefault((tick.t, tick.slave), []).append(tick.clock)
    kinds = {(event.t, event.block): event.kind for event in result.events}
    with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "component", "clocks", "kind"])
        writer.writerows(
            [*place, " ".join(ticks.get(place, [])), kinds.get(place, RECEIVED)] for place in sorted({*kinds, *ticks})
        )

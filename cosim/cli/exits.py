"""Exit codes, and what all commands share."""

from __future__ import annotations

import csv
import enum
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path


class UsageError(ValueError):
    """A command was given something that it does not know."""


class Exit(enum.IntEnum):
    """Exit statuses of the command line."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    ZENO = 3


def exit_of(stop: str) -> Exit:
    """Return the exit status for the name of the way a run ended (`hybrid_model.Stop`, `cosim.result.Ended`)."""
    return {"HORIZON": Exit.DONE, "FINISHED": Exit.DONE, "ZENO": Exit.ZENO}.get(stop, Exit.FAILED)


def progress(text: str) -> None:
    """Say what is being done, on stderr and only to a person at a terminal."""
    if sys.stderr.isatty():
        print(f"  {text} ...", file=sys.stderr, flush=True)


def start_values(given: Sequence[str]) -> dict[str, float]:
    """Read ``NAME=VALUE`` options.

    Raises
    ------
    UsageError
        If one is not of that form.
    """
    values = {}
    for item in given:
        name, equals, value = item.partition("=")
        try:
            values[name] = float(value)
        except ValueError:
            equals = ""
        if not equals or not name:
            raise UsageError(f"--start-value {item!r} is not NAME=VALUE with a number for VALUE.")
    return values


def write_csv(path: Path, times: Sequence[float], signals: Mapping[str, Sequence[float]]) -> None:
    """Write signals over time as comma-separated values, the time first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *signals])
        writer.writerows(zip(times, *signals.values(), strict=True))

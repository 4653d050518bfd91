"""Exit codes, which of them an error is, and what all commands share."""

from __future__ import annotations

import csv
import enum
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.errors import CosimError, GivenValueError, UsageError


class Exit(enum.IntEnum):
    """Exit statuses of the command line."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    ZENO = 3
    INTERRUPTED = 130


def exit_of(stop: str) -> Exit:
    """Return the exit status for the name of the way a run ended (`hybrid_model.Stop`, `cosim.result.Ended`)."""
    return {"HORIZON": Exit.DONE, "FINISHED": Exit.DONE, "ZENO": Exit.ZENO}.get(stop, Exit.FAILED)


def status_of(error: Exception) -> Exit | None:
    """Return the exit status of an error, or None if it is a fault of this program.

    Wrong usage is what was typed, and what a scenario, a system or a table says that was named there: names that there
    are not, values out of range. Failed is what could be begun and did not work: a model, an FMU, a file, a run.
    """
    if isinstance(error, (UsageError, GivenValueError)):
        return Exit.USAGE
    # Not before there is an error: these take longer to import than the command line.
    from fmu.errors import BuildError, ExportError
    from hybrid_model.consensus.messages import ScenarioError
    from hybrid_model.errors import HybridModelError, NamingError

    if isinstance(error, (ScenarioError, NamingError)):
        return Exit.USAGE
    return Exit.FAILED if isinstance(error, (HybridModelError, ExportError, BuildError, CosimError, OSError)) else None


def sentence_of(error: Exception) -> str:
    """Return what people are told of an error: its message, and of the system's errors the file and what to do."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}. Give a file or a folder that you may read or write."
    return str(error)


def start_values(given: Sequence[str]) -> dict[str, float]:
    """Read ``NAME=VALUE`` options with numbers.

    Raises
    ------
    UsageError
        If one is not of that form.
    """
    values = {}
    for name, text in given_values(given).items():
        try:
            values[name] = float(text)
        except ValueError:
            raise UsageError(f"--start-value '{name}={text}' is not NAME=VALUE with a number for VALUE.") from None
    return values


def given_values(given: Sequence[str]) -> dict[str, str]:
    """Split ``NAME=VALUE`` options, whatever the values are.

    Raises
    ------
    UsageError
        If one is not of that form.
    """
    values = {}
    for item in given:
        name, equals, text = item.partition("=")
        if not equals or not name:
            raise UsageError(f"--start-value {item!r} is not NAME=VALUE with a number for VALUE.")
        values[name] = text
    return values


def write_csv(path: Path, times: Sequence[float], signals: Mapping[str, Sequence[Any]]) -> None:
    """Write signals over time as comma-separated values, the time first; Booleans as 0 and 1, bytes in base 16."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *signals])
        writer.writerows([_cell(value) for value in row] for row in zip(times, *signals.values(), strict=True))


def _cell(value: Any) -> Any:
    return int(value) if isinstance(value, bool) else value.hex() if isinstance(value, bytes) else value

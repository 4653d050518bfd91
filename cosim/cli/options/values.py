"""Values of options, read and judged where they are typed; and what several commands take."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from cosim.errors import UsageError
from cosim.systems.toml_file import is_system

TABLES = (".csv", ".npz", ".mat", ".nc")
"""Endings of the tables that are written."""


def number(text: str) -> float:
    """A finite number."""
    value = _read(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r}: give a finite number")
    return value


def positive(text: str) -> float:
    """A finite number above zero."""
    value = _read(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}: give a positive, finite number")
    return value


def part(text: str) -> float:
    """A number between zero and one."""
    value = _read(text)
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number between 0 and 1, such as 1e-9")
    return value


def seconds(text: str) -> float:
    """A time above zero."""
    value = _read(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}: give a positive, finite number of seconds")
    return value


def whole(least: int) -> Callable[[str], int]:
    """Whole numbers from `least` on."""

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least:
            raise argparse.ArgumentTypeError(f"{text!r}: give a whole number, {least} or more")
        return value

    return read


def _read(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add the scenario."""
    parser.add_argument("scenario", metavar="SCENARIO", help="name of a preset, or path of a TOML file")


def add_json(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--json``."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as a JSON object")


def add_most_jumps(parser: argparse.ArgumentParser, of: str) -> None:
    """Add ``--max-jumps``."""
    parser.add_argument(
        "--max-jumps",
        metavar="N",
        type=whole(1),
        default=20_000,
        help=f"jumps (broadcasts and breakpoints) after which {of} ends (default: %(default)s)",
    )


def add_folder(parser: argparse.ArgumentParser, name: str, help: str, default: Path | None = None) -> None:
    """Add a folder for results."""
    parser.add_argument(name, type=Path, metavar="DIR", default=default, help=help)


def add_formats(parser: argparse.ArgumentParser) -> None:
    """Add ``--figure-format``."""
    parser.add_argument(
        "--figure-format",
        action="append",
        choices=("png", "pdf", "svg", "pgf"),
        help="of figures; repeatable; pgf where there is TeX (default: png and pdf)",
    )


def require_scenario(options: argparse.Namespace) -> None:
    """Refuse what is no scenario: an FMU, code, a table; or a name that no preset has.

    Raises
    ------
    UsageError
        With the command that takes it.
    ScenarioError
        If there is no such scenario.
    """
    require_folder(getattr(options, "out", None))
    given = options.scenario
    kind = Path(given).suffix.lower()
    if kind == ".fmu":
        raise UsageError(
            f"{given} is an FMU, and this command takes a scenario: 'hybrid-fmu cosim {given}' runs it, "
            f"'hybrid-fmu validate {given}' checks it."
        )
    if kind in (".ssp", ".ssd"):
        raise UsageError(f"{given} is a system, and this command takes a scenario: 'hybrid-fmu cosim {given}' runs it.")
    if kind in (".csv", ".npz", ".mat", ".json", ".nc"):
        raise UsageError(f"{given} is a table, and this command takes a scenario: a preset, or a .toml file.")
    if is_code(given):
        named = given if ":" in given else f"{given}:ClassName"
        raise UsageError(
            f"{given} is code, and this command takes a scenario: 'hybrid-fmu export {named} --out DIR' makes an FMU "
            "of an automaton, and hybrid_model.simulate runs one."
        )
    if kind == ".toml" and Path(given).is_file() and is_system(Path(given)):
        raise UsageError(f"{given} is a system, and this command takes a scenario: 'hybrid-fmu cosim {given}' runs it.")
    from hybrid_model.consensus.scenario.sources import preset_names, scenario_source

    # Behind the name of a preset there may be that of a trigger.
    if given.rpartition("-")[0] not in preset_names():
        scenario_source(given)


def is_code(given: str) -> bool:
    """Whether an argument names a Python file, or something in a module."""
    suffix = Path(given).suffix.lower()
    return suffix == ".py" or (":" in given and suffix != ".toml")


def require_folder(given: Path | None) -> None:
    """Refuse a folder for results that cannot be one, before the run rather than after it.

    Raises
    ------
    UsageError
        If there is a file in its place.
    """
    if given is not None and next((p for p in (given, *given.parents) if p.exists()), Path()).is_file():
        raise UsageError(f"{given} cannot be a folder for results, since there is a file: give another.")


def require_table(given: Path | None) -> None:
    """Refuse a table of a kind that is not written.

    Raises
    ------
    UsageError
        With the kinds that there are.
    """
    if given is not None and given.suffix.lower() not in TABLES:
        raise UsageError(
            f"{given} ends in {given.suffix!r}: tables are written as {', '.join(TABLES)}; give one of these endings."
        )


def require_file(given: Path, what: str) -> None:
    """Refuse a path at which there is no file.

    Raises
    ------
    UsageError
        With what to give.
    """
    if given.is_dir():
        raise UsageError(f"{given} is a folder: give the path of {what}.")
    if not given.is_file():
        raise UsageError(f"{given} is not a file: give the path of {what}.")

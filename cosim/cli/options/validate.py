"""Options of `hybrid-fmu validate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.cli.options.values import add_json, is_code, require_file, seconds, whole
from cosim.errors import UsageError

DESCRIPTION = """\
Check an FMU of FMI 2.0 or 3.0: safety of the archive, schemas, fmpy's checks, semantic rules, exported symbols, and a
short run of each interface type. The run executes the FMU's native code, in a child process with limits of time, memory
and file size; these hold off crashes and hangs, not an attacker: give --no-run for an FMU that you do not trust.
Errors are what the standard forbids or importers suffer from; warnings are weakness against misuse (steps that are not
a number, a wrong token), broken additions (sources, manifests of layered standards) and what fails on some machines;
notes are good to know. Exit status: 0 no error, 1 at least one error (with --strict: or warning), 2 wrong usage."""
EXAMPLES = ("hybrid-fmu validate Model.fmu", "hybrid-fmu validate Model.fmu --strict --json > report.json")
SECONDS, MEBIBYTES = 20.0, 2048


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("fmu", metavar="FILE.fmu", type=Path, help="the FMU")
    add_json(parser, "the report")
    parser.add_argument("--no-run", action="store_true", help="do not execute the FMU's native code")
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    parser.add_argument(
        "--timeout",
        type=seconds,
        default=SECONDS,
        metavar="S",
        help="limit of each run in seconds (default: %(default)s)",
    )
    parser.add_argument(
        "--memory",
        type=whole(64),
        default=MEBIBYTES,
        metavar="MIB",
        help="limit of memory in MiB, 64 or more (default: %(default)s)",
    )


def require_named(options: argparse.Namespace) -> None:
    """Refuse what is no FMU."""
    if is_code(str(options.fmu)) or options.fmu.suffix.lower() == ".toml":
        named = f"{options.fmu}:ClassName" if options.fmu.suffix.lower() == ".py" else options.fmu
        raise UsageError(f"{options.fmu} is no FMU: 'hybrid-fmu export {named} --out DIR' makes FMUs to be checked.")
    require_file(options.fmu, "an FMU")

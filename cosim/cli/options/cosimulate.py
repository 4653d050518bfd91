"""Options of `hybrid-fmu cosim`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.cli.options.values import (
    add_json,
    is_code,
    number,
    part,
    positive,
    require_file,
    require_folder,
    require_scenario,
    require_table,
    seconds,
    whole,
)
from cosim.errors import UsageError
from cosim.systems.definition import MASTERS
from cosim.systems.ssp_reading import VERSIONS
from cosim.systems.toml_file import INTERFACES, is_system

EXAMPLES = (
    "hybrid-fmu cosim BouncingBall.fmu --stop-time 2 --output-file ball.csv --plot ball.png",
    "hybrid-fmu cosim System.ssp --reference-file reference.csv",
    "hybrid-fmu cosim paper-a --master fixed-step --step-size 0.01",
)
ORDERS = ("jacobi", "gauss-seidel")
PATIENCE = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "system", metavar="SYSTEM", help="an .fmu, .ssp, .ssd, a system's .toml, a folder with one, or a scenario"
    )
    parser.add_argument(
        "--master",
        choices=MASTERS,
        help="(default: event-exact; error-controlled where signals change along flows; else fixed-step)",
    )
    parser.add_argument(
        "--interface",
        choices=INTERFACES,
        help="of FMUs that have both; cs: Co-Simulation, me: Model Exchange (default: cs)",
    )
    parser.add_argument(
        "--fmi",
        choices=("2.0", "3.0"),
        help="version of the FMUs that are made of a scenario, and of automata for --save-as (default: 3.0; in a "
        "folder for libcosim 2.0)",
    )
    parser.add_argument(
        "--tolerance", type=part, metavar="TOL", help="of the error-controlled master: of each step (default: 1e-9)"
    )
    parser.add_argument(
        "--order",
        choices=ORDERS,
        help=f"of the fixed-step master, see docs/cosimulation.md (default: {ORDERS[0]})",
    )
    parser.add_argument(
        "--start-time", type=number, metavar="S", help="start of the run in s (default: what an .fmu proposes, or 0)"
    )
    parser.add_argument(
        "--stop-time",
        type=number,
        metavar="S",
        help="end of the run in s (default: what an .fmu or a system proposes, a scenario's)",
    )
    parser.add_argument(
        "--step-size",
        type=seconds,
        metavar="S",
        help="communication step of the fixed-step master in s (default: what an .fmu proposes, or 0.01)",
    )
    parser.add_argument(
        "--output-interval",
        type=seconds,
        metavar="S",
        help="spacing of the output in s (default: what an .fmu proposes, or 0.1; each step with fixed steps)",
    )
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a number, true or false, the name of an enumeration's item, text, or bytes in base 16; for an array one "
        "for each element with spaces between, row by row; repeatable",
    )
    parser.add_argument(
        "--input-file", type=Path, metavar="IN.csv", help="time, and inputs that nothing drives and tunable parameters"
    )
    _add_files(parser)
    parser.add_argument(
        "--no-validate", action="store_true", help="run an .fmu even if its description does not fit the schema"
    )
    parser.add_argument(
        "--save-as",
        type=Path,
        metavar="F.ssp|DIR",
        help="do not run: write the system as an SSP (fmpy's runner takes FMI 2.0 alone: --fmi 2.0; Ecos and this "
        "command take both), or as a folder for libcosim (OspSystemStructure.xml)",
    )
    parser.add_argument(
        "--step-study",
        type=Path,
        metavar="DIR",
        help="of a scenario: how far its agents with fixed steps are from the event-exact run, a table and a figure",
    )
    parser.add_argument(
        "--ssp-version", choices=VERSIONS, default=VERSIONS[0], help="of --save-as (default: %(default)s)"
    )
    parser.add_argument(
        "--loop-iterations",
        type=whole(0),
        default=0,
        metavar="N",
        help="carry signals up to N times round loops without states, until they settle (default: %(default)s: loops "
        "are refused)",
    )
    parser.add_argument("--isolate", action="store_true", help="run each FMU in a process of its own")
    parser.add_argument(
        "--call-timeout",
        type=seconds,
        default=PATIENCE,
        metavar="S",
        help="s that one call of an isolated FMU may take (default: %(default)s)",
    )
    add_json(parser, "how the run ended, its events and its final values")


def require_named(options: argparse.Namespace) -> None:
    """Refuse what is no system."""
    given = Path(options.system)
    if is_code(options.system):
        raise UsageError(f"{given} is code: 'hybrid-fmu export {given} --out DIR' makes FMUs, which this command runs.")
    if given.suffix.lower() in (".fmu", ".ssp", ".ssd"):
        require_file(given, "an FMU or a system")
    elif not given.is_dir() and not (given.is_file() and is_system(given)):
        require_scenario(argparse.Namespace(scenario=options.system, out=options.step_study))
        start = options.start_time or 0.0
        if options.stop_time is not None and not options.stop_time > start:
            raise UsageError(
                f"--stop-time {options.stop_time:g}: the run starts at {start:g} s; give the stop after the start."
            )
    require_table(options.output_file)
    for file in (options.output_file, options.event_log, options.plot):
        require_folder(None if file is None else file.parent)
    if options.event_log is not None and options.event_log.is_dir():
        raise UsageError(f"{options.event_log} is a folder: give the path of the table of events, such as events.csv.")
    _require_target(options.save_as)
    if options.plot is not None and options.plot.suffix.lower() not in (".png", ".pdf", ".svg", ".pgf"):
        raise UsageError(f"{options.plot}: pictures are .png, .pdf, .svg or .pgf files; give one of these endings.")
    for file in (options.input_file, options.reference_file):
        if file is not None:
            require_file(file, "a table of comma-separated values")


def _require_target(given: Path | None) -> None:
    """Refuse what is neither the name of an SSP file nor of a folder."""
    if given is None or given.suffix.lower() == ".ssp":
        require_folder(None if given is None else given.parent)
    elif given.suffix.lower() in (".ssd", ".fmu", ".zip", ".xml", ".toml", ".csv"):
        raise UsageError(f"--save-as {given}: give a file that ends in .ssp, or a folder for libcosim.")
    else:
        require_folder(given)


def _add_files(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--output-file",
        type=Path,
        metavar="F",
        help="write all outputs over time, with both rows of a jump; the name says how: .csv, whose rows are there as "
        "soon as they are known, .npz, .mat or .nc",
    )
    parser.add_argument(
        "--event-log", type=Path, metavar="F.csv", help="write the events: time, component, clocks, kind"
    )
    parser.add_argument(
        "--reference-file", type=Path, metavar="REF.csv", help="compare with a table; status 1 if they differ"
    )
    parser.add_argument(
        "--reference-tolerance",
        type=positive,
        default=1e-3,
        metavar="PART",
        help="of the largest value of each variable, for --reference-file (default: %(default)s)",
    )
    parser.add_argument("--plot", type=Path, metavar="F.png", help="draw the outputs: .png, .pdf, .svg or .pgf")
    parser.add_argument("--show-plot", action="store_true", help="draw them in a window")

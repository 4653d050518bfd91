"""`hybrid-fmu cosim`: co-simulate a scenario's agents as FMUs, or run a single FMU."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

from cosim.cli.exits import UsageError, exit_of, progress, start_values, write_csv
from cosim.consensus import fmu_system
from cosim.errors import MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.result import CosimResult
from cosim.system import System
from fmu.export import export_fmu
from fmu.importer.folders import temporary_folder
from hybrid_model.consensus.network import scenario_agents
from hybrid_model.consensus.scenario import load_scenario
from hybrid_model.consensus.scenario_data import Scenario

MOST_SHOWN = 8
"""Most times of events of one slave that are printed."""


def add_parser(commands: Any) -> None:
    """Add the command to the command line."""
    parser = commands.add_parser("cosim", help="co-simulate a scenario's agents, or run one FMU", allow_abbrev=False)
    parser.add_argument("system", metavar="SYSTEM", help="name of a preset, path of a TOML file, or an .fmu")
    parser.add_argument(
        "--master",
        choices=("event-exact", "fixed-step"),
        help="default: event-exact, or fixed-step for an .fmu without event mode, such as those of FMI 2.0",
    )
    parser.add_argument("--stop-time", type=float, help="end of the run in s; an .fmu without a default needs it")
    parser.add_argument(
        "--step-size", type=float, default=0.01, help="communication step of the fixed-step master in s"
    )
    parser.add_argument("--output-interval", type=float, default=0.1, help="spacing of the output in s (event-exact)")
    parser.add_argument("--start-value", action="append", default=[], metavar="NAME=VALUE", help="repeatable")
    parser.add_argument("--output-file", type=Path, metavar="F.csv", help="write all outputs over time")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    starts = start_values(options.start_value)
    folder = temporary_folder()
    try:
        if Path(options.system).suffix == ".fmu":
            slave = FmuSlave(Path(options.system).stem, options.system)
            system, stop_time = System([slave], {}), _given(options.stop_time, slave.default_stop_time)
        else:
            scenario = load_scenario(options.system)
            system, stop_time = _agents(scenario, folder), _given(options.stop_time, scenario.stop_time)
        if stop_time is None:
            raise UsageError(f"{options.system} proposes no stop time: give --stop-time.")
        for name, value in starts.items():
            _set_start(system, name, value)
        result = _run(system, stop_time, options)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if options.output_file:
        write_csv(options.output_file, result.times, result.signals)
    print(_text(result))
    return exit_of(result.ended.name)


def _given(option: float | None, default: float | None) -> float | None:
    # Not `or`: a stop time of 0 is given, and refused with its own sentence.
    return default if option is None else option


def _agents(scenario: Scenario, folder: Path) -> System:
    fmus = {}
    for name, automaton in scenario_agents(scenario).items():
        progress(f"exporting {name}")
        fmus[name] = export_fmu(automaton, folder / f"{name}.fmu")
    return fmu_system(scenario, fmus)


def _set_start(system: System, name: str, value: float) -> None:
    owner = next((n for n in sorted(system.slaves, key=len, reverse=True) if name.startswith(n + ".")), None)
    if owner is None and len(system.slaves) == 1:
        owner, name = next(iter(system.slaves)), f"{next(iter(system.slaves))}.{name}"
    if owner is None:
        raise UsageError(f"--start-value {name} names no slave; the slaves are {', '.join(system.slaves)}.")
    try:
        system.slaves[owner].set(name[len(owner) + 1 :], value)
    except MisfitError as error:
        raise UsageError(f"--start-value: {error}") from error


def _run(system: System, stop_time: float, options: argparse.Namespace) -> CosimResult:
    has_events = all(slave.has_event_mode for slave in system.slaves.values())
    if (options.master or ("event-exact" if has_events else "fixed-step")) == "fixed-step":
        return run_fixed_step(system, stop_time, options.step_size, record=system.output_names)
    return run_event_exact(system, stop_time, output_interval=options.output_interval)


def _events(slave: str, result: CosimResult) -> str:
    times = [f"{t:.9g}" for t in result.event_times(slave)]
    shown = ", ".join(times[:MOST_SHOWN])
    more = f", ..., {times[-1]}" if len(times) > MOST_SHOWN else ""
    return f"  {slave}: {len(times)} event{'s' * (len(times) != 1)} at {shown}{more} s"


def _text(result: CosimResult) -> str:
    lines = [result.message or f"reached t = {result.t:.9g} s in {result.steps} steps"]
    clocks = sorted({(tick.slave, tick.clock) for tick in result.ticks})
    lines += [f"  {slave}.{clock}: {len(result.tick_times(slave, clock))} ticks" for slave, clock in clocks]
    told = {slave for slave, _ in clocks}
    lines += [_events(name, result) for name in sorted({event.block for event in result.events} - told)]
    lines += [f"  {name} = {value:.12g}" for name, value in result.final.items()]
    return "\n".join(lines)

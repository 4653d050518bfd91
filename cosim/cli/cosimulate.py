"""`hybrid-fmu cosim`: co-simulate a scenario's agents as FMUs, or run a single FMU."""

from __future__ import annotations

import argparse
import math
import shutil
import sys
from pathlib import Path

from cosim.cli.exits import UsageError, exit_of, given_values, progress, write_csv
from cosim.consensus import fmu_system
from cosim.errors import MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.result import CosimResult
from cosim.slave import Slave
from cosim.system import System
from fmu.export import export_fmu
from fmu.importer.temporary_folders import temporary_folder
from fmu.importer.values import shown
from hybrid_model.consensus.laws.closed_loop import scenario_agents
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import load_scenario

MOST_SHOWN = 8
"""Most times of events of one slave that are printed."""
STEP, OUTPUT_INTERVAL = 0.01, 0.1
"""In s: the communication step and the spacing of the output where nobody proposes one, if they fit into the run."""
FEWEST, MOST = 10, 100_000
"""Steps of a run where nobody proposes their length."""
EVENT_EXACT, FIXED_STEP = "event-exact", "fixed-step"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("system", metavar="SYSTEM", help="name of a preset, path of a TOML file, or an .fmu")
    parser.add_argument(
        "--master",
        choices=(EVENT_EXACT, FIXED_STEP),
        help="default: event-exact; fixed-step for an .fmu without event mode (FMI 2.0) or with steps of one length",
    )
    parser.add_argument("--start-time", type=float, help="start of the run in s; default: what an .fmu proposes, or 0")
    parser.add_argument("--stop-time", type=float, help="end of the run in s; an .fmu without a default needs it")
    parser.add_argument(
        "--step-size",
        type=float,
        help="communication step of the fixed-step master in s; default: what an .fmu proposes, or 0.01",
    )
    parser.add_argument(
        "--output-interval",
        type=float,
        help="spacing of the output in s; default: what an .fmu proposes, or 0.1 (event-exact), each step (fixed-step)",
    )
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a number, true or false, the name of an enumeration's item, text, or bytes in base 16; repeatable",
    )
    parser.add_argument(
        "--output-file",
        type=Path,
        metavar="F.csv",
        help="write all outputs over time, of event-exact runs with both rows of a jump",
    )
    parser.add_argument(
        "--no-validate", action="store_true", help="run an .fmu even if its description does not fit the schema"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    starts = given_values(options.start_value)
    folder = temporary_folder()
    try:
        if Path(options.system).suffix.lower() == ".fmu":
            slave: Slave = FmuSlave(Path(options.system).stem, options.system, validate=not options.no_validate)
            _set_starts({slave.name: slave}, starts)
            system, proposed = System([slave], {}), slave.default_stop_time
        else:
            scenario = load_scenario(options.system)
            system, proposed = _agents(scenario, folder), scenario.stop_time
            _set_starts(system.slaves, starts)
        result = _run(system, options, _given(options.stop_time, proposed))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if options.output_file:
        write_csv(options.output_file, result.times, result.signals)
    print(_text(result))
    return exit_of(result.ended.name)


def _given(option: float | None, *defaults: float | None) -> float | None:
    # Not `or`: a stop time of 0 is given, and refused with its own sentence.
    return next((value for value in (option, *defaults) if value is not None), None)


def _agents(scenario: Scenario, folder: Path) -> System:
    fmus = {}
    for name, automaton in scenario_agents(scenario).items():
        progress(f"exporting {name}")
        fmus[name] = export_fmu(automaton, folder / f"{name}.fmu")
    return fmu_system(scenario, fmus)


def _set_starts(slaves: dict[str, Slave], starts: dict[str, str]) -> None:
    for name, text in starts.items():
        slave, own = _owner(slaves, name)
        try:
            slave.set(own, slave.parse(own, text))
        except MisfitError as error:
            raise UsageError(f"--start-value: {error}") from error


def _owner(slaves: dict[str, Slave], name: str) -> tuple[Slave, str]:
    """Return the slave of a variable, which a single one need not be named for, and the variable's own name."""
    single = next(iter(slaves.values())) if len(slaves) == 1 else None
    if single is not None and name in single.variable_names:
        return single, name
    owner = next((n for n in sorted(slaves, key=len, reverse=True) if name.startswith(n + ".")), None)
    if owner is not None:
        return slaves[owner], name[len(owner) + 1 :]
    if single is not None:
        return single, name
    raise UsageError(f"--start-value {name} names no slave; the slaves are {', '.join(slaves)}.")


def _run(system: System, options: argparse.Namespace, t_stop: float | None) -> CosimResult:
    slaves = list(system.slaves.values())
    # Agents of a scenario propose nothing of their own.
    single = slaves[0] if len(slaves) == 1 else None
    t_start = _given(options.start_time, single.default_start_time if single else None, 0.0)
    if t_stop is None or t_start is None:
        raise UsageError(f"{options.system} proposes no stop time: give --stop-time.")
    proposed = single.default_step if single else None
    exact = all(slave.has_event_mode and slave.variable_step for slave in slaves)
    if (options.master or (EVENT_EXACT if exact else FIXED_STEP)) == FIXED_STEP:
        step = _given(options.step_size, proposed, _part(t_stop - t_start, STEP))
        assert step is not None
        return run_fixed_step(
            system,
            t_stop,
            step,
            t_start=t_start,
            record=system.output_names,
            output_interval=options.output_interval,
        )
    if options.step_size is not None:
        print("hybrid-fmu: --step-size is for the fixed-step master; this run is event-exact.", file=sys.stderr)
    # A step is proposed for masters that need short ones; here it is the output that it would make long.
    dense = proposed is not None and t_stop - t_start > MOST * proposed
    interval = _given(options.output_interval, None if dense else proposed, _part(t_stop - t_start, OUTPUT_INTERVAL))
    rows = bool(options.output_file)
    return run_event_exact(system, t_stop, t_start=t_start, output_interval=interval, record_events=rows)


def _part(length: float, wanted: float) -> float:
    """Return a part of a run that divides it, about as long as wanted."""
    if not (math.isfinite(length) and length > 0.0):
        return wanted  # the master says what is wrong
    return length / min(max(math.ceil(length / wanted * (1.0 - 1e-12)), FEWEST), MOST)


def _events(slave: str, result: CosimResult) -> str:
    times = [f"{t:.9g}" for t in result.event_times(slave)]
    some = ", ".join(times[:MOST_SHOWN])
    more = f", ..., {times[-1]}" if len(times) > MOST_SHOWN else ""
    return f"  {slave}: {len(times)} event{'s' * (len(times) != 1)} at {some}{more} s"


def _text(result: CosimResult) -> str:
    lines = [result.message or f"reached t = {result.t:.9g} s in {result.steps} step{'s' * (result.steps != 1)}"]
    clocks = sorted({(tick.slave, tick.clock) for tick in result.ticks})
    told = {slave for slave, _ in clocks}
    lines += [_events(name, result) for name in sorted({event.block for event in result.events} - told)]
    lines += [f"  {slave}.{clock}: {len(result.tick_times(slave, clock))} ticks" for slave, clock in clocks]
    lines += [f"  {name} = {shown(value)}" for name, value in result.final.items()]
    return "\n".join(lines)

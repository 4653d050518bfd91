"""`hybrid-fmu cosim`: co-simulate a scenario's agents as FMUs, or run a single FMU."""

from __future__ import annotations

import argparse
import math
import shutil
import sys
from pathlib import Path

from cosim.cli import run_files
from cosim.cli.exits import UsageError, exit_of, given_values, progress
from cosim.cli.run_files import RunFiles
from cosim.consensus import fmu_system
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.masters.changes import Curve, Given
from cosim.result import CosimResult
from cosim.slave import Slave
from cosim.system import System
from cosim.tables.input_table import read_inputs
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
        "--input-file", type=Path, metavar="IN.csv", help="time, and inputs that nothing drives and tunable parameters"
    )
    run_files.add_arguments(parser)
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
        return _run(system, options, _given(options.stop_time, proposed))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


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


def _run(system: System, options: argparse.Namespace, t_stop: float | None) -> int:
    t_start = _given(options.start_time, *(slave.default_start_time for slave in _single(system)), 0.0)
    if t_stop is None or t_start is None:
        raise UsageError(f"{options.system} proposes no stop time: give --stop-time.")
    inputs = read_inputs(options.input_file, system) if options.input_file else {}
    files = RunFiles(options, system, t_stop)
    try:
        result = _master(system, options, (t_start, t_stop), inputs, files)
    except (CosimError, KeyboardInterrupt):
        if files.result is not None and options.output_file:
            print(
                f"  {options.output_file} has what there was up to t = {files.result.times[-1]:.9g} s", file=sys.stderr
            )
        raise
    finally:
        files.close()
    print(_text(result))
    return max(exit_of(result.ended.name), files.finish(result))


def _single(system: System) -> list[Slave]:
    """Return the slave of a system that has one: what it proposes is taken."""
    slaves = list(system.slaves.values())
    return slaves if len(slaves) == 1 else []


def _master(
    system: System, options: argparse.Namespace, span: tuple[float, float], inputs: dict[str, Given], files: RunFiles
) -> CosimResult:
    t_start, t_stop = span
    slaves = list(system.slaves.values())
    # Agents of a scenario propose nothing of their own.
    proposed = next((slave.default_step for slave in _single(system)), None)
    curves = any(isinstance(given, Curve) for given in inputs.values())
    exact = not curves and all(slave.has_event_mode and slave.variable_step for slave in slaves)
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
            inputs=inputs,
            watch=files.watch,
        )
    if options.step_size is not None:
        print("hybrid-fmu: --step-size is for the fixed-step master; this run is event-exact.", file=sys.stderr)
    # A step is proposed for masters that need short ones; here it is the output that it would make long.
    dense = proposed is not None and t_stop - t_start > MOST * proposed
    interval = _given(options.output_interval, None if dense else proposed, _part(t_stop - t_start, OUTPUT_INTERVAL))
    rows = bool(options.output_file or options.plot or options.show_plot)
    return run_event_exact(
        system,
        t_stop,
        t_start=t_start,
        output_interval=interval,
        record_events=rows,
        inputs=inputs,
        watch=files.watch,
    )


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

"""`hybrid-fmu cosim`: co-simulate a scenario's agents as FMUs, or run a single FMU."""

from __future__ import annotations

import argparse
import math
import shutil
import sys
from dataclasses import fields, replace
from pathlib import Path

from cosim.cli import run_files
from cosim.cli.exits import Exit, exit_of, given_values, progress
from cosim.cli.run_files import RunFiles
from cosim.cli.step_study import study
from cosim.consensus import fmu_system
from cosim.errors import CosimError, UsageError
from cosim.isolation.isolated_slave import PATIENCE
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.masters.changes import Curve, Given
from cosim.masters.error_controlled import TOLERANCE
from cosim.masters.fixed_step import ORDERS
from cosim.result import CosimResult
from cosim.slave import Slave
from cosim.system import System
from cosim.systems.assembly import assemble
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
from cosim.systems.files import read_system
from cosim.systems.ssp_reading import VERSIONS
from cosim.systems.ssp_writing import write_osp, write_ssp
from cosim.systems.toml_file import INTERFACES
from cosim.tables.input_table import read_inputs
from fmu.export import export_fmu
from fmu.importer.temporary_folders import temporary_folder
from fmu.importer.values import shown
from hybrid_model.consensus.laws.closed_loop import broadcast_wires, scenario_agents
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import load_scenario

MOST_SHOWN = 8
"""Most times of events of one slave that are printed."""
STEP, OUTPUT_INTERVAL = 0.01, 0.1
"""In s: the communication step and the spacing of the output where nobody proposes one, if they fit into the run."""
FEWEST, MOST = 10, 100_000
"""Steps of a run where nobody proposes their length."""
EVENT_EXACT, ERROR_CONTROLLED, FIXED_STEP = MASTERS = "event-exact", "error-controlled", "fixed-step"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "system", metavar="SYSTEM", help="an .fmu, .ssp, a system's .toml, a folder with one, or a scenario"
    )
    parser.add_argument(
        "--master",
        choices=MASTERS,
        help="default: event-exact; error-controlled where signals change along flows; else fixed-step",
    )
    parser.add_argument(
        "--interface", choices=INTERFACES, help="of FMUs that have both; default: cs, Co-Simulation; me: Model Exchange"
    )
    parser.add_argument(
        "--fmi", choices=("2.0", "3.0"), default="3.0", help="version of the FMUs that are made of a scenario"
    )
    parser.add_argument("--tolerance", type=float, help="of the error-controlled master: of each step; default: 1e-9")
    parser.add_argument(
        "--order", choices=ORDERS, default=ORDERS[0], help="of the fixed-step master, see docs/cosimulation.md"
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
    parser.add_argument(
        "--save-as",
        type=Path,
        metavar="F.ssp|DIR",
        help="do not run: write the system as an SSP, or as a folder for libcosim (OspSystemStructure.xml)",
    )
    parser.add_argument(
        "--step-study",
        type=Path,
        metavar="DIR",
        help="of a scenario: how far its agents with fixed steps are from the event-exact run, a table and a figure",
    )
    parser.add_argument("--ssp-version", choices=VERSIONS, default=VERSIONS[0])
    parser.add_argument(
        "--loop-iterations",
        type=int,
        default=0,
        metavar="N",
        help="carry signals up to N times round loops without states, until they settle; default: loops are refused",
    )
    parser.add_argument("--isolate", action="store_true", help="run each FMU in a process of its own")
    parser.add_argument(
        "--call-timeout", type=float, default=PATIENCE, metavar="S", help="s that one call of an isolated FMU may take"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    starts = given_values(options.start_value)
    folder = temporary_folder()
    try:
        definition = read_system(options.system)
        if definition is not None and options.step_study is not None:
            raise UsageError(f"--step-study is for scenarios, and {options.system} is none.")
        if definition is None:
            scenario = load_scenario(options.system)
            if options.step_study is not None:
                print(*study(scenario, options.step_study), sep="\n")
                return int(Exit.DONE)
            system, experiment = _agents(scenario, folder, options.fmi), Experiment(stop_time=scenario.stop_time)
            fmus = [Component(name, FMU, str(folder / f"{name}.fmu")) for name in system.slaves]
            definition = SystemDefinition(scenario.name, fmus, broadcast_wires(scenario))
        else:
            if options.interface is not None:
                definition = replace(
                    definition,
                    components=[replace(c, interface=c.interface or options.interface) for c in definition.components],
                )
            system, experiment = _assembled(definition, options), definition.experiment
            options.input_file = options.input_file or definition.inputs
        if options.save_as is not None:
            return _save(options, definition, system, _completed(options, system, experiment))
        _set_starts(system.slaves, starts)
        return _run(system, options, _completed(options, system, experiment))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _assembled(definition: SystemDefinition, options: argparse.Namespace) -> System:
    return assemble(
        definition,
        validate=not options.no_validate,
        isolate=options.isolate,
        patience=options.call_timeout,
        loop_iterations=options.loop_iterations,
    )


def _save(options: argparse.Namespace, definition: SystemDefinition, system: System, experiment: Experiment) -> int:
    """Write a system for other tools instead of running it."""
    if options.start_value:
        raise UsageError("--start-value does not go with --save-as: write start values into the system's file.")
    definition = replace(definition, experiment=experiment)
    if options.save_as.suffix.lower() == ".ssp":
        print(write_ssp(definition, system, options.save_as, options.ssp_version))
    else:
        print(write_osp(definition, system, options.save_as, experiment.step_size or STEP))
    return int(Exit.DONE)


def _completed(options: argparse.Namespace, system: System, file: Experiment) -> Experiment:
    """Return the experiment: what is given goes before what a file says, and that before what FMUs propose."""
    slaves = list(system.slaves.values())
    proposed = Experiment(
        start_time=slaves[0].default_start_time if len(slaves) == 1 else None,
        stop_time=max((s.default_stop_time for s in slaves if s.default_stop_time is not None), default=None),
        step_size=min((s.default_step for s in slaves if s.default_step is not None), default=None),
    )
    # Not `or`: a stop time of 0 is given, and refused with its own sentence.
    return Experiment(
        **{
            field.name: next(
                (v for v in (getattr(x, field.name, None) for x in (options, file, proposed)) if v is not None), None
            )
            for field in fields(Experiment)
        }
    )


def _agents(scenario: Scenario, folder: Path, fmi: str) -> System:
    fmus = {}
    for name, automaton in scenario_agents(scenario).items():
        progress(f"exporting {name}")
        fmus[name] = export_fmu(automaton, folder / f"{name}.fmu", fmi=fmi)
    return fmu_system(scenario, fmus)


def _set_starts(slaves: dict[str, Slave], starts: dict[str, str]) -> None:
    for name, text in starts.items():
        slave, own = _owner(slaves, name)
        try:
            slave.set(own, slave.parse(own, text))
        except CosimError as error:
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


def _run(system: System, options: argparse.Namespace, experiment: Experiment) -> int:
    if experiment.stop_time is None:
        raise UsageError(f"{options.system} proposes no stop time: give --stop-time.")
    inputs = read_inputs(options.input_file, system) if options.input_file else {}
    files = RunFiles(options, system, experiment.stop_time)
    try:
        result = _master(system, options, experiment, inputs, files)
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


def _master(
    system: System, options: argparse.Namespace, experiment: Experiment, inputs: dict[str, Given], files: RunFiles
) -> CosimResult:
    t_start, t_stop = experiment.start_time or 0.0, experiment.stop_time
    assert t_stop is not None
    slaves = list(system.slaves.values())
    proposed = experiment.step_size
    curves = any(isinstance(given, Curve) for given in inputs.values())
    flows = any(system.is_continuous(connection) for connection in system.connections)
    exact = not curves and not flows and all(slave.has_event_mode and slave.variable_step for slave in slaves)
    if experiment.master not in (None, *MASTERS):
        raise UsageError(f"the master {experiment.master!r} is none of {', '.join(MASTERS)}.")
    able = all(slave.can_restore and slave.variable_step and slave.internal_step is None for slave in slaves)
    controlled = able and bool(system.connections)
    master = experiment.master or (EVENT_EXACT if exact else ERROR_CONTROLLED if controlled else FIXED_STEP)
    if master == FIXED_STEP:
        step = _part(t_stop - t_start, STEP) if proposed is None else proposed
        return run_fixed_step(
            system,
            t_stop,
            step,
            t_start=t_start,
            record=system.output_names,
            output_interval=experiment.output_interval,
            inputs=inputs,
            watch=files.watch,
            order=options.order,
        )
    if options.step_size is not None:
        print(f"hybrid-fmu: --step-size is for the fixed-step master; this run is {master}.", file=sys.stderr)
    # A step is proposed for masters that need short ones; here it is the output that it would make long.
    dense = proposed is not None and t_stop - t_start > MOST * proposed
    interval = experiment.output_interval
    if interval is None:
        interval = _part(t_stop - t_start, OUTPUT_INTERVAL) if dense or proposed is None else proposed
    rows = bool(options.output_file or options.plot or options.show_plot)
    if master == ERROR_CONTROLLED:
        return run_error_controlled(
            system,
            t_stop,
            t_start=t_start,
            tolerance=TOLERANCE if experiment.tolerance is None else experiment.tolerance,
            output_interval=interval,
            record_events=rows,
            inputs=inputs,
            watch=files.watch,
        )
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


def _some(names: list[str]) -> str:
    return ", ".join(names[:MOST_SHOWN]) + (f" and {len(names) - MOST_SHOWN} more" if len(names) > MOST_SHOWN else "")


def _text(result: CosimResult) -> str:
    lines = [result.message or f"reached t = {result.t:.9g} s in {result.steps} step{'s' * (result.steps != 1)}"]
    if len(result.treatment) > 1:
        ways: dict[str, list[str]] = {}
        for name, way in result.treatment.items():
            ways.setdefault(way, []).append(name)
        lines += [f"  {_some(names)}: {way}" for way, names in ways.items()]
    clocks = sorted({(tick.slave, tick.clock) for tick in result.ticks})
    told = {slave for slave, _ in clocks}
    lines += [_events(name, result) for name in sorted({event.block for event in result.events} - told)]
    lines += [f"  {slave}.{clock}: {len(result.tick_times(slave, clock))} ticks" for slave, clock in clocks]
    lines += [f"  {name} = {shown(value)}" for name, value in result.final.items()]
    return "\n".join(lines)

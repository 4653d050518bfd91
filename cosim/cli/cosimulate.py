"""`hybrid-fmu cosim`: co-simulate a scenario's agents as FMUs, or run a single FMU."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from cosim.cli.exits import Exit, exit_of, given_values
from cosim.cli.options.cosimulate import ORDERS
from cosim.cli.outputs import results_folder
from cosim.cli.progress import Work
from cosim.cli.run_files import RunFiles
from cosim.cli.step_study import study
from cosim.cli.system_fmus import with_fmus
from cosim.consensus import fmu_system
from cosim.errors import CosimError, GivenValueError, MisfitError, TimesError, UsageError
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.masters.changes import Curve, Given
from cosim.masters.error_controlled import TOLERANCE
from cosim.masters.standing_signals import standing_still
from cosim.result import CosimResult
from cosim.slave import Slave
from cosim.system import System
from cosim.systems.assembly import assemble, set_start, sizes_first
from cosim.systems.definition import (
    AUTOMATON,
    ERROR_CONTROLLED,
    EVENT_EXACT,
    FIXED_STEP,
    FMU,
    Component,
    Experiment,
    SystemDefinition,
)
from cosim.systems.files import read_system
from cosim.systems.ssp_writing import write_osp, write_ssp
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


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    starts = given_values(options.start_value)
    # libcosim, which folders are for, has no FMI 3.0.
    to_folder = options.save_as is not None and options.save_as.suffix.lower() != ".ssp"
    options.fmi = options.fmi or ("2.0" if to_folder else "3.0")
    folder = temporary_folder()
    try:
        definition = _described(options)
        if definition is not None and options.step_study is not None:
            raise UsageError(f"--step-study is for scenarios, and {options.system} is none.")
        if definition is None:
            scenario = load_scenario(options.system)
            if options.step_study is not None:
                return _study(scenario, options)
            _require_fmus(options, [])
            system, experiment = _agents(scenario, folder, options.fmi), Experiment(stop_time=scenario.stop_time)
            _set_starts(system.slaves, starts)
            fmus = [Component(name, FMU, str(folder / f"{name}.fmu")) for name in system.slaves]
            definition = SystemDefinition(scenario.name, fmus, broadcast_wires(scenario))
        else:
            definition = _with_interface(definition, options)
            system, experiment = _assembled(definition, options, starts), definition.experiment
            options.input_file = options.input_file or definition.inputs
        if options.save_as is not None:
            return _save(options, definition, system, _completed(options, system, experiment), folder)
        with _slips_in_times(options, experiment):
            return _run(system, options, _completed(options, system, experiment))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _described(options: argparse.Namespace) -> SystemDefinition | None:
    with _slips_of(options):
        definition = read_system(options.system)
    if definition is not None and definition.left_out:
        told = f"{options.system} gives values to what is not in it, and they are left out"
        print(f"hybrid-fmu: {told}: {_some(list(definition.left_out))}.", file=sys.stderr)
    return definition


def _with_interface(definition: SystemDefinition, options: argparse.Namespace) -> SystemDefinition:
    """Return the system with the interface that is wished for the FMUs whose file names none."""
    _require_fmus(options, definition.components)
    if options.interface is None:
        return definition
    chosen = {c.name: c.interface or options.interface for c in definition.components if c.kind == FMU}
    return replace(definition, components=[replace(c, interface=chosen.get(c.name)) for c in definition.components])


def _require_fmus(options: argparse.Namespace, components: Sequence[Component]) -> None:
    """Refuse an interface where there is no FMU that is used by one."""
    if options.interface is not None and not any(component.kind == FMU for component in components):
        raise UsageError(
            f"--interface {options.interface} chooses what is used of FMUs, and {options.system} names none: leave it "
            "out."
        )


def _assembled(definition: SystemDefinition, options: argparse.Namespace, starts: dict[str, str]) -> System:
    with _slips_of(options):
        return assemble(
            definition,
            validate=not options.no_validate,
            isolate=options.isolate,
            patience=options.call_timeout,
            loop_iterations=options.loop_iterations,
            prepare=lambda slaves: _set_starts(slaves, starts),
        )


@contextlib.contextmanager
def _slips_of(options: argparse.Namespace) -> Iterator[None]:
    """Let what a system's own file says and does not fit be wrong usage, as it is of scenarios."""
    try:
        yield
    except MisfitError as error:
        written = Path(options.system)
        if written.is_dir() or written.suffix.lower() in (".toml", ".ssp", ".ssd"):
            told = str(error)
            raise UsageError(told if told.startswith(str(written)) else f"{written}: {told}") from error
        raise


@contextlib.contextmanager
def _slips_in_tables() -> Iterator[None]:
    """Let what a table says that was named, and does not fit, be wrong usage, as it is of systems and scenarios."""
    try:
        yield
    except MisfitError as error:
        raise UsageError(str(error)) from error


@contextlib.contextmanager
def _slips_in_times(options: argparse.Namespace, file: Experiment) -> Iterator[None]:
    """Let times that were given, and do not fit, be wrong usage; those that an FMU proposes are its own matter."""
    try:
        yield
    except TimesError as error:
        # What is typed is more of a slip than what a file says that may have run before.
        told = [f"--{name.replace('_', '-')}" for name in error.of if getattr(options, name, None) is not None]
        told += [f"{options.system}, {name}" for name in error.of if getattr(file, name) is not None]
        if told:
            raise UsageError(f"{told[0]}: {error}") from error
        raise


def _save(
    options: argparse.Namespace, definition: SystemDefinition, system: System, experiment: Experiment, folder: Path
) -> int:
    """Write a system for other tools instead of running it."""
    if options.start_value:
        raise UsageError("--start-value does not go with --save-as: write start values into the system's file.")
    definition = replace(definition, experiment=experiment)
    if any(component.kind == AUTOMATON for component in definition.components):
        definition = with_fmus(definition, system, folder, options.fmi)
        system = _assembled(definition, options, {})
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
    chosen = Experiment(
        **{
            field.name: next(
                (v for v in (getattr(x, field.name, None) for x in (options, file, proposed)) if v is not None), None
            )
            for field in fields(Experiment)
        }
    )
    start = chosen.start_time or 0.0
    if options.stop_time is not None and not options.stop_time > start:
        raise UsageError(
            f"--stop-time {options.stop_time:g}: the run starts at {start:g} s; give the stop after the start."
        )
    return chosen


def _study(scenario: Scenario, options: argparse.Namespace) -> int:
    with Work() as work, results_folder(options.step_study, "step-study") as folder:
        written = [str(options.step_study / path.name) for path in study(scenario, folder, work=work)]
    print(json.dumps({"files": written}, indent=2) if options.json else "\n".join(written))
    return int(Exit.DONE)


def _agents(scenario: Scenario, folder: Path, fmi: str) -> System:
    fmus = {}
    agents = scenario_agents(scenario)
    with Work(len(agents)) as work:
        for name, automaton in agents.items():
            work.begin(f"exporting {name}")
            fmus[name] = export_fmu(automaton, folder / f"{name}.fmu", fmi=fmi)
    return fmu_system(scenario, fmus)


def _set_starts(slaves: dict[str, Slave], starts: dict[str, str]) -> None:
    places = {name: _owner(slaves, name) for name in starts}
    values: dict[str, str | list[str]] = {
        name: text.split() if _is_array(*places[name]) else text for name, text in starts.items()
    }
    for name in sizes_first(values):
        try:
            set_start(*places[name], values[name])
        except CosimError as error:
            raise UsageError(f"--start-value: {error}") from error


def _is_array(slave: Slave, name: str) -> bool:
    return name not in slave.variable_names and slave.has(name)


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
    with _slips_in_tables():
        inputs = read_inputs(options.input_file, system) if options.input_file else {}
    files = RunFiles(options, system, experiment.stop_time)
    try:
        result = _master(system, options, experiment, inputs, files)
    except (CosimError, KeyboardInterrupt) as error:
        if files.result is not None and options.output_file:
            print(
                f"  {options.output_file} has what there was up to t = {files.result.times[-1]:.9g} s", file=sys.stderr
            )
        if isinstance(error, GivenValueError):
            raise GivenValueError(f"{options.input_file}: {error}") from error
        if options.master is not None and files.result is None and type(error) is MisfitError:
            raise UsageError(f"--master {options.master}: {error}") from error
        raise
    finally:
        files.close()
    # Files first: whoever reads the text may close it before its end.
    with _slips_in_tables():
        status, compared = files.finish(result)
    if options.json:
        print(json.dumps(_document(result, compared), indent=2))
    else:
        print(_text(result), *compared, sep="\n")
    for slave in system.slaves.values():
        if slave.failed_at_end:
            print(
                f"hybrid-fmu: {slave.failed_at_end.rstrip('.')}. The run was over, and its results are whole.",
                file=sys.stderr,
            )
    if standing := standing_still(system, result):
        print(f"hybrid-fmu: {standing}", file=sys.stderr)
    return max(exit_of(result.ended.name), status)


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
    able = all(slave.can_restore and slave.variable_step and slave.internal_step is None for slave in slaves)
    controlled = able and bool(system.connections)
    master = experiment.master or (EVENT_EXACT if exact else ERROR_CONTROLLED if controlled else FIXED_STEP)
    _tell_unused(options, master)
    if master == EVENT_EXACT and curves:
        curve = next(name for name, given in inputs.items() if isinstance(given, Curve))
        raise UsageError(
            f"the event-exact master sets inputs at events only, and {curve} of {options.input_file} changes between "
            "its rows: leave the master out, or choose another one."
        )
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
            order=options.order or ORDERS[0],
        )
    # A step is proposed for masters that need short ones; here it is the output that it would make long.
    dense = proposed is not None and t_stop - t_start > MOST * proposed
    interval = experiment.output_interval
    if interval is None:
        interval = _part(t_stop - t_start, OUTPUT_INTERVAL) if dense or proposed is None else proposed
    rows = bool(options.output_file or options.plot or options.show_plot or options.reference_file)
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


def _tell_unused(options: argparse.Namespace, master: str) -> None:
    """Say which options are for another master."""
    for option, given, of in (
        ("--step-size", options.step_size, FIXED_STEP),
        ("--order", options.order, FIXED_STEP),
        ("--tolerance", options.tolerance, ERROR_CONTROLLED),
    ):
        if given is not None and master != of:
            print(f"hybrid-fmu: {option} is for the {of} master; this run is {master}.", file=sys.stderr)


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


def _document(result: CosimResult, compared: list[str]) -> dict[str, Any]:
    clocks = sorted({(tick.slave, tick.clock) for tick in result.ticks})
    return {
        "ended": result.ended.name,
        "message": result.message,
        "t": result.t,
        "steps": result.steps,
        "treatment": result.treatment,
        "engine": result.engine,
        "event_times": {name: result.event_times(name).tolist() for name in sorted({e.block for e in result.events})},
        "ticks": {f"{slave}.{clock}": result.tick_times(slave, clock).tolist() for slave, clock in clocks},
        "final": {name: value.hex() if isinstance(value, bytes) else value for name, value in result.final.items()},
        "compared": [line.strip() for line in compared],
    }

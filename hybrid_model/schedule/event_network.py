"""Compositions whose parts meet only at events, run part by part: an event costs what its receivers cost.

`simulate` integrates all parts of a composition together, so each event stops all of them. Where the signals between
parts change only at jumps, each part can run alone from one reception to the next. The scheduler in C
(hybrid_model/engine/schedule) does that, and `hybrid_model.schedule.scheduler` is the same to be read, and for maps
that cannot be traced. The result is that of `simulate`, at a cost per event that does not grow with the number of
parts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_model.declare.arguments import real_number, require_choice, require_inputs, require_options
from hybrid_model.declare.calls import explained
from hybrid_model.declare.composition import Composition, ElementWire
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.signals import Inputs, InputValue
from hybrid_model.declare.variables import Kind, Values, element_names
from hybrid_model.errors import BuildError, SimulationError, TraceError, WiringError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.arc_values import ReceivedValues
from hybrid_model.record.run_record import RunRecord
from hybrid_model.reference.execution import Execution
from hybrid_model.schedule.automaton_block import AutomatonBlock
from hybrid_model.schedule.network_arrays import Network
from hybrid_model.schedule.network_inputs import NetworkInputs
from hybrid_model.schedule.network_run import NetworkRun
from hybrid_model.schedule.progress import Told
from hybrid_model.schedule.scheduler import Scheduler
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

if TYPE_CHECKING:
    from hybrid_model.schedule.network_events import NetworkEvents

ENGINES = ("auto", "native", "python")


@explained(solver=Solver, zeno=ZenoGuard)
def simulate_network(
    network: Composition | Network,
    t_end: float,
    *,
    t_start: float = 0.0,
    inputs: Mapping[str, Any] | None = None,
    solver: Solver | None = None,
    zeno: ZenoGuard | None = None,
    engine: str = "auto",
    events_to: str | os.PathLike[str] | None = None,
    progress: Told = False,
) -> NetworkRun:
    """Run a composition whose parts exchange discrete signals only, part by part.

    Parameters
    ----------
    network : Composition or Network
        Every wire carries a signal that changes only at jumps. The order of parts is the order of simultaneous jumps.
    t_end, t_start : float
        Times in s.
    inputs : mapping, optional
        Input or tunable parameter of the composition -> as in `simulate`; of the parts of a `Network` -> a function of
        time for all parts, or a sequence with one for each, None where a part keeps its value.
        A function that jumps or has short pulses needs a `Signal` with its breakpoints: a plain one is looked at where
        the solver steps, and a pulse between two steps goes unseen.
    solver : Solver, optional
        Method and accuracy.
    zeno : ZenoGuard, optional
        What counts as an accumulation of jumps of one part.
    engine : {"auto", "native", "python"}
        The scheduler in C, which runs maps that are compiled, or the readable one in Python, which runs any. Default:
        the native one wherever it can; `NetworkRun.engine` says which ran and why.
    events_to : path, optional
        A new folder to which events go as they come (native engine only), for `load_network_events`; a run that is
        interrupted leaves what it has. Default: memory, and files in a passing folder where they become many.
    progress : bool or callable
        Whether to tell on stderr how far the run is; or who is told, ``progress(t, events)`` (native engine only).

    Returns
    -------
    NetworkRun
        An arc for each part.

    Raises
    ------
    WiringError
        If a wire carries a signal that changes along flows.
    SimulationError
        As `simulate`.
    SchedulingError
        If a part asks for event iterations without end.
    KeyboardInterrupt
        If the run is interrupted from outside; its attribute `events` has what had happened (native engine).
    """
    require_choice("engine", engine, ENGINES)
    require_inputs(inputs)
    require_options("solver", solver, Solver, first="method")
    require_options("zeno", zeno, ZenoGuard, first="max_jumps")
    t_start, t_end = real_number("t_start", t_start), real_number("t_end", t_end)
    if not (math.isfinite(t_end) and math.isfinite(t_start) and t_end >= t_start):
        raise SimulationError(
            f"the end time is {t_end} s and the start {t_start} s: give finite times, the end not before the start."
        )
    if not isinstance(network, (Composition, Network)):
        raise WiringError(
            f"simulate_network runs the parts of a Composition, and {network!r} is none: use simulate; to run faster, "
            "compile the parts and not the whole."
        )
    solver, zeno = solver or Solver(), zeno or ZenoGuard()
    span, why = (t_start, t_end), 'python: it was asked for (engine="python").'
    arrays = NetworkInputs(network, inputs or {}) if isinstance(network, Network) else None
    parts = {} if isinstance(network, Network) else _parts(network, span, inputs or {}, solver, zeno)
    if engine != "python":
        try:
            # CasADi is imported by whoever runs something, and not by all who import the package.
            from hybrid_model.schedule.native_network import native_network_run

            return native_network_run(
                network, parts, arrays, span, solver, zeno, events_to=events_to, progress=progress
            )
        except (TraceError, BuildError) as error:
            why = f"python: {error}"
            if engine == "native":
                raise SimulationError(f"{network.name} cannot run on the native engine: {error}") from error
    if not isinstance(network, Network):
        return _python_run(network, parts, span, solver, why)
    whole = network.composition()
    parts = _parts(whole, span, arrays.scoped() if arrays else {}, solver, zeno)
    return _python_run(whole, parts, span, solver, why)


def _parts(
    network: Composition,
    span: tuple[float, float],
    inputs: Mapping[str, InputValue],
    solver: Solver,
    zeno: ZenoGuard,
) -> dict[str, Execution]:
    """Return the parts of a composition at their start."""
    _require_discrete(network)
    return _executions(network, *span, inputs, solver, zeno)


def _python_run(
    network: Composition, runs: Mapping[str, Execution], span: tuple[float, float], solver: Solver, why: str
) -> NetworkRun:
    t_start, t_end = span
    order: list[str] = []
    blocks = {part: AutomatonBlock(part, run, t_end, on_jump=order.append) for part, run in runs.items()}
    wires: dict[str, list[ElementWire]] = {part: [] for part in network.parts}
    for wire in network.wires:
        wires[wire.source].append(wire)
    scheduler = Scheduler(blocks, wires.__getitem__, t_start, solver.event_tolerance)
    for block in blocks.values():
        block.begin()
    scheduler.handle_events(t_start, blocks)
    if not scheduler.ended:
        scheduler.advance_to(t_end)
    return _result(network, blocks, scheduler, order, t_end, why)


def _require_discrete(network: Composition) -> None:
    changing = {
        (part, element)
        for part, automaton in network.parts.items()
        for variable in automaton.of_kind(Kind.STATE, Kind.OUTPUT)
        if not variable.discrete
        for element in element_names(variable)
    }
    for wire in network.wires:
        if (wire.source, wire.output) in changing:
            raise WiringError(
                f"{network.name}: {wire} carries a signal that changes along flows, so its ends cannot run apart: "
                "compose the two to one part, or use simulate."
            )


def _executions(
    network: Composition,
    t_start: float,
    t_end: float,
    inputs: Mapping[str, InputValue],
    solver: Solver,
    zeno: ZenoGuard,
) -> dict[str, Execution]:
    # The composition computes the start, so that it is the same as in `simulate`.
    whole = Execution(network, t_start=t_start, inputs=Inputs(Layout(network), inputs))
    s = whole.values()
    runs = {}
    for part, automaton in network.parts.items():
        own = {v.name: network.scoped_name(part, v.name) for v in automaton.of_kind(Kind.INPUT, Kind.PARAMETER)}
        given = {name: inputs[scoped] for name, scoped in own.items() if scoped in inputs}
        run = Execution(
            automaton,
            t_start=t_start,
            t_stop=t_end,
            inputs=Inputs(Layout(automaton), given),
            solver=solver,
            zeno=zeno,
        )
        _start(run, network.part_values(part, s), given)
        runs[part] = run
    return runs


def _start(run: Execution, values: Values, given: Mapping[str, InputValue]) -> None:
    layout = run.layout
    for variable in run.automaton.of_kind(Kind.INPUT):
        if variable.name not in given:
            run.inputs.hold(variable.name, values[variable.name])
    x, z = (
        layout.pack(kind, {place.variable.name: values[place.variable.name] for place in layout.places[kind]})
        for kind in (Kind.STATE, Kind.DISCRETE)
    )
    run.begin_at(x, z)


def _result(
    network: Composition,
    blocks: Mapping[str, AutomatonBlock],
    scheduler: Scheduler,
    order: Sequence[str],
    t_end: float,
    why: str,
) -> NetworkRun:
    stop, message, t = Stop.HORIZON, f"{network.name}: reached t = {t_end:.9g} s.", t_end
    if scheduler.ended:
        ended, t, end = scheduler.ended
        stop, message = blocks[ended].run.stopped or Stop.BLOCKED, f"{network.name}, part {ended}: {end.message}"
    arcs = {}
    for part, block in blocks.items():
        run, recording = block.run, block.recording
        read = ReceivedValues(run.automaton, run.inputs, recording.received)
        flows = [replace(flow, z=np.append(flow.z, j)) for j, flow in enumerate(recording.flows)]
        arcs[part] = HybridArc(RunRecord(read, flows, recording.jumps, stop, message, run.event_tolerance))
    return NetworkRun(arcs, stop, message, t, why, lambda: _events(network, arcs, order))


def _events(network: Composition, arcs: Mapping[str, HybridArc], order: Sequence[str]) -> NetworkEvents:
    from hybrid_model.schedule.events_of_arcs import events_of_arcs

    return events_of_arcs(network, arcs, order)

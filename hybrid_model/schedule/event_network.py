"""Compositions whose parts meet only at events, run part by part: an event costs what its receivers cost.

`simulate` integrates all parts of a composition together, so each event stops all of them. Where the signals between
parts change only at jumps, each part can run alone from one reception to the next. The scheduler in C
(hybrid_model/engine/schedule) does that, and `hybrid_model.schedule.scheduler` is the same to be read, and for maps
that cannot be traced. The result is that of `simulate`, at a cost per event that does not grow with the number of
parts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hybrid_model.declare.arguments import real_number, require_choice, require_inputs, require_options
from hybrid_model.declare.calls import explained
from hybrid_model.declare.composition import Composition, ElementWire
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.signals import Inputs, InputValue
from hybrid_model.declare.variables import FloatArray, Kind, Values, element_names, unknown_name
from hybrid_model.errors import BuildError, SimulationError, TraceError, WiringError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.arc_values import ReceivedValues
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.record.run_record import RunRecord
from hybrid_model.reference.execution import Execution
from hybrid_model.schedule.automaton_block import AutomatonBlock
from hybrid_model.schedule.scheduler import Scheduler
from hybrid_model.solver import Method, Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

if TYPE_CHECKING:
    from hybrid_model.native.network_run import EventColumns

ENGINES = ("auto", "native", "python")


@dataclass(frozen=True, eq=False)
class NetworkRun:
    """A run of a network: one hybrid arc for each part, on the part's own hybrid time.

    Attributes
    ----------
    arcs : mapping
        Part -> its arc. What a part received is in its inputs; a reception is no jump of the receiver. After a run on
        the native engine an arc is made from the events when it is first asked for.
    stop : Stop
        Why the run ended; `message` has the particulars.
    t : float
        Time in s at which it ended. When one part ends the run, the others end at their last event before.
    engine : str
        What ran, and why.
    """

    arcs: Mapping[str, HybridArc]
    stop: Stop
    message: str
    t: float
    engine: str = ""

    @property
    def jumps(self) -> list[tuple[str, JumpRecord]]:
        """All jumps with the parts that took them, in time; those of one instant in the order of the parts."""
        found = [(part, jump) for part, arc in self.arcs.items() for jump in arc.jumps]
        return sorted(found, key=lambda entry: entry[1].t)

    def event_times(self, part: str, jump: str) -> FloatArray:
        """Return the times in s of one part's jumps of one name."""
        if part not in self.arcs:
            raise WiringError(unknown_name("the network (parts)", part, self.arcs))
        return self.arcs[part].event_times(jump)


@explained(solver=Solver, zeno=ZenoGuard)
def simulate_network(
    network: Composition,
    t_end: float,
    *,
    t_start: float = 0.0,
    inputs: Mapping[str, InputValue] | None = None,
    solver: Solver | None = None,
    zeno: ZenoGuard | None = None,
    engine: str = "auto",
) -> NetworkRun:
    """Run a composition whose parts exchange discrete signals only, part by part.

    Parameters
    ----------
    network : Composition
        Every wire carries a signal that changes only at jumps. The order of parts is the order of simultaneous jumps.
    t_end, t_start : float
        Times in s.
    inputs : mapping, optional
        Input or tunable parameter of the composition -> as in `simulate`.
        A function that jumps or has short pulses needs a `Signal` with its breakpoints: a plain one is looked at where
        the solver steps, and a pulse between two steps goes unseen.
    solver : Solver, optional
        Method and accuracy.
    zeno : ZenoGuard, optional
        What counts as an accumulation of jumps of one part.
    engine : {"auto", "native", "python"}
        The scheduler in C, which runs maps that are compiled, or the readable one in Python, which runs any. Default:
        the native one wherever it can; `NetworkRun.engine` says which ran and why.

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
    if not isinstance(network, Composition):
        raise WiringError(
            f"simulate_network runs the parts of a Composition, and {network!r} is none: use simulate; to run faster, "
            "compile the parts and not the whole."
        )
    _require_discrete(network)
    solver, zeno = solver or Solver(), zeno or ZenoGuard()
    runs = _executions(network, t_start, t_end, inputs or {}, solver, zeno)
    why = 'python: it was asked for (engine="python").'
    if engine != "python":
        try:
            return _native_run(network, runs, (t_start, t_end), solver, zeno)
        except (TraceError, BuildError) as error:
            why = f"python: {error}"
            if engine == "native":
                raise SimulationError(f"{network.name} cannot run on the native engine: {error}") from error
    return _python_run(network, runs, (t_start, t_end), solver, why)


def _native_run(
    network: Composition,
    runs: Mapping[str, Execution],
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
) -> NetworkRun:
    # CasADi is imported by whoever runs something, and not by all who import the package.
    from hybrid_model.schedule.native_network import EventTable, RebuiltArcs, StiffPart, joined, run_table
    from hybrid_model.schedule.part_table import table_of

    for part, run in runs.items():
        if run.inputs.vary or run.inputs.breakpoints_in(*span):
            raise TraceError(f"what {part} is given from outside follows time, which networks do in Python only.")
    chunks: list[EventColumns] = []
    table = table_of(network, runs, stiff=solver.method in (Method.RADAU, Method.BDF))
    try:
        outcome = run_table(table, span, solver, zeno, lambda events, _: chunks.append(events))
    except StiffPart:
        # From the start, with the derivatives that another method needs: so the first run is as all later ones.
        chunks.clear()
        table = table_of(network, runs, stiff=True)
        outcome = run_table(table, span, solver, zeno, lambda events, _: chunks.append(events))
    events = EventTable(joined(chunks), len(runs))
    starts = list(runs.values())
    arcs = RebuiltArcs(
        table,
        events,
        (span[0], outcome.t),
        solver,
        zeno,
        outcome,
        lambda part: (starts[part].automaton, starts[part].inputs),
    )
    return NetworkRun(arcs, outcome.stop, outcome.message, outcome.t, "native: its maps are compiled.")


def _python_run(
    network: Composition, runs: Mapping[str, Execution], span: tuple[float, float], solver: Solver, why: str
) -> NetworkRun:
    t_start, t_end = span
    blocks = {part: AutomatonBlock(part, run, t_end) for part, run in runs.items()}
    wires: dict[str, list[ElementWire]] = {part: [] for part in network.parts}
    for wire in network.wires:
        wires[wire.source].append(wire)
    scheduler = Scheduler(blocks, wires.__getitem__, t_start, solver.event_tolerance)
    for block in blocks.values():
        block.begin()
    scheduler.handle_events(t_start, blocks)
    if not scheduler.ended:
        scheduler.advance_to(t_end)
    return _result(network, blocks, scheduler, t_end, why)


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
    network: Composition, blocks: Mapping[str, AutomatonBlock], scheduler: Scheduler, t_end: float, why: str
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
    return NetworkRun(arcs, stop, message, t, why)

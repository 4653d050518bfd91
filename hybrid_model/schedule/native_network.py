"""A network run by the scheduler in C, and the arcs of its parts, which are made from the events when asked for."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import SchedulingError, SimulationError
from hybrid_model.native.network_run import EventColumns, NativeNetwork, NetworkAdvance, NetworkEnd
from hybrid_model.native.run import Ending
from hybrid_model.native.simulation import FOLLOWED, FOR_STIFF_FLOWS, fill_options, require_supported
from hybrid_model.reference.execution import Execution
from hybrid_model.schedule.blocks import StiffPart
from hybrid_model.schedule.event_store import EventStore
from hybrid_model.schedule.network_arrays import Network
from hybrid_model.schedule.network_events import NetworkEvents
from hybrid_model.schedule.network_inputs import NetworkInputs
from hybrid_model.schedule.network_run import NetworkRun
from hybrid_model.schedule.outside import Given, Outside
from hybrid_model.schedule.part_table import PartTable, table_of, table_of_arrays
from hybrid_model.schedule.progress import Progress, Told
from hybrid_model.schedule.rebuilt_arcs import EventTable, RebuiltArcs
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

EVENTS_AT_ONCE = 20_000
"""After so many events a run comes back: what has happened is kept elsewhere, and it can be interrupted."""
STEPS_AHEAD = 1
"""Of the solver, in one look ahead of a part: what lies beyond is looked at when the time comes, for an input may have
changed by then."""
_STOPS = {Ending.ZENO: Stop.ZENO, Ending.BLOCKED: Stop.BLOCKED, Ending.JUMPS: Stop.JUMPS}

_RAN = "native: its maps are compiled."

Keep = Callable[[EventColumns, float], None]
"""What is done with the events up to a time in s."""


@dataclass(frozen=True)
class NetworkOutcome:
    """How a run ended: why, the particulars, and when in s."""

    stop: Stop
    message: str
    t: float


def native_network_run(
    network: Composition | Network,
    runs: Mapping[str, Execution],
    inputs: NetworkInputs | None,
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
    *,
    events_to: str | os.PathLike[str] | None,
    progress: Told,
) -> NetworkRun:
    """Run a network on the scheduler in C.

    Parameters
    ----------
    network, span, solver, zeno, events_to, progress
        See `hybrid_model.schedule.event_network.simulate_network`.
    runs : mapping
        The parts of a composition at their start.
    inputs : NetworkInputs or None
        What those of a network as arrays are given.

    Raises
    ------
    TraceError
        If a part's maps or functions of time cannot be traced, or the engine in C does not step as the solver asks.
    BuildError
        If there is no compiler, or it fails.
    """
    require_supported(solver)
    if inputs is None:
        given = {k: one for k, run in enumerate(runs.values()) if (one := Given.of(run.inputs, span)) is not None}
    else:
        given = inputs.given(span)
    stiff = solver.method in FOR_STIFF_FLOWS
    try:
        return _run_once(network, runs, inputs, given, span, solver, zeno, events_to, progress, stiff=stiff)
    except StiffPart:
        # From the start, with the derivatives that another method needs: so the first run is as all later ones.
        return _run_once(network, runs, inputs, given, span, solver, zeno, events_to, progress, stiff=True)


def _run_once(
    network: Composition | Network,
    runs: Mapping[str, Execution],
    inputs: NetworkInputs | None,
    given: Mapping[int, Given],
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
    events_to: str | os.PathLike[str] | None,
    progress: Told,
    *,
    stiff: bool,
) -> NetworkRun:
    if isinstance(network, Network):
        table = table_of_arrays(network, given, *span, stiff=stiff)
    else:
        table = table_of(network, runs, given, stiff=stiff)
    store = EventStore(table.about, table.width, None if events_to is None else Path(events_to))
    told, outside = Progress(span, wanted=progress), Outside(given)

    def keep(events: EventColumns, t: float) -> None:
        store.keep(events)
        told.note(t, len(events.t))

    try:
        outcome, ends = run_table(table, outside, span, solver, zeno, keep)
    except StiffPart:
        store.discard()
        raise
    except KeyboardInterrupt:
        raise InterruptedNetwork(NetworkEvents.of_columns(store.columns(), **table.about)) from None
    finally:
        store.close()
    columns = store.columns()
    starts = list(runs.values())

    def declared(part: int) -> tuple[Automaton, Inputs]:
        if isinstance(network, Network):
            automaton = network.copy(part)
            return automaton, Inputs(layout_of(automaton), inputs.of_part(part) if inputs else None)
        return starts[part].automaton, starts[part].inputs

    events = EventTable(columns, len(table.names), outside)
    how = outcome.stop, outcome.message
    arcs = RebuiltArcs(
        table, events, (span[0], outcome.t), solver, zeno, *how, lambda: started(table, span, solver, zeno), declared
    )
    return NetworkRun(
        arcs,
        outcome.stop,
        outcome.message,
        outcome.t,
        FOLLOWED if any(one.driven for one in given.values()) else _RAN,
        lambda: NetworkEvents.of_columns(columns, **table.about),
        lambda name: table.values_of(ends, name),
    )


class InterruptedNetwork(KeyboardInterrupt):
    """A run of a network that was interrupted from outside.

    Attributes
    ----------
    events : NetworkEvents
        What had happened.
    """

    def __init__(self, events: NetworkEvents) -> None:
        super().__init__(f"interrupted after {len(events)} events, which are the exception's `events`")
        self.events = events


def run_table(
    table: PartTable, outside: Outside, span: tuple[float, float], solver: Solver, zeno: ZenoGuard, keep: Keep
) -> tuple[NetworkOutcome, list[dict[Kind, FloatArray]]]:
    """Run a network from the start to the end of a span, and return how it ended, and the states of all parts then.

    Parameters
    ----------
    table : PartTable
        The parts.
    outside : Outside
        What they are given.
    span : (float, float)
        In s.
    solver : Solver
        Accuracy.
    zeno : ZenoGuard
        What counts as an accumulation of jumps of one part.
    keep : callable
        Takes the events as they come.

    Raises
    ------
    TraceError
        If the engine in C does not step as the solver asks.
    StiffPart
        If a flow needs derivatives that are not there.
    SimulationError
        If a part's maps or its flow fail.
    SchedulingError
        If a part asks for event iterations without end.
    """
    network = started(table, span, solver, zeno)
    outside.begin(network)
    try:
        advance = _advanced(network, outside, span[1], keep)
    finally:
        keep(network.take_events(), network.time)
    if advance is NetworkAdvance.STIFF:
        raise StiffPart
    groups = range(len(table.groups))
    if advance is NetworkAdvance.REACHED:
        outcome = NetworkOutcome(Stop.HORIZON, f"{table.name}: reached t = {span[1]:.9g} s.", span[1])
    else:
        outcome = _outcome(table, network.end)
    return outcome, [{kind: network.read(k, kind) for kind in (Kind.STATE, Kind.DISCRETE)} for k in groups]


def _advanced(network: NativeNetwork, outside: Outside, end: float, keep: Keep) -> NetworkAdvance:
    """Run from breakpoint to breakpoint of what is given."""
    events = 0

    def take() -> None:
        nonlocal events
        taken = network.take_events()
        events += len(taken.t)
        keep(taken, network.time)

    def come(go: Callable[[float, int], NetworkAdvance], target: float) -> NetworkAdvance:
        advance = NetworkAdvance.GOING
        while advance is NetworkAdvance.GOING:
            advance = go(target, EVENTS_AT_ONCE)
            take()
        return advance

    if not network.begin():
        return network.end.how
    take()
    for time, changes in outside.times():
        if (advance := come(network.approach, time)) is not NetworkAdvance.REACHED:
            return advance
        if not all(outside.give(network, part, k, events) for part, k in changes) or not network.handle():
            return network.end.how
        take()
    return come(network.advance, end)


def started(table: PartTable, span: tuple[float, float], solver: Solver, zeno: ZenoGuard) -> NativeNetwork:
    """Return the parts with their start values, before anything has happened."""
    require_supported(solver)
    network = table.network()
    for k, automaton in enumerate(table.automata):
        options = network.options(k)
        fill_options(options, solver, zeno, layout_of(automaton).sizes[Kind.STATE])
        options.look_ahead_steps = STEPS_AHEAD
    if not network.start(*span, computed=table.computed):
        _outcome(table, network.end)
    return network


def _outcome(table: PartTable, end: NetworkEnd) -> NetworkOutcome:
    where = f"{table.name}, part {table.names[end.part]}"
    if end.how is NetworkAdvance.REFUSED:
        raise SchedulingError(f"{where} {end.message}")
    if end.ending not in _STOPS:
        raise SimulationError(f"{where}: {end.message}")
    stop = _STOPS[end.ending]
    extra = f" {stop.value}" if stop is Stop.JUMPS else ""
    return NetworkOutcome(stop, f"{where}: {end.message}{extra}", end.t)

"""The event-exact master: slaves that meet only at events, run by `hybrid_model.schedule.scheduler`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from cosim.errors import CosimError, MisfitError
from cosim.masters.changes import Changes, Curve, Given
from cosim.masters.queues import queue_of
from cosim.masters.start import (
    INTERVAL,
    apart_from_the_rest,
    outputs,
    require_times,
    sample_change,
    sample_end,
    start_slaves,
)
from cosim.masters.treatments import exactly
from cosim.result import CosimResult, Watch
from cosim.system import System, require_system
from hybrid_model.declare.calls import explained
from hybrid_model.errors import SchedulingError
from hybrid_model.schedule.blocks import StiffPart
from hybrid_model.schedule.scheduler import Scheduler

if TYPE_CHECKING:
    from hybrid_model.schedule.joined_blocks import JoinedBlocks

ROUNDING = 1e-12
"""Relative rounding of the number of output intervals."""


@explained(CosimError)
@apart_from_the_rest()
def run_event_exact(
    system: System,
    t_stop: float,
    *,
    t_start: float = 0.0,
    output_interval: float | None = None,
    record_events: bool = False,
    inputs: Mapping[str, Given] | None = None,
    watch: Watch | None = None,
) -> CosimResult:
    """Run a system whose slaves exchange discrete signals only, each event at its exact time.

    Parameters
    ----------
    system : System
        Slaves with event mode; every connected input discrete.
    t_stop, t_start : float
        Times in s.
    output_interval : float, optional
        Record all outputs at multiples of this time; default: only at the end.
    record_events : bool
        With an output interval, record them also on both sides of each instant with events: before its first jump, and
        after its last one if that has changed an output. All slaves are stepped there for it.
    inputs : mapping, optional
        ``"slave.variable"`` -> number or `hybrid_model.Signal`, for inputs that nothing drives and tunable parameters.
        A signal is asked at the start and at its breakpoints, each of which is an event, and held between.
    watch : callable, optional
        Told of the run after each row; see `CosimResult.watch`.

    Returns
    -------
    CosimResult
        Events with their times, and the signals.

    Raises
    ------
    MisfitError
        If a connection carries a continuous signal, a slave has no event mode, or a name of `inputs` cannot be set.
    CosimError
        If a slave fails, or asks for event iterations without end.
    """
    require_system("run_event_exact", system)
    require_times(t_start, t_stop, output_interval, INTERVAL)
    _require_discrete(system)
    _refuse_curves(inputs or {})
    told = 0

    def tell(result: CosimResult) -> None:
        nonlocal told
        # A run that is made again tells what is new in it.
        if watch is not None and len(result.times) > told:
            told = len(result.times)
            watch(result)

    arguments = (system, (t_start, t_stop), output_interval, record_events, inputs or {}, tell)
    try:
        return _run(*arguments)
    except StiffPart:
        return _run(*arguments, in_python="a flow is stiff, and slaves change their methods on the way one by one")


def _run(
    system: System,
    span: tuple[float, float],
    output_interval: float | None,
    record_events: bool,
    inputs: Mapping[str, Given],
    watch: Watch,
    in_python: str = "",
) -> CosimResult:
    t_start, t_stop = span
    changes = Changes(system, inputs, t_start)
    treatment = {slave.name: exactly(slave) for slave in system.slaves.values()}
    result = CosimResult(t=t_start, watch=watch, treatment=treatment)

    def row(t: float) -> None:
        sample_change(system, result, t, system.output_names)

    at_events = row if record_events and output_interval is not None else None
    try:
        start_slaves(system, t_start, t_stop, events=True, changes=changes)
        scheduler, result.engine = queue_of(system, span, at_events, wanted=in_python)
        result.ticks, result.events = scheduler.ticks, scheduler.events
        scheduler.handle_events(t_start, system.slaves)
        if output_interval is not None:
            sample_end(system, result, t_start, system.output_names)
        _advance(scheduler, system, result, t_stop, output_interval, changes, at_events)
        if isinstance(scheduler, Scheduler):
            scheduler.bring_to_the_end()
        if scheduler.ended and output_interval is not None:
            sample_end(system, result, scheduler.ended[1], system.output_names)
        result.final = outputs(system)
        result.t, result.steps = scheduler.t, scheduler.steps
    except SchedulingError as error:
        raise CosimError(str(error)) from error
    finally:
        system.close()
    if scheduler.ended:
        result.terminate(*scheduler.ended)
    return result


def _advance(
    scheduler: Scheduler | JoinedBlocks,
    system: System,
    result: CosimResult,
    t_stop: float,
    output_interval: float | None,
    changes: Changes,
    watch: Callable[[float], None] | None,
) -> None:
    t_start = scheduler.t
    # A last point that rounding puts before the stop time is the stop time.
    count = 1 if output_interval is None else math.ceil((t_stop - t_start) / output_interval * (1.0 - ROUNDING))
    for k in range(1, count + 1):
        grid = t_stop if output_interval is None or k == count else t_start + k * output_interval
        _change_on_the_way(scheduler, system, grid, changes, watch)
        scheduler.advance_to(grid)
        if scheduler.ended:
            return
        if output_interval is not None:
            sample_end(system, result, grid, system.output_names)


def _change_on_the_way(
    scheduler: Scheduler | JoinedBlocks,
    system: System,
    limit: float,
    changes: Changes,
    watch: Callable[[float], None] | None,
) -> None:
    """Set what changes up to `limit` in s, each time as an event of the slaves concerned."""
    while not scheduler.ended and (due := changes.next_time(limit)) is not None:
        scheduler.approach(due)
        if scheduler.ended:
            return
        if watch:
            watch(due)
        changed = changes.take(due)
        for slave, names in changed.items():
            system.slaves[slave].enter_event_mode()
            changes.set(names, due)
        scheduler.handle_events(due, changed)
        if watch:
            watch(due)


def _refuse_curves(inputs: Mapping[str, Given]) -> None:
    curve = next((name for name, given in inputs.items() if isinstance(given, Curve)), None)
    if curve is not None:
        raise MisfitError(
            f"{curve} is given as a curve, but this master sets inputs at events only: use the fixed-step master, or "
            "give a Signal."
        )


def _require_discrete(system: System) -> None:
    for slave in system.slaves.values():
        if not slave.has_event_mode:
            other = "error-controlled" if slave.can_restore and slave.variable_step else "fixed-step"
            raise MisfitError(f"{slave.name} has no event mode: use the {other} master.")
        if not slave.variable_step:
            raise MisfitError(
                f"{slave.name} takes steps of one length only (canHandleVariableCommunicationStepSize is false), and "
                "events come at any distance: use the fixed-step master."
            )
    for connection in system.connections:
        port = system.slaves[connection.source].outputs[connection.output]
        if not port.discrete:
            raise MisfitError(
                f"{connection} carries a signal that changes along flows; this master exchanges signals at events "
                "only. Compose the two blocks to one, or use the error-controlled master or the fixed-step one."
            )

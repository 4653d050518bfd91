"""Run an automaton on the engine in C, or on the reference in Python where that one cannot run it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy.typing as npt

from hybrid_model.declare.arguments import (
    real_number,
    require_automaton,
    require_choice,
    require_inputs,
    require_options,
    require_starts,
)
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.signals import Inputs, InputValue
from hybrid_model.errors import BuildError, SimulationError, TraceError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.arc_values import ComputedValues
from hybrid_model.record.flow_piece import unseen
from hybrid_model.record.recording import Recording
from hybrid_model.record.run_record import RunRecord
from hybrid_model.reference.execution import Execution
from hybrid_model.reference.first_look import checked
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

_SOLVER, _ZENO = Solver(), ZenoGuard()
ENGINES = ("auto", "native", "python")
RECORDS = ("all", "events")


@explained(solver=Solver, zeno=ZenoGuard)
def simulate(
    automaton: Automaton,
    t_end: float,
    *,
    t_start: float = 0.0,
    inputs: Mapping[str, InputValue] | None = None,
    starts: Mapping[str, npt.ArrayLike] | None = None,
    solver: Solver | None = None,
    zeno: ZenoGuard | None = None,
    engine: str = "auto",
    record: str = "all",
) -> HybridArc:
    """Run an automaton from its start values.

    Parameters
    ----------
    automaton : Automaton
        What runs.
    t_end : float
        End time in s; jumps due at it are taken.
    t_start : float
        Start time in s.
    inputs : mapping, optional
        Input name -> number, array, function of time, or `Signal`.
        A function that jumps or has short pulses needs a `Signal` with its breakpoints: a plain one is looked at where
        the solver steps, and a pulse between two steps goes unseen.
        Tunable parameter -> number, array, or `Signal`: it
        takes the signal's value at the start and at each breakpoint, before the jumps of that instant, and holds it.
    starts : mapping, optional
        Name of a state, discrete state, input or parameter, tunable or not -> value in this run in place of the
        declared one. One automaton so serves many runs, and is compiled once. What declarations say stays: ranges,
        and whatever a map reads of them.
    solver : Solver, optional
        Method and accuracy.
    zeno : ZenoGuard, optional
        What counts as an accumulation of jumps.
    engine : {"auto", "native", "python"}
        The engine in C, which runs maps that are compiled, or the readable one in Python, which runs any. Default: the
        native one wherever it can; `HybridArc.engine` says which ran and why.
    record : {"all", "events"}
        What is kept: every step with its dense output, some ``8 * (3 + 9 * states)`` bytes each, or the jumps alone;
        then the states between two jumps are not in the result.

    Returns
    -------
    HybridArc
        The run on hybrid time; its `stop` and `message` say how it ended.

    Raises
    ------
    SimulationError
        For times that are not finite or reversed, for options of another type, for values that do not stay finite, and
        if ``engine="native"`` cannot run the automaton.
    DeclarationError
        If `automaton` is no instance of an automaton, or an input or a start value is unknown or has the wrong shape.
    """
    require_automaton("simulate", automaton)
    require_inputs(inputs)
    require_starts(starts)
    require_options("solver", solver, Solver, first="method")
    require_options("zeno", zeno, ZenoGuard, first="max_jumps")
    require_choice("engine", engine, ENGINES)
    require_choice("record", record, RECORDS)
    t_start, t_end = real_number("t_start", t_start), real_number("t_end", t_end)
    if not (math.isfinite(t_end) and t_end >= t_start):
        raise SimulationError(
            f"the end time is {t_end} s and the start {t_start} s: give a finite end after the start."
        )
    if not math.isfinite(t_start):
        raise SimulationError(f"the start time of {automaton.name} is {t_start}: give a finite number.")
    given = Inputs(layout_of(automaton), inputs, starts)
    solver, zeno = solver or _SOLVER, zeno or _ZENO
    why = 'python: it was asked for (engine="python").'
    if engine != "python":
        try:
            return HybridArc(_native_run(automaton, given, (t_start, t_end), solver, zeno, record))
        except (TraceError, BuildError) as error:
            why = f"python: {error}"
            if engine == "native":
                raise SimulationError(f"{automaton.name} cannot run on the native engine: {error}") from error
    return HybridArc(replace(_reference_run(automaton, given, (t_start, t_end), solver, zeno, record), engine=why))


def _native_run(
    automaton: Automaton,
    inputs: Inputs,
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
    record: str,
) -> RunRecord:
    # CasADi is imported by whoever runs something, and not by all who import the package.
    from hybrid_model.native.simulation import native_run

    def check() -> None:
        # Slips in maps are told as the author wrote them, not as they are traced.
        checked(Execution(automaton, t_start=span[0], t_stop=span[1], inputs=inputs, solver=solver, zeno=zeno))

    return native_run(automaton, inputs, span, solver, zeno, events_only=record == "events", check=check)


def _reference_run(
    automaton: Automaton,
    inputs: Inputs,
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
    record: str,
) -> RunRecord:
    t_end = span[1]
    execution = Execution(automaton, t_start=span[0], t_stop=t_end, inputs=inputs, solver=solver, zeno=zeno)
    recording = Recording(execution.t, execution.j, execution.x, execution.z, inputs.held)
    # Lines 2 to 5 of the algorithm in docs/semantics.md.
    while execution.stopped is None:
        index = execution.due()
        if index is not None:
            recording.jumped(execution.jump(index))
        elif execution.t >= t_end and execution.in_flow_set():
            execution.stop(Stop.HORIZON, f"reached t = {t_end:.9g} s.")
        else:
            pieces = execution.flow(t_end)
            recording.flowed(pieces if record == "all" else unseen(pieces))
    read = ComputedValues(automaton, execution.inputs)
    stop, message = execution.stopped, execution.message
    return RunRecord(read, recording.flows, recording.jumps, stop, message, execution.event_tolerance)

"""Run an automaton: alternate jumps and flows until the end time or until it cannot go on."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hybrid_model.declare.arguments import real_number, require_automaton, require_inputs, require_options
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.signals import Inputs, InputValue
from hybrid_model.errors import SimulationError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.arc_values import ComputedValues
from hybrid_model.record.recording import Recording
from hybrid_model.record.run_record import RunRecord
from hybrid_model.reference.execution import Execution
from hybrid_model.reference.zeno import ZenoGuard
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop


@explained(solver=Solver, zeno=ZenoGuard)
def simulate(
    automaton: Automaton,
    t_end: float,
    *,
    t_start: float = 0.0,
    inputs: Mapping[str, InputValue] | None = None,
    solver: Solver | None = None,
    zeno: ZenoGuard | None = None,
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
    solver : Solver, optional
        Method and accuracy.
    zeno : ZenoGuard, optional
        What counts as an accumulation of jumps.

    Returns
    -------
    HybridArc
        The run on hybrid time; its `stop` and `message` say how it ended.

    Raises
    ------
    SimulationError
        For times that are not finite or reversed, for options of another type, and for values that do not stay finite.
    DeclarationError
        If `automaton` is no instance of an automaton, or an input is unknown or has the wrong shape.
    """
    require_automaton("simulate", automaton)
    require_inputs(inputs)
    require_options("solver", solver, Solver, first="method")
    require_options("zeno", zeno, ZenoGuard, first="max_jumps")
    t_start, t_end = real_number("t_start", t_start), real_number("t_end", t_end)
    if not (math.isfinite(t_end) and t_end >= t_start):
        raise SimulationError(
            f"the end time is {t_end} s and the start {t_start} s: give a finite end after the start."
        )
    execution = Execution(
        automaton, t_start=t_start, t_stop=t_end, inputs=Inputs(Layout(automaton), inputs), solver=solver, zeno=zeno
    )
    recording = Recording(execution.t, execution.j, execution.x, execution.z, execution.inputs.held)
    # Lines 2 to 5 of the algorithm in docs/semantics.md.
    while execution.stopped is None:
        index = execution.due()
        if index is not None:
            recording.jumped(execution.jump(index))
        elif execution.t >= t_end and execution.in_flow_set():
            execution.stop(Stop.HORIZON, f"reached t = {t_end:.9g} s.")
        else:
            recording.flowed(execution.flow(t_end))
    read = ComputedValues(automaton, execution.inputs)
    stop, message = execution.stopped, execution.message
    return HybridArc(RunRecord(read, recording.flows, recording.jumps, stop, message, execution.event_tolerance))

"""Runs of automata on the engine in C."""

from __future__ import annotations

from collections.abc import Callable

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import SimulationError, TraceError
from hybrid_model.native.driven import Driven, drive, given_on
from hybrid_model.native.kept_models import model_of, what_ran
from hybrid_model.native.run import Advance, Ending, NativeRun, Options, Record
from hybrid_model.record.arc_values import ComputedValues
from hybrid_model.record.row_flows import RowFlows, RowJumps
from hybrid_model.record.run_record import RunRecord
from hybrid_model.scales import one_instant
from hybrid_model.solver import Method, Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

STEPS_AT_ONCE = 20_000
"""After so many steps a run of a few states comes back, so that it can be interrupted; of many states, after fewer."""
_STATES = 4
"""So many are few."""

FOLLOWED = "native: its maps are compiled, together with the functions of time that its inputs are."
FOR_STIFF_FLOWS = (Method.RADAU, Method.BDF)
_STOPS = {Ending.ZENO: Stop.ZENO, Ending.BLOCKED: Stop.BLOCKED, Ending.JUMPS: Stop.JUMPS}


def native_run(
    automaton: Automaton,
    inputs: Inputs,
    span: tuple[float, float],
    solver: Solver,
    zeno: ZenoGuard,
    *,
    events_only: bool,
    check: Callable[[], None],
) -> RunRecord:
    """Run an automaton.

    Parameters
    ----------
    automaton, inputs, solver, zeno
        See `hybrid_model.simulate.simulate`.
    span : (float, float)
        Start and end in s.
    events_only : bool
        Whether to keep the jumps alone.
    check : callable
        Called before an automaton is traced; what it raises is raised.

    Raises
    ------
    TraceError
        If the native engine cannot run it: for what the maps do, the inputs are, or the solver wants.
    BuildError
        If there is no compiler, or it fails.
    SimulationError
        If the run cannot start or go on.
    """
    require_supported(solver)
    record, stiff = Record.JUMPS if events_only else Record.ALL, solver.method in FOR_STIFF_FLOWS
    for again in (False, True):
        driven = drive(inputs, span) if inputs.vary else None
        model = model_of(automaton, check, stiff=stiff, driven=driven)
        run = NativeRun(model)
        set_options(run, solver, zeno, inputs.layout.sizes[Kind.STATE])
        ended = _Driver(run, inputs, driven).run(span, record)
        # From the start, with the derivatives that another method needs: so the first run is as all later ones.
        stiff = run.shows_stiffness
        if model.stiff or not stiff or again:
            break
    message = f"{automaton.name}: {run.message if ended else f'reached t = {span[1]:.9g} s.'}"
    if ended and run.ending not in _STOPS:
        raise SimulationError(message)
    stop = _STOPS[run.ending] if ended else Stop.HORIZON
    if stop is Stop.JUMPS:
        message = f"{message} {stop.value}"
    tolerance = solver.event_tolerance
    rows = run.rows(events_only=events_only)
    return RunRecord(
        ComputedValues(automaton, inputs, None if driven else model.outputs),
        RowFlows(rows),
        RowJumps(rows),
        stop,
        message,
        one_instant(run.time, span[0], span[0]) if tolerance is None else tolerance,
        engine=what_ran(automaton) if driven is None else FOLLOWED,
        statistics=run.statistics,
    )


class _Driver:
    """Takes a run from breakpoint to breakpoint of its inputs."""

    def __init__(self, run: NativeRun, inputs: Inputs, driven: Driven | None) -> None:
        self._run, self._inputs, self._driven = run, inputs, driven

    def run(self, span: tuple[float, float], record: Record) -> bool:
        """Run from the start of a span to its end; return whether the run is over before."""
        inputs, (start, end) = self._inputs, span
        ends = [*inputs.breakpoints_in(start, end), end]
        u, p = self._outside(start, ends)
        over = not self._run.start([inputs.start(Kind.STATE), inputs.start(Kind.DISCRETE), u, p], start, end, record)
        for k, time in enumerate(ends[:-1]):
            if over or self._goes_on_to(time, take=False):
                return True
            self._change(*self._outside(time, ends[k + 1 : k + 3]))
        return over or self._goes_on_to(end, take=True)

    def _outside(self, a: float, ends: list[float]) -> tuple[FloatArray, FloatArray]:
        """Return inputs and parameters from `a` to the first of the ends of pieces that come."""
        return given_on(self._inputs, self._driven, a, ends[0], closed=len(ends) == 1)

    def _goes_on_to(self, time: float, *, take: bool) -> bool:
        """Go on to a time; return whether the run is over."""
        advance = Advance.PAUSED
        while advance is Advance.PAUSED and not (self._run.shows_stiffness and not self._run.model.stiff):
            advance = self._run.advance(time, take=take)
        return advance in (Advance.ENDED, Advance.PAUSED)

    def _change(self, u: FloatArray, p: FloatArray) -> None:
        for kind, values in ((Kind.INPUT, u), (Kind.PARAMETER, p)):
            for index, value in enumerate(values):
                self._run.set(kind, index, float(value))


def require_supported(solver: Solver) -> None:
    """Raise TraceError for what a solver is asked for and the native engine does not do."""
    if solver.method not in (Method.DOP853, Method.RK45, *FOR_STIFF_FLOWS):
        raise TraceError(f"the native engine does not step with {solver.stepper.__name__}.")
    if solver.scan_points != Solver.scan_points:
        raise TraceError(f"the native engine looks at {Solver.scan_points} points of a step: leave scan_points out.")


def set_options(run: NativeRun, solver: Solver, zeno: ZenoGuard, states: int) -> None:
    """Give a run of so many states, which has not begun, its accuracy and what counts as an accumulation of jumps.

    Raises
    ------
    TraceError
        If the solver wants a method for stiff flows that there is none of for the model.
    """
    if solver.method in FOR_STIFF_FLOWS and not run.can_be_stiff:
        raise TraceError(
            f"the native engine has no method for a stiff flow of a network of {states} states, whose derivatives "
            "would be a full matrix."
        )
    fill_options(run.options, solver, zeno, states)


def fill_options(options: Options, solver: Solver, zeno: ZenoGuard, states: int) -> None:
    """Write the same into the options of an engine."""
    options.relative_tolerance = solver.rtol
    options.absolute_tolerance = solver.atol or 0.0
    options.longest_step = solver.max_step
    options.event_tolerance = solver.event_tolerance or 0.0
    options.jumps_at_once, options.jumps_in_window = zeno.jumps_at_once, zeno.jumps_in_window
    options.spread = zeno.spread
    options.window = -1.0 if zeno.window is None else zeno.window
    options.remainder = -1.0 if zeno.remainder is None else zeno.remainder
    options.most_jumps = zeno.max_jumps
    options.steps_at_once, options.pauses = max(1, STEPS_AT_ONCE * _STATES // max(states, _STATES)), 1.0
    options.stiff = float(solver.method in FOR_STIFF_FLOWS)

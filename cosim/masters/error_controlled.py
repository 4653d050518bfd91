"""The master for continuous signals between slaves: macro steps with error control, events located on top."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from cosim.errors import CosimError, MisfitError, TimesError
from cosim.feedthrough import refuse_loops
from cosim.masters.changes import Changes, Given
from cosim.masters.event_iteration import Handled, iterate_events
from cosim.masters.macro_step import SEEN, MacroSteps, Outcome, States
from cosim.masters.signal_sizes import SignalSizes
from cosim.masters.start import (
    INTERVAL,
    MOST_STEPS,
    outputs,
    require_times,
    sample_change,
    sample_end,
    start_slaves,
)
from cosim.masters.treatments import with_rollback
from cosim.replayed_slave import ReplayedSlave
from cosim.result import CosimResult, Watch
from cosim.system import System, require_system
from hybrid_model.declare.calls import explained
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import STOPPED, Event

TOLERANCE = 1e-9
"""Error of a macro step, as a part of the largest value that each signal has had."""
AHEAD = 1e-10
"""Part of the time by which the row before a jump is before it: FMUs take jumps that are just behind a step in it."""
RESOLUTION = 1e-13
"""Of times of events, as a part of the run."""
AT_ONE_TIME = 100
"""Instants with events in a row, without a step between them, at most."""
RECEIVED = "received"
"""Of an event: what a slave received at that instant brought it about."""
FIRST = 1e-3
"""First macro step, as a part of the run."""
SAFETY, LEAST, MOST, ORDER = 0.9, 0.2, 5.0, 3
"""Of the step size control: factors, and the order of the local error."""
SURPRISE = 1e4
"""How far signals may be from what was expected of them, in tolerances."""
_QUIET, _ROUNDING = 2, 1e-12


@explained(CosimError)
def run_error_controlled(
    system: System,
    t_stop: float,
    *,
    t_start: float = 0.0,
    tolerance: float = TOLERANCE,
    output_interval: float | None = None,
    record_events: bool = True,
    inputs: Mapping[str, Given] | None = None,
    watch: Watch | None = None,
) -> CosimResult:
    """Run a system whose slaves exchange continuous signals, with macro steps of the length that their accuracy needs.

    Each macro step is made once as a whole and once in two halves; half of the difference bounds its error, and a step
    that is too far off is taken back (Schierz, Arnold and Clauss, 9th Modelica Conference, 2012: error estimate by
    Richardson's extrapolation and rollback). Where a slave has an event, all return to the start of the step, and the
    event is enclosed by shorter ones (Broman et al., EMSOFT 2013: rollback to where the first slave stops); then all
    handle it at one instant.

    Parameters
    ----------
    system : System
        Slaves that take steps of any length. Those that cannot save and restore their state (canGetAndSetFMUState)
        return to an earlier one by making their run again from the start. Those with event mode stop at their events;
        of others an event is seen by what it changes, and enclosed alike.
    t_stop, t_start : float
        Times in s.
    tolerance : float
        Error of each macro step, as a part of the largest value that each signal has had, and at least of a hundredth
        of its nominal value, where it declares one.
    output_interval : float, optional
        Record all outputs at multiples of this time in s; default: only at the end.
    record_events : bool
        With an output interval, record them also on both sides of each instant with events.
    inputs : mapping, optional
        ``"slave.variable"`` -> number, `hybrid_model.Signal` or `Curve`, for inputs that nothing drives and tunable
        parameters.
    watch : callable, optional
        Told of the run after each row; see `CosimResult.watch`.

    Returns
    -------
    CosimResult

    Raises
    ------
    MisfitError
        If a slave takes steps of one length only.
    TimesError
        If the times or the tolerance make no sense.
    CosimError
        If a slave fails, gets no further, or the signals between slaves form a loop without a state.
    """
    require_system("run_error_controlled", system)
    require_times(t_start, t_stop, output_interval, INTERVAL)
    if not 0.0 < tolerance < 1.0:
        raise TimesError(f"the tolerance is {tolerance}: give a number between 0 and 1, such as 1e-9.", "tolerance")
    refuse_loops(system)
    system = _with_rollback(system)
    changes = Changes(system, inputs or {}, t_start)
    result = CosimResult(t=t_start, watch=watch)
    try:
        start_slaves(system, t_start, t_stop, events=None, changes=changes)
        run = _Run(system, changes, result, (t_start, t_stop), tolerance, output_interval if record_events else None)
        run.begin()
        if output_interval is not None:
            sample_end(system, result, t_start, system.output_names)
        count = 1 if output_interval is None else math.ceil((t_stop - t_start) / output_interval * (1.0 - _ROUNDING))
        for k in range(1, count + 1):
            grid = t_stop if output_interval is None or k == count else t_start + k * output_interval
            run.advance_to(grid)
            if output_interval is not None:
                sample_end(system, result, result.t, system.output_names)
            if run.ended:
                break
        result.final = outputs(system)
    finally:
        system.close()
    result.steps = run.macro.steps
    if run.ended:
        result.terminate(*run.ended)
    return result


def _with_rollback(system: System) -> System:
    rigid = next((slave for slave in system.slaves.values() if not slave.variable_step), None)
    if rigid is not None:
        raise MisfitError(
            f"{rigid.name} takes steps of one length only (canHandleVariableCommunicationStepSize is false): use the "
            "fixed-step master."
        )
    return system.with_slaves({n: ReplayedSlave(s) for n, s in system.slaves.items() if not s.can_restore})


class _Run:
    """A run under way: where it is, its macro step, the events so far."""

    def __init__(
        self,
        system: System,
        changes: Changes,
        result: CosimResult,
        span: tuple[float, float],
        tolerance: float,
        rows: float | None,
    ) -> None:
        self._system, self._changes, self._result = system, changes, result
        self._tolerance, self._rows = tolerance, rows is not None
        self._t_start, self._t_stop = span
        length = span[1] - span[0]
        self._resolution = max(RESOLUTION * length, 16.0 * math.ulp(max(abs(span[0]), abs(span[1]))))
        self._h = FIRST * length
        self._sizes, self._widths = SignalSizes((), ()), SignalSizes((), ())
        self._at_one_time = 0
        self._until, self._who, self._quiet = math.inf, "", _QUIET
        self.ended: tuple[str, float, Termination] | None = None
        self.macro: MacroSteps
        result.treatment = {
            name: with_rollback(slave, again=isinstance(slave, ReplayedSlave)) for name, slave in system.slaves.items()
        }

    def begin(self) -> None:
        """Handle the events of the start."""
        t, slaves = self._t_start, self._system.slaves
        self.macro = macro = MacroSteps(self._system, self._changes, t, self._t_stop, self._resolution)
        for name in macro.overlook_restless():
            self._result.treatment[self._system.output(name)[0].name] += (
                f"; {name}, which each step changes, tells of none"
            )
        first = [name for name, slave in slaves.items() if slave.stops_after_events]
        self._go_on(t, iterate_events(self._system, self._result, t, lambda: first, macro.settle, entered=True))
        self._sizes = SignalSizes(macro.nominal_outputs, macro.observe())
        self._widths = SignalSizes(macro.nominal_signals, macro.history.last)

    def advance_to(self, limit: float) -> None:
        """Go on to `limit` in s, or to the end of the run."""
        result = self._result
        for _ in range(MOST_STEPS):
            due = None if self.ended else self._changes.next_time(limit)
            if self.ended or (due is None and result.t >= limit):
                return
            goal = limit if due is None else max(due, result.t)
            if goal > result.t + (0.0 if due is None else self._resolution):
                self._step(min(goal, self._until, *self.macro.announced.values()))
            elif due is not None:
                self._happen(goal, {})
        raise CosimError(f"{self._names()} got no further than t = {result.t:.12g} s in {MOST_STEPS} macro steps.")

    def _step(self, goal: float) -> None:
        """Make one macro step towards `goal` in s, as long as the accuracy allows, if nothing is in the way.

        A slave with continuous inputs stops where it has its event with the inputs of that step, which are not those of
        the moment. So steps are halved until their length tells nothing; a slave without any is believed at once.
        """
        t, macro, left = self._result.t, self.macro, goal - self._result.t
        whole_way = macro.meet_at_events or self._h >= left * (1.0 - 1e-9)
        h = left if whole_way else min(self._h, max(0.5 * left, 0.1 * self._h))
        middle, end = t + 0.5 * h, t + h if h < left else goal
        states, history = macro.save(), macro.history.copy()
        try:
            before = macro.observe()
            outcome, values = self._attempt(t, end)
            if h <= 2.0 * self._resolution:
                outcome.due |= dict.fromkeys(self._jumped(before) - set(outcome.due), SEEN)
                self._row_before(states, t, end, outcome)
                # Where nothing was in the way the accuracy was: signals that rise from zero are all surprise there.
                self._h = MOST * h
                self._arrive(end, values, outcome)
                return
            if macro.meet_at_events and (outcome.quiet or outcome.believed):
                self._row_before(states, t, end, outcome)
                self._arrive(end, values, outcome)
                return
            if outcome.quiet or outcome.believed:
                whole = macro.observe()
                macro.restore(states)
                outcome, values = self.macro.attempt(t, middle)
                if outcome.quiet:
                    macro.history.add(middle, values, macro.slopes())
                    outcome, values = self._attempt(middle, end)
                    if (outcome.quiet or outcome.believed) and self._is_accurate(whole, end, values, h, outcome.due):
                        self._row_before(states, t, end, outcome)
                        self._arrive(end, values, outcome)
                        return
                elif outcome.believed:
                    outcome = Outcome(early=middle, exact=True)
            macro.restore(states)
            macro.history = history
            self._shorten(t, h, outcome)
        finally:
            macro.release(states)

    def _attempt(self, t: float, t_next: float) -> tuple[Outcome, list[float]]:
        """Step all slaves, with the event at the end that one without event mode had ended another step after."""
        outcome, values = self.macro.attempt(t, t_next)
        if t_next >= self._until and outcome.early is None and self._system.slaves[self._who].stops_after_events:
            outcome.due.setdefault(self._who, STOPPED)
            outcome.exact = True
        return outcome, values

    def _is_accurate(self, whole: list[float], end: float, values: list[float], h: float, due: Collection[str]) -> bool:
        """Return whether a step in two halves is accurate, and choose the length of the next one.

        Signals of slaves without event mode that have events at its end have jumped there.
        """
        halves, signals = np.array(self.macro.observe(), dtype=np.float64), np.array(values, dtype=np.float64)
        # Of second order: the error of the halves is a third of the difference.
        error = np.abs(np.array(whole) - halves) / (3.0 * self._tolerance * self._sizes.beside(halves))
        # A signal that has jumped on the way is far from what was expected, whoever has felt it.
        surprise = np.abs(self.macro.history.at(end) - signals) / self._widths.beside(signals)
        surprise[[name in due and not self._system.slaves[name].has_event_mode for name in self.macro.senders]] = 0.0
        worst = float(max(np.max(error, initial=0.0), np.max(surprise, initial=0.0) / (SURPRISE * self._tolerance)))
        factor = MOST if worst == 0.0 else SAFETY * worst ** (-1.0 / ORDER)
        if worst > 1.0:
            self._h = h * min(max(factor, LEAST), 1.0)
            self._sizes.foresee(end, halves)
            self._widths.foresee(end, signals)
            return False
        self._sizes.take(end, halves)
        self._widths.take(end, signals)
        self._quiet += 1
        if self._quiet > _QUIET:
            self._h = max(self._h if h < self._h else 0.0, h * min(max(factor, LEAST), MOST))
        return True

    def _jumped(self, before: list[float]) -> set[str]:
        """Return the slaves without event mode whose outputs are others after a step of no length to speak of."""
        change = np.abs(np.array(self.macro.observe()) - np.array(before))
        jumps = change > self._tolerance * self._sizes.beside(np.zeros_like(change))
        names = {self.macro.owners[k] for k in np.flatnonzero(jumps)}
        return {name for name in names if not self._system.slaves[name].has_event_mode}

    def _shorten(self, t: float, h: float, outcome: Outcome) -> None:
        """Choose the next step after one that had something in its way, or was not accurate."""
        if outcome.early is not None and outcome.exact:
            if outcome.early <= t:  # one event right after another
                self._happen(t, {outcome.stopped: STOPPED})
                return
            self._until, self._who = outcome.early, outcome.stopped
        elif not outcome.quiet:
            self._h, self._quiet = 0.5 * h, 0
            if outcome.stopped and self._system.slaves[outcome.stopped].stops_after_events:
                self.macro.near[outcome.stopped] = t + h

    def _arrive(self, t: float, values: list[float], outcome: Outcome) -> None:
        """Take a step that was made, and handle the events at its end."""
        self._result.t = t
        if t >= self._until:
            self._until = math.inf
        if outcome.pending:
            # The next step shows the jump.
            self._h = self._resolution
        if outcome.ended:
            self.ended = outcome.ended
        elif not outcome.due and outcome.early is None:
            self._at_one_time = 0
            self.macro.insisting.clear()
            self.macro.history.add(t, values, self.macro.slopes())
        else:
            self._happen(t, outcome.due or {outcome.stopped: STOPPED}, outcome.held)
            self._h, self._quiet = max(0.1 * self._h, 10.0 * self._resolution), _QUIET

    def _happen(self, t: float, due: dict[str, str], held: Collection[str] = ()) -> None:
        """Handle the events at `t` in s, by slave with how they became known; of those that are `held` first."""
        result, system = self._result, self._system
        self._at_one_time += 1
        if self._at_one_time > AT_ONE_TIME:
            raise CosimError(f"{' and '.join(sorted(due))} gets no further than t = {t:.12g} s.")
        result.t = t
        if self._rows and self._changes.next_time(t) is not None and (not result.times or result.times[-1] < t):
            self.macro.exchange(t, before=True)
        self._row(t)
        for name in due:
            self.macro.near.pop(name, None)
        if self._who in due:  # it may have taken the event that it named a little before
            self._until = math.inf
        before = len(result.ticks)
        handled = iterate_events(system, result, t, lambda: self._changes.arrive(t), self.macro.settle, held=held)
        self._go_on(t, handled)
        # A slave may stop where its event is about to come, and names times at which there may be none.
        kinds = {name: kind for name, kind in due.items() if name not in handled.idle and not self._is_to_come(name, t)}
        self.macro.insisting = {name for name in due if name not in kinds and system.slaves[name].has_event_mode}
        kinds = {tick.slave: RECEIVED for tick in result.ticks[before:]} | kinds
        result.events += [Event(t, name, kinds[name]) for name in system.slaves if name in kinds]
        self._row(t)

    def _is_to_come(self, name: str, t: float) -> bool:
        return not self.ended and self.macro.is_to_come(name, t)

    def _go_on(self, t: float, handled: Handled) -> None:
        """Begin anew after the events at `t` in s."""
        self.ended = handled.ended
        if not self.ended:
            self.macro.announced = handled.announced
            self.macro.history.forget(t, self.macro.signals(t), self.macro.slopes())
            self.macro.remember()

    def _row_before(self, states: States, t: float, end: float, outcome: Outcome) -> None:
        """Keep the row before the jumps that slaves without event mode have made in the step from `t` to `end`, in s.

        All go back to the states that they had at `t`, and as far as next to the jumps.
        """
        inside = any(not self._system.slaves[name].has_event_mode for name in outcome.due)
        # What is run again from the start cannot come back to a state that is later.
        again = any(isinstance(slave, ReplayedSlave) for slave in self._system.slaves.values())
        if not (self._rows and inside) or again or outcome.ended:
            return
        macro = self.macro
        made = macro.save()
        try:
            macro.restore(states)
            near = end - max(self._resolution, AHEAD * abs(end))
            if end - t > 2.0 * self._resolution and near > t:
                self.macro.attempt(t, near)
            self._row(end)
        finally:
            macro.restore(made)
            macro.release(made)

    def _row(self, t: float) -> None:
        if self._rows:
            sample_change(self._system, self._result, t, self._system.output_names)

    def _names(self) -> str:
        return ", ".join(self._system.slaves)

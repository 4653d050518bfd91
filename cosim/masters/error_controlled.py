"""The master for continuous signals between slaves: macro steps with error control, events located on top."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from cosim.errors import CosimError, MisfitError, TimesError
from cosim.feedthrough import refuse_loops
from cosim.masters.changes import Changes, Given
from cosim.masters.enclosure import Enclosure
from cosim.masters.event_iteration import Handled, iterate_events
from cosim.masters.macro_step import BEYOND, NEVER, SEEN, MacroSteps, Outcome, States
from cosim.masters.signal_sizes import SignalSizes
from cosim.masters.start import INTERVAL, MOST_STEPS, outputs, require_times, sample_end, start_slaves
from cosim.masters.treatments import with_rollback
from cosim.replayed_slave import ReplayedSlave
from cosim.result import CosimResult, Watch
from cosim.system import System, require_system
from hybrid_model.declare.calls import explained
from hybrid_model.scales import ROUNDINGS
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import RECEIVED, STOPPED, Event

TOLERANCE = 1e-9
"""Error of a macro step, as a part of the largest value that each signal has had."""
AHEAD = 1e-10
"""Part of the time by which the row before a jump is before it: FMUs take jumps that are just behind a step in it."""
RESOLUTION = 1e-13
"""Of times of events, as a part of the run."""
AT_ONE_TIME = 100
"""Instants with events in a row, without a step between them, at most."""
LATEST = 1000
"""So many resolutions later is the stop time that slaves are told that handle at it what they receive."""
SHORT = 0.1
"""A step that is shorter than this part of one that was accurate is so too."""
FIRST = 1e-3
"""First macro step, as a part of the run."""
SAFETY, LEAST, MOST, ORDER = 0.9, 0.2, 5.0, 3
"""Of the step size control: factors, and the order of the local error."""
LEAST_FIRST = 1e-3
"""The same factor after an event."""
SURPRISE = 1e4
"""How far signals may be from what was expected of them, in tolerances."""
FAR_OFF = 100.0
"""How many times as far they are at least where a step in two halves need not be tried."""
STAYS = 0.5
"""Part of that which is left in a step of half the length, at least, if they have jumped."""
AFTER = 0.1
"""The first step after an event, as a part of the one before."""
FIRST_ERROR = 0.01
"""Part of the tolerance that the first step after an event may take: signals are expected to stand still in it."""
_ROUNDING = 1e-12


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
    run = _Run(system, changes, result, (t_start, t_stop), tolerance, output_interval if record_events else None)
    try:
        start_slaves(system, t_start, t_stop, events=None, changes=changes, latest=run.latest)
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
        run.keep_row()
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
        self._enclosure, self._verified, self._off = Enclosure(self._resolution), 0.0, 0.0
        self._at_one_time = 0
        self._last_row: tuple[float, list[Any]] | None = None
        # What slaves that handle events inside receive at the stop time they handle in a step of no length.
        asked = {wire.target for wire in system.connections} | changes.receivers
        later = span[1] + max(LATEST * self._resolution, 2.0 * BEYOND * abs(span[1]))
        self.latest = {n: later for n in asked if not system.slaves[n].has_event_mode}
        self.ended: tuple[str, float, Termination] | None = None
        self.macro: MacroSteps
        self._read_all: Callable[[], list[Any]]
        result.treatment = {
            name: with_rollback(slave, again=isinstance(slave, ReplayedSlave)) for name, slave in system.slaves.items()
        }

    def begin(self) -> None:
        """Handle the events of the start."""
        t, slaves = self._t_start, self._system.slaves
        self._read_all = self._system.reader(self._system.output_names)
        self.macro = macro = MacroSteps(self._system, self._changes, t, self._t_stop, self._resolution, self.latest)
        for name in macro.overlook_restless():
            self._result.treatment[self._system.output(name)[0].name] += (
                f"; {name}, which each step changes, tells of none"
            )
        first = [name for name, slave in slaves.items() if slave.stops_after_events]
        self._go_on(t, iterate_events(self._system, self._result, t, lambda: first, macro, entered=True))
        self._sizes = SignalSizes(macro.nominal_outputs, macro.observe())
        self._widths = SignalSizes(macro.nominal_signals, macro.history.last)

    def advance_to(self, limit: float) -> None:
        """Go on to `limit` in s, or to the end of the run."""
        result = self._result
        for _ in range(MOST_STEPS):
            due = None if self.ended else self._changes.next_time(limit)
            if self.ended or (due is None and result.t >= limit):
                self.keep_row()
                return
            goal = limit if due is None else max(due, result.t)
            if goal > result.t + (0.0 if due is None else self._resolution):
                self._step(min(goal, _first((self.macro.named[0], *self.macro.announced.values()))))
            elif due is not None:
                self._happen(goal, {})
        raise CosimError(f"{self._names()} got no further than t = {result.t:.12g} s in {MOST_STEPS} macro steps.")

    def _step(self, goal: float) -> None:
        """Make one macro step towards `goal` in s, as long as the accuracy allows, if nothing is in the way.

        A slave with continuous inputs stops where it has its event with the inputs of that step, which are not those of
        the moment. So its event is enclosed by ever shorter steps, until their length tells nothing; a slave without
        any is believed at once.
        """
        t, macro, left = self._result.t, self.macro, goal - self._result.t
        whole_way = macro.meet_at_events or self._h >= left * (1.0 - 1e-9)
        h = left if whole_way else min(self._h, max(0.5 * left, 0.1 * self._h))
        end = self._enclosure.aim(t, t + h if h < left else goal)
        states = macro.save()
        try:
            before = macro.observe()
            outcome, values = macro.attempt(t, end)
            if end - t <= 2.0 * self._resolution:
                outcome.due |= dict.fromkeys(self._jumped(before) - set(outcome.due), SEEN)
                if not self._enclosure.active:
                    # Where nothing was in the way the accuracy was: signals that rise from zero are all surprise there.
                    self._h = MOST * (end - t)
            elif not (outcome.quiet or outcome.believed):
                macro.restore(states)
                self._go_back(t, end, outcome)
                return
            elif not macro.meet_at_events:
                made = self._held_to(states, t, end, outcome, values)
                if made is None:
                    return
                outcome, values = made
            self._row_before(states, t, end, outcome)
            self._arrive(end, values, outcome)
        finally:
            macro.release(states)

    def _held_to(
        self, states: States, t: float, end: float, outcome: Outcome, values: list[float]
    ) -> tuple[Outcome, list[float]] | None:
        """Make a step again in two halves, if there is reason to, and return what they gave; None if all go back.

        Parameters
        ----------
        states : States
            At `t`.
        t, end : float
            In s.
        outcome, values : Outcome, list of float
            What the step as a whole gave, with nothing in its way.
        """
        macro, middle, history = self.macro, 0.5 * (t + end), self.macro.history
        whole, off = macro.observe(), self._surprise(end, values, outcome.due)
        if off <= 1.0 and end - t <= SHORT * self._verified:
            self._take_sizes(end, values)
            return outcome, values
        if self._has_jumped(off):
            self._enclosure.missed(t, end, None)
            macro.restore(states)
            return None
        macro.restore(states)
        macro.history = history.copy()
        halves, values = macro.attempt(t, middle)
        reached, failed = middle, halves
        if halves.quiet:
            macro.history.add(middle, values, macro.slopes())
            halves, values = macro.attempt(middle, end)
            reached, failed = end, halves
            if (halves.quiet or halves.believed) and self._is_accurate(whole, t, end, values, halves.due):
                return halves, values
        elif halves.believed:
            failed = Outcome(early=middle, sure={""})
        macro.restore(states)
        macro.history = history
        if not (halves.quiet or halves.believed) or failed is not halves:
            self._go_back(t, reached, failed)
        return None

    def _has_jumped(self, off: float) -> bool:
        """Return whether signals came to where nobody expected them, `off` times as far off as they may be, by a jump.

        What has jumped is as far off in a step of half the length, and what flows is not.
        """
        jumped = self.macro.history.is_long and off > max(FAR_OFF, STAYS * self._off)
        self._off = off if jumped else 0.0
        return jumped

    def _surprise(self, end: float, values: list[float], due: Collection[str]) -> float:
        """Return how far signals are from what was expected of them at `end` in s, as a part of what is let pass.

        A signal that has jumped on the way is far off, whoever has felt it. Those of slaves without event mode that
        have events at the end have jumped there.
        """
        signals = np.array(values, dtype=np.float64)
        off = np.abs(self.macro.history.at(end) - signals) / self._widths.beside(signals)
        off[[name in due and not self._system.slaves[name].has_event_mode for name in self.macro.senders]] = 0.0
        return float(np.max(off, initial=0.0)) / (SURPRISE * self._tolerance)

    def _is_accurate(self, whole: list[float], t: float, end: float, values: list[float], due: Collection[str]) -> bool:
        """Return whether a step in two halves is accurate, and choose the length of the next one."""
        halves, h = np.array(self.macro.observe(), dtype=np.float64), end - t
        # Of second order: the error of the halves is a third of the difference.
        tolerance = self._tolerance * (1.0 if self._verified else FIRST_ERROR)
        error = np.abs(np.array(whole) - halves) / (3.0 * tolerance * self._sizes.beside(halves))
        worst = max(float(np.max(error, initial=0.0)), self._surprise(end, values, due))
        if worst > 1.0:
            self._shrink(t, end, values, worst)
            return False
        self._take_sizes(end, values)
        self._verified = h
        self._h = max(self._h if h < self._h else 0.0, h * min(max(_factor(worst), LEAST), MOST))
        return True

    def _shrink(self, t: float, end: float, values: list[float], worst: float) -> None:
        """Choose the next step after one from `t` to `end`, in s, that was `worst` times as far off as it may be."""
        # The first error after an event is of one order less, and nothing is known of how long a step may be.
        factor = max(_factor(worst), LEAST) if self._verified else max(_factor(worst, ORDER - 1), LEAST_FIRST)
        self._h = (end - t) * min(factor, 1.0)
        self._sizes.foresee(end, np.array(self.macro.observe(), dtype=np.float64))
        self._widths.foresee(end, np.array(values, dtype=np.float64))

    def _take_sizes(self, end: float, values: list[float]) -> None:
        self._sizes.take(end, np.array(self.macro.observe(), dtype=np.float64))
        self._widths.take(end, np.array(values, dtype=np.float64))

    def _jumped(self, before: list[float]) -> set[str]:
        """Return the slaves without event mode whose outputs are others after a step of no length to speak of."""
        change = np.abs(np.array(self.macro.observe()) - np.array(before))
        jumps = change > self._tolerance * self._sizes.beside(np.zeros_like(change))
        names = {self.macro.owners[k] for k in np.flatnonzero(jumps)}
        return {name for name in names if not self._system.slaves[name].has_event_mode}

    def _go_back(self, t: float, end: float, outcome: Outcome) -> None:
        """Choose the next step after one from `t` to `end`, in s, that had something in its way."""
        told = outcome.early
        if told is not None and outcome.stopped in outcome.sure:
            if told <= t:  # one event right after another
                self._happen(t, {outcome.stopped: STOPPED})
            else:
                self.macro.named = told, outcome.stopped
            return
        self._enclosure.missed(t, end, outcome.ended[1] if outcome.ended else told)
        if outcome.stopped and self._system.slaves[outcome.stopped].stops_after_events:
            self.macro.near[outcome.stopped] = end

    def _arrive(self, t: float, values: list[float], outcome: Outcome) -> None:
        """Take a step that was made, and handle the events at its end."""
        self._result.t = t
        if t >= self.macro.named[0]:
            self.macro.named = NEVER
        if outcome.ended:
            self.ended = outcome.ended
        elif not outcome.due and outcome.early is None and not outcome.pending:
            self._at_one_time = 0
            self.macro.insisting.clear()
            self.macro.history.add(t, values, self.macro.slopes())
            self._enclosure.passed(t)
        else:
            due = outcome.due or ({outcome.stopped: STOPPED} if outcome.stopped else {})
            self._happen(t, due, outcome.pending, outcome.held)
            self._h = max(AFTER * self._h, 10.0 * self._resolution)

    def _happen(self, t: float, due: dict[str, str], pending: Collection[str] = (), held: Collection[str] = ()) -> None:
        """Handle the events at `t` in s.

        Parameters
        ----------
        t : float
        due : dict
            Slave with an event -> how it became known.
        pending : collection of str
            Slaves that handle events inside and have theirs still to come, with the inputs that they have.
        held : collection of str
            Slaves whose events are handled first.
        """
        result, system, macro = self._result, self._system, self.macro
        self._at_one_time += 1
        if self._at_one_time > AT_ONE_TIME:
            raise CosimError(f"{' and '.join(sorted({*due, *pending}))} gets no further than t = {t:.12g} s.")
        result.t = t
        self._enclosure.forget()
        self._verified = 0.0
        if self._rows and self._changes.next_time(t) is not None and (not result.times or result.times[-1] < t):
            macro.exchange(t, before=True)
        self._row_left_of(t)
        before = len(result.ticks)
        arrived = {*pending, *macro.receivers(due)}
        handled = iterate_events(system, result, t, lambda: arrived | self._changes.arrive(t), macro, held=held)
        for name in {*due, *handled.changed}:
            macro.near.pop(name, None)
        if macro.named[1] in {*due, *handled.changed}:  # it may have taken the event a little before
            macro.named = NEVER
        self._go_on(t, handled)
        # A slave may stop where its event is about to come, and names times at which there may be none.
        kinds = {name: kind for name, kind in due.items() if name not in handled.idle and not self._is_to_come(name, t)}
        macro.insisting = {name for name in due if name not in kinds and system.slaves[name].has_event_mode}
        kinds = {name: SEEN if name in pending else RECEIVED for name in handled.changed} | kinds
        kinds = {tick.slave: RECEIVED for tick in result.ticks[before:]} | kinds
        self._list(t, kinds)
        if self._rows:
            self._last_row = t, self._read_all()

    def _list(self, t: float, kinds: dict[str, str]) -> None:
        """List events at `t` in s, each slave once at one time."""
        events = self._result.events
        there = {event.block for event in itertools.takewhile(lambda event: event.t == t, reversed(events))}
        events += [Event(t, name, kinds[name]) for name in self._system.slaves if name in kinds and name not in there]

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
            self._row_left_of(end)
        finally:
            macro.restore(made)
            macro.release(made)

    def _row_left_of(self, t: float) -> None:
        """Keep what there is as the row before the jumps at `t` in s, if these are the first of that time."""
        if self._rows and (self._last_row is None or self._last_row[0] < t):
            self.keep_row()
            sample_end(self._system, self._result, t, self._system.output_names)

    def keep_row(self) -> None:
        """Keep the row after the last jumps; those that come at the same time change it, so it is kept after them."""
        if self._last_row is not None:
            (t, values), self._last_row = self._last_row, None
            names, signals = self._system.output_names, self._result.signals
            if self._result.times[-1] < t or values != [signals[name][-1] for name in names]:
                self._result.keep(t, names, values)

    def _names(self) -> str:
        return ", ".join(self._system.slaves)


def _factor(worst: float, order: int = ORDER) -> float:
    """Return the length of the step that is as far off as it may be, over that of one that was `worst` times so."""
    return MOST if worst == 0.0 else SAFETY * worst ** (-1.0 / order)


def _first(times: Collection[float]) -> float:
    """Return the first of several times in s, the latest of those that are one but for rounding."""
    first = min(times)
    return max(t for t in times if t <= first + ROUNDINGS * math.ulp(first))

"""One step of all slaves with the continuous signals between them: inputs set, steps made, signals exchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cosim.errors import CosimError
from cosim.masters.changes import Changes
from cosim.masters.event_iteration import Settled
from cosim.masters.loops import Settling
from cosim.masters.signal_history import SignalHistory
from cosim.slave import Port, Slave
from cosim.system import System
from hybrid_model.declare.variables import FloatArray
from hybrid_model.schedule.blocks import Step, Termination
from hybrid_model.schedule.scheduler import ANNOUNCED, STOPPED

SEEN = "seen"
"""Of an event: it is inside a slave, and outputs have changed by it."""
LEAP = 1e-6
"""Part of a value by which it changes at once if that is a jump."""
FLOWS = 0.75
"""Part of its change in a step of no length that a number shows in half of the step, if it flows; less than 1."""
BEYOND = 1e-10
"""Part of the time by which a step is to be longer than to an event, for an FMU to tell of it."""
NEVER = (math.inf, "")
"""Of no event."""
States = list[tuple[Slave, float, Any]]
"""Slaves, where they are in s, and what they gave to return to it."""


@dataclass
class Outcome:
    """What a step of all slaves gave.

    Attributes
    ----------
    early : float, optional
        Time in s at which a slave returned with an event; the others are elsewhere.
    stopped : str
        Which slave that is.
    due : dict
        Slaves with events at the end of the step -> how they became known.
    sure : set of str
        Slaves that stopped, or have events at the end, and whose events are there: with other inputs too.
    pending : list of str
        Slaves that handle events inside and are about to jump with the inputs that they have at the end.
    ended : (str, float, Termination) or None
        The slave that ended the run, when, and why.
    held : set of str
        Slaves that insist on their events, and still have the inputs with which they stopped.
    """

    early: float | None = None
    stopped: str = ""
    due: dict[str, str] = field(default_factory=dict)
    sure: set[str] = field(default_factory=set)
    pending: list[str] = field(default_factory=list)
    ended: tuple[str, float, Termination] | None = None
    held: set[str] = field(default_factory=set)

    @property
    def quiet(self) -> bool:
        """Whether nothing happened."""
        return self.early is None and not self.due and not self.pending and self.ended is None

    @property
    def believed(self) -> bool:
        """Whether all are at an event that is where it is."""
        there = bool(self.due) and self.sure.issuperset(self.due)
        return there and not self.pending and self.early is None and self.ended is None


class MacroSteps:
    """Steps of a system whose slaves have left event mode.

    Within a step an input is constant, as FMI has it: at what it is expected to be in the middle, which is of second
    order. An event that a slave has because of what its inputs became is seen by a probe: a step of no length to speak
    of, which is taken back.

    Parameters
    ----------
    system : System
        Started.
    changes : Changes
        What comes from outside.
    t : float
        Time in s.
    resolution : float
        Length of a probe in s.
    latest : mapping
        Slave -> the stop time in s that it has been told, where that is later than `t_stop`.

    Attributes
    ----------
    history : SignalHistory
        Of the continuous connections, and of the outputs of slaves without event mode.
    observe : callable
        Returns all outputs that change along flows: what the accuracy is held against.
    owners, senders : list of str
        Whose they are, and whose the signals in `history`.
    nominal_outputs, nominal_signals : list of float
        Nominal values of what `observe` returns, and of what is in `history`; 0 where there is none.
    announced : dict
        Slave -> the time in s of its next event, of those with event mode that name one: no step goes beyond it.
    named : (float, str)
        Time in s at which a slave without continuous inputs has ended a step early, and which one: it has its event
        there, and a step that ends there does not tell.
    near : dict
        Slave that has ended a step after an event that is to be enclosed -> the time in s before which it is.
    insisting : set of str
        Slaves that have stopped for an event that they did not have any more when their inputs were brought up to date.
    shown, held : dict
        Slave -> what returns its outputs, and those of them that change at events alone.
    meet_at_events : bool
        Whether all slaves say where their events are, and nothing else that they exchange changes: any step will do.
    steps : int
    """

    def __init__(
        self,
        system: System,
        changes: Changes,
        t: float,
        t_stop: float,
        resolution: float,
        latest: Mapping[str, float],
    ) -> None:
        self._system, self._changes, self._t_stop, self._resolution = system, changes, t_stop, resolution
        self._latest = dict.fromkeys(system.slaves, t_stop) | dict(latest)
        self._flows = [c for c in system.connections if system.is_continuous(c)]
        self._held = [c for c in system.connections if not system.is_continuous(c)]
        self._read = system.reader([f"{c.source}.{c.output}" for c in self._flows])
        self._into: dict[str, list[int]] = {name: [] for name in system.slaves}
        for k, connection in enumerate(self._flows):
            self._into[connection.target].append(k)
        self._fed = {name for name, wires in self._into.items() if wires} | set(changes.followed)
        self._probed = [s for s in system.slaves.values() if s.has_event_mode and s.name in self._fed]
        inside = [slave for slave in system.slaves.values() if not slave.has_event_mode]
        self.shown = {name: slave.reader(list(slave.outputs)) for name, slave in system.slaves.items()}
        self.held = {
            name: slave.reader([output for output in slave.outputs if not _flows(slave.outputs[output])])
            for name, slave in system.slaves.items()
        }
        self._leaping = [s for s in inside if s.name in self._fed]
        # A jump within a step is seen by outputs that nobody hears of too.
        self._heard = {(c.source, c.output) for c in self._held}
        told = {s.name: [o for o in s.outputs if not _flows(s.outputs[o])] for s in inside}
        self._watched = {name: _Watched(system.slaves[name], outputs) for name, outputs in told.items() if outputs}
        self._located: dict[str, float] = {}
        self.announced: dict[str, float] = {}
        self.named = NEVER
        self.near: dict[str, float] = {}
        self.insisting: set[str] = set()
        names = [name for name in system.output_names if _is_flowing_number(system, name)]
        self.observe: Callable[[], list[float]] = system.reader(names)
        self.owners = [system.output(name)[0].name for name in names]
        alone = [name for name in names if not system.output(name)[0].has_event_mode]
        self._alone = system.reader(alone)
        self.nominal_outputs = [_port(system, name).nominal for name in names]
        self.nominal_signals = [abs(c.factor) * _port(system, f"{c.source}.{c.output}").nominal for c in self._flows]
        self.nominal_signals += [_port(system, name).nominal for name in alone]
        self.senders = [c.source for c in self._flows] + [system.output(name)[0].name for name in alone]
        self._slope_places = _slope_places(system, [f"{c.source}.{c.output}" for c in self._flows] + alone)
        self._no_slopes = [math.nan] * (len(self._flows) + len(alone))
        self._leads = any(c.input in system.slaves[c.target].interpolating for c in self._flows)
        self._at = dict.fromkeys(system.slaves, t)
        self.meet_at_events = not self._fed and all(
            slave.has_event_mode or slave.stops_after_events for slave in system.slaves.values()
        )
        self.steps = 0
        self.history = SignalHistory(t, self.signals(t), self._no_slopes)
        self.remember()

    def signals(self, t: float, held: Collection[str] = ()) -> list[float]:
        """Carry the continuous signals, and return them and the outputs of slaves that say nothing of their events.

        Those that are `held` keep the inputs that they have.
        """
        return [*self.exchange(t, held=held), *self._alone()]

    def slopes(self) -> list[float]:
        """Return the derivatives of the signals by time, as far as slaves give them; else NaN."""
        found = list(self._no_slopes)
        for read_slopes, places in self._slope_places:
            for places_of_one, slope in zip(places, read_slopes(), strict=True):
                for k in places_of_one:
                    found[k] = slope * (self._flows[k].factor if k < len(self._flows) else 1.0)
        return found

    def exchange(self, t: float, *, before: bool = False, held: Collection[str] = ()) -> list[float]:
        """Carry the continuous signals to their inputs at `t` in s, and return them; curves `before` they jump there.

        Those that are `held` keep the inputs that they have.

        Raises
        ------
        CosimError
            If they do not settle: outputs depend on inputs at once, in a loop.
        """
        self._changes.follow(t, before=before, held=held)
        settling, sent = Settling(self._system, self._flows, t), self._carried()
        self._send(sent, [None] * len(sent), held)
        while not settling.is_done(sent, values := self._carried()):
            self._send(values, sent, held)
            sent = values
        return values

    def _carried(self) -> list[float]:
        return [c.carried(v) for c, v in zip(self._flows, self._read(), strict=True)]

    def _send(self, values: Sequence[float], before: Sequence[float | None], held: Collection[str]) -> None:
        for connection, value, old in zip(self._flows, values, before, strict=True):
            if value != old and connection.target not in held:
                self._system.slaves[connection.target].set(connection.input, value)

    def remember(self) -> None:
        """Note what the slaves without event mode say at events, to see a change."""
        for watched in self._watched.values():
            watched.remember()

    def overlook_restless(self) -> list[str]:
        """Let outputs alone that nobody hears of, and that each step changes, however short it is; return them."""
        found = []
        for name, watched in list(self._watched.items()):
            slave, t, h = self._system.slaves[name], self._at[name], self._resolution
            unheard = {output for output in watched.outputs if (name, output) not in self._heard}
            if not unheard or t + 2.0 * h > self._t_stop:
                continue
            state, restless = slave.save(), unheard
            try:
                for k in (0, 1):
                    slave.step(t + k * h, t + (k + 1) * h)
                    restless = restless.intersection(watched.changed())
                    watched.remember()
                slave.restore(state)
            finally:
                slave.release(state)
            self._watched[name] = watched.without(restless)
            found += [f"{name}.{output}" for output in watched.outputs if output in restless]
        return found

    def save(self) -> States:
        """Return the state of all slaves."""
        return [(slave, self._at[slave.name], slave.save()) for slave in self._system.slaves.values()]

    def restore(self, states: States) -> None:
        """Return to a state."""
        for slave, t, state in states:
            slave.restore(state)
            self._at[slave.name] = t

    @staticmethod
    def release(states: States) -> None:
        """Free a state."""
        for slave, _, state in states:
            slave.release(state)

    def attempt(self, t: float, t_next: float) -> tuple[Outcome, list[float]]:
        """Step all slaves from `t` to `t_next`, in s, with the signals as they are expected in it.

        Parameters
        ----------
        t, t_next : float

        Returns
        -------
        outcome : Outcome
        values : list of float
            What they carry at the end; empty if a slave was early.
        """
        outcome = Outcome()
        middle = 0.5 * (t + t_next)
        self._changes.follow(middle)
        expected = self.history.about(middle) if self._leads else [self.history.at(middle)]
        for name, slave in self._system.slaves.items():
            self._lead(name, expected, t_next - t)
            if self._at[name] >= t_next:  # by the length of a step that let it settle
                continue
            made = self._step(slave, t_next)
            if made.reached < self._at[name] - self._resolution or made.reached > t_next + self._resolution:
                raise CosimError(
                    f"{name} stepped from {t:.12g} towards {t_next:.12g} s and says that it is at {made.reached:.12g} "
                    "s: that is outside the step."
                )
            if made.terminated:
                outcome.ended = name, made.reached, made.terminated
                return outcome, []
            # Where a slave is may differ from where all are by rounding.
            self._at[name] = made.reached
            if made.event and name in self.insisting:
                outcome.held.add(name)
            behind = made.reached < t_next - self._resolution
            if (behind or made.event) and name not in self._fed:
                outcome.sure.add(name)
            # In a step of no length to speak of the others go on, for one may stop where its input comes to be no more.
            if behind and t_next - t > 2.0 * self._resolution:
                outcome.early, outcome.stopped = made.reached, name
                return outcome, []
            if behind or made.event:
                outcome.due[name] = STOPPED
        values = self.signals(t_next, outcome.held)
        for name, watched in self._watched.items():
            if watched.changed():
                outcome.due[name] = SEEN
                # What has no continuous inputs has ended its step at its event, or has been searched for it.
                if name not in self._fed:
                    outcome.sure.add(name)
        foreseen = {name: ANNOUNCED for name, time in self.announced.items() if time <= t_next}
        outcome.due |= foreseen
        outcome.sure.update(foreseen)
        time, name = self.named
        if t_next >= time and self._system.slaves[name].stops_after_events:
            outcome.due.setdefault(name, STOPPED)
            outcome.sure.add(name)
        self._look(outcome, t_next)
        return outcome, values

    def _look(self, outcome: Outcome, t: float) -> None:
        """Add the events that slaves have with the inputs that they have at `t` in s, at the end of a step.

        They are there if what they are sent has just jumped; else inputs have come to what they are on the way.
        """
        inside = {name for name in outcome.sure if not self._system.slaves[name].has_event_mode}
        struck = {wire.target for wire in self._flows if wire.source in inside}
        for slave in self._probed:
            if self._probe(slave, t):
                outcome.due.setdefault(slave.name, STOPPED)
                if slave.name in struck:
                    outcome.sure.add(slave.name)
        outcome.pending = [s.name for s in self._leaping if s.name not in struck and self._leaps(s, t)]

    def _step(self, slave: Slave, t_next: float) -> Step:
        """Step a slave to `t_next` in s; one that is searched for its event ends there, as if it had told of it."""
        name, t = slave.name, self._at[slave.name]
        self.steps += 1
        if t < self.near.get(name, -math.inf):
            return self._step_near(slave, t, t_next)
        watched = None if slave.stops_after_events or name in self._fed else self._watched.get(name)
        if watched is None or t_next - t <= 2.0 * self._resolution or self._located.get(name) == t_next:
            return slave.step(t, t_next)
        state = slave.save()
        try:
            made = slave.step(t, t_next)
            if made.terminated or not watched.changed():
                return made
            found = self._search(slave, state, t, t_next)
            slave.restore(state)
            return slave.step(t, t_next) if found > t_next - self._resolution else Step(found, event=True)
        finally:
            slave.release(state)

    def _step_near(self, slave: Slave, t: float, t_next: float) -> Step:
        """Step a slave that ends its steps after events, and say if it has had one at the very end.

        Of that it does not tell. But it would end a longer step there, and does not if it goes on from here.
        """
        beyond = t_next + max(2.0 * self._resolution, BEYOND * abs(t_next))
        if beyond > self._latest[slave.name]:
            return slave.step(t, t_next)
        longer = self._tried(slave, t, beyond)
        made = slave.step(t, t_next)
        had = longer and not made.event and not self._tried(slave, t_next, beyond)
        return made._replace(event=True) if had else made

    def _search(self, slave: Slave, state: Any, t: float, t_next: float) -> float:
        """Return when a slave first shows an event inside a step from `state` at `t` to `t_next`, in s.

        It has no continuous inputs, so its steps are its own matter, and it is searched alone.
        """
        watched, low, high = self._watched[slave.name], t, t_next
        slave.restore(state)
        state = slave.save()
        try:
            while high - low > self._resolution and low < (middle := 0.5 * (low + high)) < high:
                made = slave.step(low, middle)
                self.steps += 1
                if made.terminated or watched.changed():
                    high = middle
                    slave.restore(state)
                else:
                    low = middle
                    slave.release(state)
                    state = slave.save()
        finally:
            slave.release(state)
        self._located[slave.name] = high
        return high

    def _lead(self, name: str, expected: list[FloatArray], h: float) -> None:
        """Give a slave its continuous inputs for a step of length `h` in s, by what is expected about its middle.

        They stand still at what they are expected to be in the middle, or go along the straight lines that come
        nearest to it, in the mean of squares over the step, as Legendre's polynomials give them.
        """
        slave, lines = self._system.slaves[name], dict[str, tuple[float, float]]()
        for k in self._into[name]:
            into = self._flows[k].input
            if into not in slave.interpolating:
                slave.set(into, float(expected[0][k]))
                continue
            c = [float(coefficients[k]) for coefficients in expected] + [0.0] * (4 - len(expected))
            mean, slope = c[0] + c[2] * h * h / 12.0, c[1] + 0.15 * c[3] * h * h
            lines[into] = mean - 0.5 * slope * h, slope
        if lines:
            slave.lead(lines)

    def settle(self, name: str) -> Settled:
        """Let a slave that handles its events inside handle those that are due at once, in a step of no length.

        It stays behind that step where something has leapt; else the step is taken back.
        """
        slave, t = self._system.slaves[name], self._at[name]
        if t + self._resolution > self._latest[name]:
            return Settled()
        leapt = self._leapt(slave, t + self._resolution)
        self.steps += 1
        if leapt is None:
            return Settled()
        made = slave.step(t, t + self._resolution)
        self._at[name] = made.reached
        return Settled(made.terminated, any(not slave.direct.get(output) for output in leapt))

    def receivers(self, names: Collection[str]) -> set[str]:
        """Return the slaves that handle events inside and to which signals flow from some of those slaves."""
        inside = {slave.name for slave in self._leaping}
        return {wire.target for wire in self._flows if wire.source in names} & inside

    def is_to_come(self, name: str, t: float) -> bool:
        """Return whether a slave still has its event to come after it was in event mode at `t` in s."""
        slave = self._system.slaves[name]
        return slave in self._probed and self._probe(slave, t)

    def _probe(self, slave: Slave, t: float) -> bool:
        """Return whether a slave has an event with the inputs that it has now."""
        later = t + self._resolution
        return later <= self._t_stop and self._tried(slave, self._at[slave.name], later)

    @staticmethod
    def _tried(slave: Slave, t: float, t_next: float) -> bool:
        """Return whether a slave tells of an event in a step, which is taken back."""
        state = slave.save()
        try:
            made = slave.step(t, t_next)
            slave.restore(state)
        finally:
            slave.release(state)
        return made.event or made.terminated is not None

    def _leaps(self, slave: Slave, t: float) -> bool:
        """Return whether a slave that handles events inside jumps at once with the inputs that it has now."""
        end = t + self._resolution
        return end <= self._t_stop and self._leapt(slave, end) is not None

    def _leapt(self, slave: Slave, end: float) -> list[str] | None:
        """Return the outputs that leap in a step to `end`, of no length to speak of, which is taken back; None if none.

        What flows changes half as much in a step of half the length, however small it has been until then. A slave
        that ends the run has no outputs any more.
        """
        read, start = self.shown[slave.name], self._at[slave.name]
        state, before = slave.save(), read()
        try:
            made = slave.step(start, end)
            after = read()
            slave.restore(state)
            if made.terminated or not _differ(before, after):
                return [] if made.terminated else None
            slave.step(start, 0.5 * (start + end))
            half = read()
            slave.restore(state)
        finally:
            slave.release(state)
        leapt = [
            output
            for output, a, b, c in zip(slave.outputs, before, half, after, strict=True)
            if _differ([a], [c]) and not (isinstance(a, float) and abs(b - a) < FLOWS * abs(c - a))
        ]
        return leapt or None


class _Watched:
    """Outputs of a slave that handles events inside, which change by these alone."""

    def __init__(self, slave: Slave, outputs: Sequence[str]) -> None:
        self._slave, self.outputs, self._read = slave, outputs, slave.reader(outputs)
        self._known = self._read()

    def remember(self) -> None:
        """Note what they are."""
        self._known = self._read()

    def changed(self) -> list[str]:
        """Return those that are others than was noted."""
        now = self._read()
        if now == self._known:
            return []
        return [output for output, a, b in zip(self.outputs, self._known, now, strict=True) if a != b]

    def without(self, outputs: Collection[str]) -> _Watched:
        """Return the others."""
        return _Watched(self._slave, [other for other in self.outputs if other not in outputs])


def _differ(before: Sequence[Any], after: Sequence[Any]) -> bool:
    """Return whether outputs are others after a step of no length: numbers that leap, all else that changes."""
    return any(
        abs(b - a) > LEAP * max(abs(a), abs(b)) if isinstance(a, float) else a != b
        for a, b in zip(before, after, strict=True)
    )


def _slope_places(system: System, names: Sequence[str]) -> list[tuple[Callable[[], list[float]], list[list[int]]]]:
    """Return what gives slopes of signals, as slaves offer them, and where each is among the signals."""
    found: dict[Slave, dict[str, list[int]]] = {}
    for k, (slave, output) in enumerate(map(system.output, names)):
        if output in slave.sloped:
            found.setdefault(slave, {}).setdefault(output, []).append(k)
    return [(slave.slopes(list(places)), list(places.values())) for slave, places in found.items()]


def _is_flowing_number(system: System, name: str) -> bool:
    return _flows(_port(system, name))


def _port(system: System, name: str) -> Port:
    slave, port = system.output(name)
    return slave.outputs[port]


def _flows(output: Port) -> bool:
    return output.kind == "number" and not output.discrete and not output.whole

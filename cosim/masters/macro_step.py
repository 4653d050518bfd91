"""One step of all slaves with the continuous signals between them: inputs set, steps made, signals exchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from cosim.errors import CosimError
from cosim.masters.changes import Changes
from cosim.masters.loops import Settling
from cosim.masters.signal_history import SignalHistory
from cosim.slave import Port, Slave
from cosim.system import System
from hybrid_model.declare.variables import FloatArray
from hybrid_model.schedule.blocks import Termination

LEAP = 1e-6
"""Part of a value by which it changes at once if that is a jump."""
States = list[tuple[Slave, float, Any]]
"""Slaves, where they are in s, and what they gave to return to it."""


@dataclass
class Outcome:
    """What a step of all slaves gave.

    Attributes
    ----------
    early : float, optional
        Time in s at which a slave returned with an event; the others are elsewhere.
    due : set of str
        Slaves with events at the end of the step.
    exact : bool
        Whether a slave stopped that has no continuous inputs, so that its event is where it stopped.
    pending : bool
        Whether a slave that handles events inside is about to jump with the inputs that it has at the end.
    ended : (str, float, Termination) or None
        The slave that ended the run, when, and why.
    """

    early: float | None = None
    due: set[str] = field(default_factory=set)
    exact: bool = False
    pending: bool = False
    ended: tuple[str, float, Termination] | None = None

    @property
    def quiet(self) -> bool:
        """Whether nothing happened."""
        return self.early is None and not self.due and not self.pending and self.ended is None

    @property
    def believed(self) -> bool:
        """Whether all are at an event that is where it is."""
        return self.exact and bool(self.due) and not self.pending and self.early is None and self.ended is None


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

    Attributes
    ----------
    history : SignalHistory
        Of the continuous connections, and of the outputs of slaves without event mode.
    observe : callable
        Returns all outputs that change along flows: what the accuracy is held against.
    owners : list of str
        Whose they are.
    nominal_outputs, nominal_signals : list of float
        Nominal values of what `observe` returns, and of what is in `history`; 0 where there is none.
    meet_at_events : bool
        Whether all slaves say where their events are, and nothing else that they exchange changes: any step will do.
    steps : int
    """

    def __init__(self, system: System, changes: Changes, t: float, t_stop: float, resolution: float) -> None:
        self._system, self._changes, self._t_stop, self._resolution = system, changes, t_stop, resolution
        self._flows = [c for c in system.connections if system.is_continuous(c)]
        self._held = [c for c in system.connections if not system.is_continuous(c)]
        self._read = system.reader([f"{c.source}.{c.output}" for c in self._flows])
        self._into: dict[str, list[int]] = {name: [] for name in system.slaves}
        for k, connection in enumerate(self._flows):
            self._into[connection.target].append(k)
        self._fed = {name for name, wires in self._into.items() if wires} | set(changes.followed)
        self._probed = [s for s in system.slaves.values() if s.has_event_mode and s.name in self._fed]
        inside = [slave for slave in system.slaves.values() if not slave.has_event_mode]
        self._shown = {slave.name: slave.reader(list(slave.outputs)) for slave in inside}
        self._leaping = [(s, self._shown[s.name]) for s in inside if s.name in self._fed]
        # Where inputs change along flows, a jump within a step is seen by outputs that nobody hears of too.
        told = dict.fromkeys((c.source, c.output) for c in self._held if not system.slaves[c.source].has_event_mode)
        told |= dict.fromkeys((s.name, o) for s, _ in self._leaping for o in s.outputs if not _flows(s.outputs[o]))
        self._inside = [(system.slaves[name], output) for name, output in told]
        names = [name for name in system.output_names if _is_flowing_number(system, name)]
        self.observe: Callable[[], list[float]] = system.reader(names)
        self.owners = [system.output(name)[0].name for name in names]
        alone = [name for name in names if not system.output(name)[0].has_event_mode]
        self._alone = system.reader(alone)
        self.nominal_outputs = [_port(system, name).nominal for name in names]
        self.nominal_signals = [abs(c.factor) * _port(system, f"{c.source}.{c.output}").nominal for c in self._flows]
        self.nominal_signals += [_port(system, name).nominal for name in alone]
        self._slope_places = _slope_places(system, [f"{c.source}.{c.output}" for c in self._flows] + alone)
        self._no_slopes = [math.nan] * (len(self._flows) + len(alone))
        self._leads = any(c.input in system.slaves[c.target].interpolating for c in self._flows)
        self._known: list[Any] = []
        self._at = dict.fromkeys(system.slaves, t)
        self.meet_at_events = not self._fed and all(
            slave.has_event_mode or slave.stops_after_events for slave in system.slaves.values()
        )
        self.steps = 0
        self.history = SignalHistory(t, self.signals(t), self._no_slopes)
        self.remember()

    def signals(self, t: float) -> list[float]:
        """Carry the continuous signals, and return them and the outputs of slaves that say nothing of their events."""
        return [*self.exchange(t), *self._alone()]

    def slopes(self) -> list[float]:
        """Return the derivatives of the signals by time, as far as slaves give them; else NaN."""
        found = list(self._no_slopes)
        for read_slopes, places in self._slope_places:
            for places_of_one, slope in zip(places, read_slopes(), strict=True):
                for k in places_of_one:
                    found[k] = slope * (self._flows[k].factor if k < len(self._flows) else 1.0)
        return found

    def exchange(self, t: float) -> list[float]:
        """Carry the continuous signals to their inputs at `t` in s, and return them.

        Raises
        ------
        CosimError
            If they do not settle: outputs depend on inputs at once, in a loop.
        """
        self._changes.follow(t)
        settling, before = Settling(self._system, self._flows, t), self._carried()
        self._send(before, [None] * len(before))
        while not settling.is_done(before, values := self._carried()):
            self._send(values, before)
            before = values
        return values

    def _carried(self) -> list[float]:
        return [c.carried(v) for c, v in zip(self._flows, self._read(), strict=True)]

    def _send(self, values: Sequence[float], before: Sequence[float | None]) -> None:
        for connection, value, old in zip(self._flows, values, before, strict=True):
            if value != old:
                self._system.slaves[connection.target].set(connection.input, value)

    def remember(self) -> None:
        """Note what the slaves without event mode say at events, to see a change."""
        self._known = [slave.get(output) for slave, output in self._inside]

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
            made = slave.step(self._at[name], t_next)
            self.steps += 1
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
            if made.reached < t_next - self._resolution:
                outcome.early, outcome.exact = made.reached, name not in self._fed
                return outcome, []
            if made.event:
                outcome.due.add(name)
                outcome.exact = outcome.exact or name not in self._fed
        values = self.signals(t_next)
        outcome.due |= {slave.name for slave in self._probed if self._probe(slave, t_next)}
        outcome.pending = any(self._leaps(slave, read, t_next) for slave, read in self._leaping)
        for (slave, output), known in zip(self._inside, self._known, strict=True):
            if slave.get(output) != known:
                outcome.due.add(slave.name)
                # What ends its steps after events has its event here, or it had ended before.
                outcome.exact |= slave.stops_after_events and slave.name not in self._fed
        return outcome, values

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

    def settle(self, name: str) -> Termination | None:
        """Let a slave that handles its events inside handle those that are due at once, in a step of no length.

        It stays behind that step where something has happened; else the step is taken back.
        """
        slave, t = self._system.slaves[name], self._at[name]
        if t + self._resolution > self._t_stop:
            return None
        state, before = slave.save(), self._shown[name]()
        try:
            made = slave.step(t, t + self._resolution)
            if _differ(before, self._shown[name]()) or made.terminated:
                self._at[name] = made.reached
            else:
                slave.restore(state)
        finally:
            slave.release(state)
        self.steps += 1
        return made.terminated

    def _probe(self, slave: Slave, t: float) -> bool:
        """Return whether a slave has an event with the inputs that it has now."""
        if t + self._resolution > self._t_stop:
            return False
        state = slave.save()
        try:
            made = slave.step(self._at[slave.name], t + self._resolution)
            slave.restore(state)
        finally:
            slave.release(state)
        return made.event or made.terminated is not None

    def _leaps(self, slave: Slave, read: Callable[[], list[Any]], t: float) -> bool:
        """Return whether a slave that handles events inside jumps at once with the inputs that it has now."""
        if t + self._resolution > self._t_stop:
            return False
        state, before = slave.save(), read()
        try:
            made = slave.step(self._at[slave.name], t + self._resolution)
            after = read()
            slave.restore(state)
        finally:
            slave.release(state)
        return _differ(before, after) or made.terminated is not None


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

"""The events of one instant at which all slaves are, those that handle events inside included."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from cosim.errors import CosimError
from cosim.result import CosimResult
from cosim.system import System
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import ITERATIONS, Tick


class Settled(NamedTuple):
    """What a slave that handles its events inside has done at once.

    Attributes
    ----------
    ended : Termination or None
        Why it ended the run, if it did.
    changed : bool
        Whether outputs have changed by it that do not depend on inputs at once.
    """

    ended: Termination | None = None
    changed: bool = False


class Outputs(Protocol):
    """What slaves show, and what those do that handle their events inside."""

    @property
    def shown(self) -> Mapping[str, Callable[[], list[Any]]]:
        """Slave -> what returns its outputs."""

    @property
    def held(self) -> Mapping[str, Callable[[], list[Any]]]:
        """Slave -> what returns those of its outputs that change at events alone."""

    def settle(self, name: str) -> Settled:
        """Let a slave that handles its events inside handle those that what it has received brings about at once."""


@dataclass
class Handled:
    """What the events of one instant came to.

    Attributes
    ----------
    ended : (str, float, Termination) or None
        The slave that ended the run, when, and why.
    idle : set of str
        Slaves that know that they had no event.
    announced : dict
        Slave -> the time in s of its next event, of those with event mode that name one.
    changed : set of str
        Slaves that have received something and shown that it has brought an event about.
    """

    ended: tuple[str, float, Termination] | None = None
    idle: set[str] = field(default_factory=set)
    announced: dict[str, float] = field(default_factory=dict)
    changed: set[str] = field(default_factory=set)


def iterate_events(
    system: System,
    result: CosimResult,
    t: float,
    change: Callable[[], Iterable[str]],
    outputs: Outputs,
    *,
    entered: bool = False,
    held: Collection[str] = (),
) -> Handled:
    """Let all slaves with event mode handle their events, signals travelling at once (rule 6).

    Parameters
    ----------
    system : System
        All slaves at `t`.
    result : CosimResult
        Takes the ticks.
    t : float
        In s.
    change : callable
        Sets what changes from outside at this instant; returns whose it is.
    outputs : Outputs
        Of the slaves.
    entered : bool
        Whether the slaves are in event mode already.
    held : collection of str
        Slaves that handle their events with the inputs that they have, before anything else is set.

    Returns
    -------
    Handled

    Raises
    ------
    CosimError
        If a slave asks for iterations without end, or names a time for its next event that is not ahead.
    """
    events = {name: slave for name, slave in system.slaves.items() if slave.has_event_mode}
    for slave in events.values() if not entered else ():
        slave.enter_event_mode()
    shown_before = {name: read() for name, read in outputs.held.items()}
    sent: dict[tuple[str, str], object] = {}
    received: set[str] = set()
    counts, handled = dict.fromkeys(system.slaves, 0), Handled()

    def those_held() -> set[str]:
        return set(held)

    def all_others() -> set[str]:
        received.update(change())
        received.update(*(_send(system, name, sent) for name in system.slaves if name not in events))
        return received.union(events)

    for begin in (those_held, all_others):
        pending = begin()
        while pending:
            name = next(name for name in system.slaves if name in pending)
            counts[name] += 1
            if counts[name] > ITERATIONS:
                raise CosimError(f"{name} asks for more than {ITERATIONS} event iterations at t = {t:.9g} s.")
            if name in events:
                slave = events[name]
                before = outputs.shown[name]() if name in received else None
                update = slave.update()
                result.ticks += [Tick(t, name, clock) for clock in update.ticks]
                # In event mode outputs follow inputs at once, so what an update changes is more than that.
                told = update.again or update.ticks or (slave.tells_jumps and not update.idle)
                if before is not None and (told or before != outputs.shown[name]()):
                    handled.changed.add(name)
                again, ended = update.again, update.terminated
                if update.idle and counts[name] == 1:
                    handled.idle.add(name)
                if update.next_event is not None:
                    handled.announced[name] = update.next_event
                else:
                    handled.announced.pop(name, None)
            else:
                again, (ended, changed) = False, outputs.settle(name)
                if changed and name in received:
                    handled.changed.add(name)
            if ended:
                handled.ended = name, t, ended
                return handled
            if not again:
                pending.discard(name)
            receivers = _send(system, name, sent)
            pending |= receivers
            received |= receivers
    handled.changed |= {name for name in received if outputs.held[name]() != shown_before[name]}
    past = next((name for name, time in handled.announced.items() if time <= t), None)
    if past is not None:
        raise CosimError(
            f"{past} is at t = {t:.12g} s and says that its next event is at {handled.announced[past]:.12g} s: that is "
            "not ahead."
        )
    for slave in events.values():
        slave.enter_step_mode()
    return handled


def _send(system: System, name: str, sent: dict[tuple[str, str], object]) -> set[str]:
    """Carry the outputs of a slave to their receivers; return those for whom something changed."""
    receivers = set()
    for wire in system.from_slave(name):
        value, at = wire.carried(system.slaves[name].get(wire.output)), (wire.target, wire.input)
        if at not in sent:
            sent[at] = system.slaves[wire.target].get(wire.input)
        if sent[at] != value:
            sent[at] = value
            system.slaves[wire.target].set(wire.input, value)
            receivers.add(wire.target)
    return receivers

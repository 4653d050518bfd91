"""The events of one instant at which all slaves are, those that handle events inside included."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from cosim.errors import CosimError
from cosim.result import CosimResult
from cosim.system import System
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import ITERATIONS, Tick


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
    """

    ended: tuple[str, float, Termination] | None = None
    idle: set[str] = field(default_factory=set)
    announced: dict[str, float] = field(default_factory=dict)


def iterate_events(
    system: System,
    result: CosimResult,
    t: float,
    change: Callable[[], Iterable[str]],
    settle: Callable[[str], Termination | None],
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
    settle : callable
        Lets a slave that handles its events inside handle those that what it has received brings about at once.
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
    sent: dict[tuple[str, str], object] = {}
    counts, handled = dict.fromkeys(system.slaves, 0), Handled()

    def those_held() -> set[str]:
        return set(held)

    def all_others() -> set[str]:
        found = {*change(), *events}
        return found.union(*(_send(system, name, sent) for name in system.slaves if name not in events))

    for begin in (those_held, all_others):
        pending = begin()
        while pending:
            name = next(name for name in system.slaves if name in pending)
            counts[name] += 1
            if counts[name] > ITERATIONS:
                raise CosimError(f"{name} asks for more than {ITERATIONS} event iterations at t = {t:.9g} s.")
            if name in events:
                update = events[name].update()
                result.ticks += [Tick(t, name, clock) for clock in update.ticks]
                again, ended = update.again, update.terminated
                if update.idle and counts[name] == 1:
                    handled.idle.add(name)
                if update.next_event is not None:
                    handled.announced[name] = update.next_event
                else:
                    handled.announced.pop(name, None)
            else:
                again, ended = False, settle(name)
            if ended:
                handled.ended = name, t, ended
                return handled
            if not again:
                pending.discard(name)
            pending |= _send(system, name, sent)
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

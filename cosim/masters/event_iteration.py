"""The events of one instant at which all slaves are, those that handle events inside included."""

from __future__ import annotations

from collections.abc import Callable

from cosim.errors import CosimError
from cosim.result import CosimResult
from cosim.system import System
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import ITERATIONS, Tick


def iterate_events(
    system: System, result: CosimResult, t: float, change: Callable[[], object], *, entered: bool = False
) -> tuple[str, float, Termination] | None:
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
        Sets what changes from outside at this instant.
    entered : bool
        Whether the slaves are in event mode already.

    Returns
    -------
    (str, float, Termination) or None
        The slave that ended the run, when, and why.

    Raises
    ------
    CosimError
        If a slave asks for iterations without end.
    """
    events = [slave for slave in system.slaves.values() if slave.has_event_mode]
    for slave in events if not entered else ():
        slave.enter_event_mode()
    change()
    sent: dict[tuple[str, str], object] = {}
    for name, slave in system.slaves.items():
        if not slave.has_event_mode:
            _send(system, name, sent)
    pending = {slave.name: 0 for slave in events}
    counts = dict.fromkeys(pending, 0)
    while pending:
        name = next(slave.name for slave in events if slave.name in pending)
        counts[name] += 1
        if counts[name] > ITERATIONS:
            raise CosimError(f"{name} asks for more than {ITERATIONS} event iterations at t = {t:.9g} s.")
        update = system.slaves[name].update()
        result.ticks += [Tick(t, name, clock) for clock in update.ticks]
        if update.terminated:
            return name, t, update.terminated
        if not update.again:
            del pending[name]
        for receiver in _send(system, name, sent):
            if receiver in counts:
                pending[receiver] = 0
            else:
                # An output may follow at once from an input: what is behind it is news too.
                for further in _send(system, receiver, sent) & set(counts):
                    pending[further] = 0
    for slave in events:
        slave.enter_step_mode()
    return None


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

"""How masters treat the events of each slave, in words for its result."""

from __future__ import annotations

from cosim.slave import Slave


def exactly(slave: Slave) -> str:
    """Return how the event-exact master treats the events of a slave."""
    if slave.foresees:
        return "events predicted by nextEventTime; nothing is rolled back"
    if slave.can_restore:
        return "events where it returns early; it goes back to an earlier state if another slave has its event first"
    return "events where it returns early; it cannot go back, so nobody may send it anything before where it is"


def with_rollback(slave: Slave, *, again: bool) -> str:
    """Return how the error-controlled master treats the events of a slave; `again` if its run is made again for it."""
    how = "; it cannot save its state, so it goes back by a new run from the start" if again else ""
    if slave.has_event_mode:
        return f"events in event mode, come to by ever shorter steps from states that all slaves return to{how}"
    if slave.stops_after_events:
        return f"events inside, after which its steps end: all slaves go back and meet it there{how}"
    return f"events inside, come to by ever shorter steps where they change an output{how}"


def by_fixed_steps(slave: Slave, step: float, *, alone: bool) -> str:
    """Return how the fixed-step master treats the events of a slave."""
    if alone:
        return "events inside, at the times that it finds"
    late = f"events inside; others hear of them at the next communication point, up to {step:.6g} s late"
    if slave.can_restore and slave.variable_step and slave.internal_step is not None:
        return (
            f"{late} (its outputs move every {slave.internal_step:.6g} s: --master error-controlled looks between them)"
        )
    if slave.can_restore or not slave.variable_step:
        return late
    return f"{late} (it cannot save its state: --master error-controlled repeats its run to enclose them)"

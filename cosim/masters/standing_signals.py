"""Signals that may change along flows and changed at events alone: what would make the next run easier."""

from __future__ import annotations

import itertools

from cosim.result import CosimResult
from cosim.system import System


def standing_still(system: System, result: CosimResult) -> str | None:
    """Return a sentence if the event-exact master could run a system whose outputs were declared as they behave.

    That is where the only signals between slaves that may change along flows have changed at events alone, and the
    slaves have event mode.

    Parameters
    ----------
    system : System
    result : CosimResult
        Of the error-controlled master, with outputs over time.
    """
    flows = sorted({f"{c.source}.{c.output}" for c in system.connections if system.is_continuous(c)})
    slaves = system.slaves.values()
    if not (flows and result.events and all(slave.has_event_mode and slave.variable_step for slave in slaves)):
        return None
    times = {event.t for event in result.events} | {tick.t for tick in result.ticks}
    pieces = list(itertools.pairwise(result.times))
    changed = {
        piece
        for name in flows
        for piece, (before, after) in zip(pieces, itertools.pairwise(result.signals[name]), strict=True)
        if before != after
    }
    if not changed or not all(any(a <= t <= b for t in times) for a, b in changed) or len(changed) == len(pieces):
        return None
    told = ", ".join(flows[:3]) + (f" and {len(flows) - 3} more" if len(flows) > 3 else "")
    return (
        f"{told} changed at events alone; with variability discrete in the description (hm.Output(discrete=True)) the "
        "event-exact master takes this system, in fewer steps."
    )

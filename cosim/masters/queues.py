"""Who has the queue of predicted events in an event-exact run: the scheduler in C where all slaves are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from cosim.automaton_slave import AutomatonSlave
from cosim.system import System
from hybrid_model.schedule.scheduler import Scheduler

if TYPE_CHECKING:
    from hybrid_model.schedule.joined_blocks import JoinedBlocks

NATIVE = "native: all slaves are automata whose maps are compiled; the scheduler in C runs them."


def queue_of(
    system: System, span: tuple[float, float], watch: Callable[[float], None] | None, *, wanted: str = ""
) -> tuple[Scheduler | JoinedBlocks, str]:
    """Return what runs a system whose slaves have begun, and a sentence that says what that is and why.

    Parameters
    ----------
    system : System
        Its slaves exchange signals at events only.
    span : (float, float)
        Start and end in s.
    watch : callable, optional
        Called before and after the events of each instant.
    wanted : str
        Why it is to be the one in Python, if it is.
    """
    why = wanted or _needs_python(system)
    if why:
        return Scheduler(system.slaves, system.from_slave, span[0], watch=watch), f"python: {why}."
    # CasADi is imported by whoever runs something on the native engine.
    from hybrid_model.schedule.joined_blocks import JoinedBlocks

    slaves = {name: slave for name, slave in system.slaves.items() if isinstance(slave, AutomatonSlave)}
    blocks = {name: block for name, slave in slaves.items() if (block := slave.native_block) is not None}

    def give(name: str, variable: str, value: float) -> None:
        slaves[name].set(variable, value)

    joined = JoinedBlocks(blocks, system.from_slave, span, give, watch)
    for slave in slaves.values():
        slave.join(joined)
    return joined, NATIVE


def _needs_python(system: System) -> str:
    """Return why the scheduler in C cannot run a system, if it cannot."""
    for name, slave in system.slaves.items():
        if type(slave) is not AutomatonSlave:
            return f"{name} is no automaton in this process"
        if slave.native_block is None:
            return f"{name} runs in Python, since {slave.why_python.rstrip('.')}"
    converting = next((connection for connection in system.connections if connection.converts), None)
    return "" if converting is None else f"{converting} converts what it carries"

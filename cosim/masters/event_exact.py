"""The event-exact master: slaves that meet only at events, each advanced only when something happens to it.

Between two events a slave's flow is its own, so the slave itself predicts its next event (`nextEventTime` in FMI 3.0).
The master keeps those predictions in a queue, takes the earliest, lets that slave jump, and brings only the receivers
of what it sent to that instant. Nothing is rolled back, and an event costs as much as it has receivers, however many
slaves there are. Slaves that cannot predict (they name no next event) are stepped to the earliest prediction of the
others and may stop before it; only they are saved and restored.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

from cosim.errors import CosimError, MisfitError
from cosim.masters.start import outputs, require_times, sample, start_slaves
from cosim.result import CosimResult, Ended, Tick
from cosim.slave import Slave, Step, Termination
from cosim.system import System

SIMULTANEOUS = 1e-9
"""In s: events of different slaves closer than this are handled at one instant, in the order of the slaves."""
ITERATIONS = 10_000
"""Event iterations of one slave at one instant, at most."""


def run_event_exact(
    system: System, t_stop: float, *, t_start: float = 0.0, output_interval: float | None = None
) -> CosimResult:
    """Run a system whose slaves exchange discrete signals only, each event at its exact time.

    Parameters
    ----------
    system : System
        Slaves with event mode; every connected input discrete.
    t_stop, t_start : float
        Times in s.
    output_interval : float, optional
        Record all outputs at multiples of this time; default: only at the end.

    Returns
    -------
    CosimResult
        Events with their times, and the signals.

    Raises
    ------
    MisfitError
        If a connection carries a continuous signal or a slave has no event mode.
    CosimError
        If a slave fails, or asks for event iterations without end.
    """
    require_times(t_start, t_stop, output_interval, "output interval")
    _require_discrete(system)
    run = _Run(system, t_start)
    try:
        start_slaves(system, t_start, t_stop, events=True)
        run.handle_events(t_start, set(system.slaves))
        if output_interval is not None:
            sample(system, run.result, t_start, system.output_names)
        _advance(run, t_start, t_stop, output_interval)
        run.result.final = outputs(system)
    finally:
        system.close()
    return run.result


def _advance(run: _Run, t_start: float, t_stop: float, output_interval: float | None) -> None:
    k = 1
    while not run.ended and run.result.t < t_stop:
        grid = t_stop if output_interval is None else min(t_start + k * output_interval, t_stop)
        run.advance_to(grid)
        if not run.ended and output_interval is not None:
            sample(run.system, run.result, grid, run.system.output_names)
        k += 1


def _require_discrete(system: System) -> None:
    for slave in system.slaves.values():
        if not slave.has_event_mode:
            raise MisfitError(f"{slave.name} has no event mode: use the fixed-step master.")
    for connection in system.connections:
        port = system.slaves[connection.source].outputs[connection.output]
        if not port.discrete:
            raise MisfitError(
                f"{connection} carries a signal that changes along flows; this master exchanges signals at events "
                "only. Compose the two blocks to one, or use the fixed-step master."
            )


@dataclass
class _Block:
    """A slave and where it is."""

    slave: Slave
    order: int
    t: float
    next_event: float | None = None
    version: int = 0


class _Run:
    """The queue of predicted events, and the event iteration at one instant."""

    def __init__(self, system: System, t_start: float) -> None:
        self.system = system
        self.result = CosimResult(t=t_start)
        self.blocks = {name: _Block(slave, k, t_start) for k, (name, slave) in enumerate(system.slaves.items())}
        self._queue: list[tuple[float, int, int, str]] = []

    @property
    def ended(self) -> bool:
        """Whether a slave has ended the run."""
        return self.result.ended is not Ended.HORIZON

    def advance_to(self, limit: float) -> None:
        """Handle all events up to and including `limit`, then bring every slave there."""
        while not self.ended:
            t, due = self._next_instant(limit)
            if not due:
                break
            self.handle_events(t, due)
        for block in self.blocks.values():
            while not self.ended and block.t < limit:
                made = self._step(block, limit)
                if made.event and not self.ended:
                    self._require_announced(block, limit)
                    block.slave.enter_event_mode()
                    self.handle_events(limit, {block.slave.name})
        if not self.ended:
            self.result.t = limit

    def handle_events(self, t: float, due: set[str]) -> None:
        """Event iteration at one instant: jumps in the order of the slaves, signals travelling at once (rule 6)."""
        pending, touched = set(due), set(due)
        iterations = dict.fromkeys(self.blocks, 0)
        self.result.t = t
        while pending and not self.ended:
            name = min(pending, key=lambda n: self.blocks[n].order)
            iterations[name] += 1
            if iterations[name] > ITERATIONS:
                raise CosimError(f"{name} asks for more than {ITERATIONS} event iterations at t = {t:.9g} s.")
            block = self.blocks[name]
            update = block.slave.update()
            self.result.ticks += [Tick(t, name, clock) for clock in update.ticks]
            if update.terminated:
                self._terminate(name, t, update.terminated)
                return
            block.next_event = update.next_event
            if not update.again:
                pending.discard(name)
            for receiver in self._send(name, t, touched):
                pending.add(receiver)
                touched.add(receiver)
        for name in touched:
            self._leave_event_mode(self.blocks[name])

    def _send(self, name: str, t: float, touched: set[str]) -> set[str]:
        """Carry the outputs of a slave to their receivers; return those for whom something changed."""
        receivers = set()
        for connection in self.system.from_slave(name):
            value = self.blocks[name].slave.get(connection.output)
            block = self.blocks[connection.target]
            if block.slave.get(connection.input) == value:
                continue
            if connection.target not in touched and connection.target not in receivers:
                self._bring(block, t)
            block.slave.set(connection.input, value)
            receivers.add(connection.target)
        return receivers

    def _bring(self, block: _Block, t: float) -> None:
        """Bring a slave that receives something to this instant, into event mode."""
        if block.t < t:
            self._step(block, t)
            self._require_announced(block, t)
        block.slave.enter_event_mode()

    def _require_announced(self, block: _Block, t: float) -> None:
        """Refuse a stop before `t`; within the tolerance before it, it is rounding."""
        if block.t < t - SIMULTANEOUS and not self.ended:
            raise CosimError(
                f"{block.slave.name} stopped at t = {block.t:.12g} s for an event that it had not announced, on the "
                f"way to {t:.12g} s: its nextEventTime is wrong."
            )

    def _step(self, block: _Block, t: float) -> Step:
        made = block.slave.step(block.t, t)
        self.result.steps += 1
        if made.reached < block.t or made.reached > t + SIMULTANEOUS:
            raise CosimError(
                f"{block.slave.name} stepped from {block.t:.12g} towards {t:.12g} s and says that it is at "
                f"{made.reached:.12g} s: that is outside the step."
            )
        block.t = made.reached
        if made.terminated:
            self._terminate(block.slave.name, made.reached, made.terminated)
        return made

    def _leave_event_mode(self, block: _Block) -> None:
        block.slave.enter_step_mode()
        block.version += 1
        if block.next_event is not None:
            if block.next_event <= block.t:
                raise CosimError(
                    f"{block.slave.name} is at t = {block.t:.12g} s and says that its next event is at "
                    f"{block.next_event:.12g} s: that is not ahead."
                )
            heapq.heappush(self._queue, (block.next_event, block.order, block.version, block.slave.name))

    def _next_instant(self, limit: float) -> tuple[float, set[str]]:
        """Find the next instant with events up to `limit`, and bring the slaves concerned there."""
        self._drop_obsolete()
        first = min(self._queue[0][0] if self._queue else math.inf, limit)
        stopped = self._watch_unpredictable(first)
        if stopped:
            first = min(block.t for block in stopped)
        due = {block.slave.name for block in stopped if block.t <= first + SIMULTANEOUS}
        instant = first
        while self._queue and self._queue[0][0] <= min(first + SIMULTANEOUS, limit):
            time, _, _, name = heapq.heappop(self._queue)
            instant = max(instant, time)
            due.add(name)
            self._drop_obsolete()
        for name in sorted(due, key=lambda n: self.blocks[n].order):
            block = self.blocks[name]
            if block.t < instant and not self.ended:
                self._step(block, instant)
            if not self.ended:
                block.slave.enter_event_mode()
        return instant, set() if self.ended else due

    def _drop_obsolete(self) -> None:
        while self._queue and self.blocks[self._queue[0][3]].version != self._queue[0][2]:
            heapq.heappop(self._queue)

    def _watch_unpredictable(self, horizon: float) -> list[_Block]:
        """Step the slaves that cannot predict to the horizon; return those that stopped at an event.

        Those that went beyond the first stop are restored and stepped again, to it.
        """
        watched = [block for block in self.blocks.values() if block.next_event is None and block.t < horizon]
        if not watched:
            return []
        saved = [(block, block.t, block.slave.save()) for block in watched]
        stopped: list[_Block] = []
        try:
            for block in watched:
                if self._step(block, horizon).event:
                    stopped.append(block)
                if self.ended:
                    return []
            first = min((block.t for block in stopped), default=horizon)
            for block, t, state in saved:
                if block.t > first + SIMULTANEOUS:
                    block.slave.restore(state)
                    block.t = t
                    self._step(block, first)
        finally:
            for block, _, state in saved:
                block.slave.release(state)
        return [block for block in stopped if block.t <= first + SIMULTANEOUS]

    def _terminate(self, name: str, t: float, why: Termination) -> None:
        self.result.terminate(name, t, why)

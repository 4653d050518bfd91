"""The scheduler of blocks that meet only at events: each is advanced only when something happens to it.

Between two events a block's flow is its own, so the block itself predicts its next event (`nextEventTime` in FMI 3.0).
The scheduler keeps those predictions in a queue, takes the earliest, lets that block jump, and brings only the
receivers of what it sent to that instant. Nothing is rolled back, and an event costs as much as it has receivers,
however many blocks there are. Blocks that cannot predict (they name no next event, or foresee only some of theirs) are
stepped to the earliest prediction and may stop before it; only they are saved and restored.

`hybrid_model.schedule.event_network` runs automata with it, `cosim.masters` FMUs and automata alike.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from hybrid_model.errors import SchedulingError, SimulationError
from hybrid_model.scales import one_instant
from hybrid_model.schedule.blocks import Block, Step, Termination

ITERATIONS = 10_000
"""Event iterations of one block at one instant, and steps of it in a row that lead nowhere, at most."""


class Wire(Protocol):
    """A scalar signal that leaves a block: its output, and the block and input that it goes to."""

    @property
    def output(self) -> str:
        """Output of the block that it leaves."""

    @property
    def target(self) -> str:
        """Name of the block that it goes to."""

    @property
    def input(self) -> str:
        """Input of that block."""

    def carried(self, value: Any) -> Any:
        """Return what arrives of a value that leaves."""


class Tick(NamedTuple):
    """A tick of an output clock: `slave`'s `clock` at `t` in s."""

    t: float
    slave: str
    clock: str


ANNOUNCED = "announced"
"""Of an event: it was at the time that its block had named."""
STOPPED = "stopped"
"""Of an event: its block ended a step there."""
RECEIVED = "received"
"""Of an event: what its block received at that instant brought it about."""


class Event(NamedTuple):
    """An event of a block, at `t` in s; `kind` is how it became known, such as `ANNOUNCED`."""

    t: float
    block: str
    kind: str


class _Link:
    """A wire under way: what comes over it, and the input that it leads to."""

    __slots__ = ("carried", "holds", "input", "target", "write")

    def __init__(self, wire: Wire, target: _Place) -> None:
        self.carried, self.input, self.target = wire.carried, wire.input, target
        self.write = target.block.writer(wire.input)
        # An input is read once: what it holds later is what was sent to it.
        self.holds = target.block.get(wire.input)


@dataclass(slots=True, eq=False)
class _Place:
    """A block and where it is."""

    block: Block
    order: int
    t: float
    t_event: float
    next_event: float | None = None
    version: int = 0
    stalls: int = 0
    read: Callable[[], list[Any]] | None = None
    links: Sequence[tuple[int, _Link]] = ()

    def connect(self, wires: Iterable[Wire], places: Mapping[str, _Place]) -> Callable[[], list[Any]]:
        """Make ready what is sent, and return what reads it: no more of the block is read in a run than that."""
        outputs: dict[str, int] = {}
        self.links = [
            (outputs.setdefault(wire.output, len(outputs)), _Link(wire, places[wire.target])) for wire in wires
        ]
        self.read = self.block.reader(list(outputs)) if outputs else list
        return self.read


class Scheduler:
    """The queue of predicted events, and the event iteration at one instant.

    Parameters
    ----------
    blocks : mapping
        Name -> block, in the order in which simultaneous events are handled; all of them in event mode.
    wires_from : callable
        Name of a block -> the wires that leave it. All carry signals that change only at events.
    t_start : float
        Time in s.
    tolerance : float, optional
        In s: events of different blocks closer than this are handled at one instant, in the order of the blocks;
        default: as the run has it (`hybrid_model.scales`).
    watch : callable, optional
        ``watch(t)`` is called before and after the events of each instant that `advance_to` comes to. All blocks are
        brought there for it, so an event then costs as much as there are blocks.

    Attributes
    ----------
    t : float
        Time in s up to which all events are handled.
    ticks : list of Tick
        Ticks of output clocks, in order.
    events : list of Event
        Instants at which blocks had events, in order: of their own, and after the start those that are known to come of
        what a block received: it told of them, a clock ticked, it asked for an iteration, or it sent something new.
    steps : int
        Steps made by all blocks together.
    ended : (str, float, Termination) or None
        The block that ended the run, when, and why.
    """

    def __init__(
        self,
        blocks: Mapping[str, Block],
        wires_from: Callable[[str], Iterable[Wire]],
        t_start: float,
        tolerance: float | None = None,
        watch: Callable[[float], None] | None = None,
    ) -> None:
        self.t = self._t_start = t_start
        self.ticks: list[Tick] = []
        self.events: list[Event] = []
        self.steps = 0
        self.ended: tuple[str, float, Termination] | None = None
        self._wires_from = wires_from
        self._tolerance = tolerance
        self._watch = watch
        self._places = {name: _Place(block, k, t_start, t_start) for k, (name, block) in enumerate(blocks.items())}
        self._in_order = list(self._places.values())
        # Blocks go by their order from here on: numbers sort themselves.
        self._unpredictable: set[int] = set()
        self._idle: set[int] = set()
        self._moved: dict[int, bool] = {}
        self._left: set[int] = set()
        self._queue: list[tuple[float, int, int]] = []

    @property
    def next_event(self) -> float:
        """Time in s of the first event that is foreseen; infinity if none is."""
        self._drop_obsolete()
        return self._queue[0][0] if self._queue else math.inf

    def advance_to(self, limit: float) -> None:
        """Handle all events up to and including `limit` in s, then bring every block there.

        Raises
        ------
        SchedulingError
            If a block asks for event iterations without end, or its predictions contradict its steps.
        """
        while not self.ended:
            t, due = self._next_instant(limit)
            if not due:
                break
            self._happen(t, due)
        for place in self._in_order:
            while not self.ended and place.t < limit:
                if self._step(place, limit).event and not self.ended:
                    self._require_announced(place, limit)
                    self._happen(limit, {place.order})
        if not self.ended:
            self.t = limit

    def approach(self, limit: float) -> None:
        """Handle all events before `limit` in s, and bring every block there; those that have events there keep them.

        They come with `handle_events`, after what changes from outside at that time (rule 5).
        """
        while not self.ended:
            t, due = self._next_instant(limit)
            if not due:
                break
            if limit - t <= min(self._instant(self._in_order[order], t) for order in due):
                self._left = due
                break
            self._happen(t, due)
        for place in self._in_order:
            if not self.ended and place.t < limit and place.order not in self._left and self._step(place, limit).event:
                self._require_announced(place, limit)
                self._left.add(place.order)
        if not self.ended:
            self.t = limit

    def bring_to_the_end(self) -> None:
        """Bring all blocks to where one of them has ended the run, if it has: what is read then is of one time."""
        if not self.ended:
            return
        ended = self.ended
        for place in self._in_order:
            # One that stops before has an event of that instant, which nobody handles any more.
            if place.t < ended[1] and place.block.name != ended[0]:
                self._step(place, ended[1])
        self.ended = ended

    def handle_events(self, t: float, due: Collection[str]) -> None:
        """Iterate the events of one instant: jumps in the order of the blocks, signals travelling at once (rule 6).

        Parameters
        ----------
        t : float
            The instant, in s.
        due : collection of str
            Blocks that are there, in event mode; those that `approach` has left with events are added.
        """
        given, left = {self._places[name].order for name in due}, sorted(self._left)
        self._left = set()
        for order in left:
            if order not in given:
                self._in_order[order].block.enter_event_mode()
        self._idle.clear()
        known = self._known(t, left)
        self._iterate(t, given.union(left))
        self._list(t, known)

    def _iterate(self, t: float, due: set[int]) -> None:
        pending, touched = set(due), set(due)
        self._moved.clear()
        iterations: dict[int, int] = {}
        self.t = t
        while pending and not self.ended:
            order = min(pending)
            place = self._in_order[order]
            iterations[order] = iterations.get(order, 0) + 1
            if iterations[order] > ITERATIONS:
                raise SchedulingError(
                    f"{place.block.name} asks for more than {ITERATIONS} event iterations at t = {t:.9g} s."
                )
            try:
                again, ticks, place.next_event, terminated, idle = place.block.update()
            except SimulationError as error:
                raise _of_block(place.block.name, error) from error
            if ticks:
                self.ticks += [Tick(t, place.block.name, clock) for clock in ticks]
            if idle and iterations[order] == 1:
                self._idle.add(order)
            # Predictions end at the stop time, where there may be no event.
            if again or ticks or (place.block.tells_jumps and not idle):
                self._moved[order] = True
            else:
                self._moved.setdefault(order, False)
            if terminated:
                self.ended = place.block.name, t, terminated
                return
            if not again:
                pending.discard(order)
            self._send(place, t, pending, touched)
        for order in touched:
            self._leave_event_mode(self._in_order[order])

    def _happen(self, t: float, due: set[int]) -> None:
        """Handle the events of blocks that are at their instant."""
        if self._watch:
            due = self._bring_all(t, due)
            self._watch(t)
        if self.ended:
            return
        known = self._known(t, sorted(due))
        for order in known:
            self._in_order[order].block.enter_event_mode()
        self._idle.clear()
        self._iterate(t, due)
        self._list(t, known)
        if self._watch:
            self._watch(t)

    def _list(self, t: float, known: Mapping[int, Event]) -> None:
        """List the events at `t` in s: those that were known before they were handled, and what these brought about."""
        own = {order: event for order, event in known.items() if order not in self._idle}
        for order, shown in self._moved.items():
            if order in own:
                self.events.append(own[order])
            elif shown and t > self._t_start:
                self.events.append(Event(t, self._in_order[order].block.name, RECEIVED))

    def _known(self, t: float, due: Iterable[int]) -> dict[int, Event]:
        """Return the events of blocks at `t` in s, by what is known of them before they are handled."""
        events = {}
        for order in due:
            place = self._in_order[order]
            foreseen = math.inf if place.next_event is None else place.next_event
            kind = ANNOUNCED if abs(foreseen - t) <= self._instant(place, t) else STOPPED
            events[order] = Event(t, place.block.name, kind)
        return events

    def _bring_all(self, t: float, due: set[int]) -> set[int]:
        """Bring all blocks to an instant; return those that have events there."""
        behind = [place for place in self._in_order if place.t < t and place.order not in due]
        stopped = [place for place in behind if not self.ended and self._step(place, t).event]
        for place in stopped:
            self._require_announced(place, t)
        return due | {place.order for place in stopped}

    def _send(self, place: _Place, t: float, pending: set[int], touched: set[int]) -> None:
        """Carry the outputs of a block to their receivers; those for whom something changed are pending."""
        values = (place.read or place.connect(self._wires_from(place.block.name), self._places))()
        for index, link in place.links:
            value, target = link.carried(values[index]), link.target
            if link.holds == value:
                continue
            link.holds = value
            self._moved[place.order] = True
            if target.order not in touched:
                self._require_behind(target, t, place.block.name)
                self._bring(target, t)
                touched.add(target.order)
            link.write(value)
            pending.add(target.order)

    def _bring(self, place: _Place, t: float) -> None:
        """Bring a block that receives something to this instant, into event mode."""
        if place.t < t:
            self._step(place, t)
            self._require_announced(place, t)
        place.block.enter_event_mode()

    def _require_behind(self, place: _Place, t: float, sender: str) -> None:
        if place.t > t and place.t > t + self._instant(place, t):
            raise SchedulingError(
                f"{sender} sends to {place.block.name} at t = {t:.12g} s, but {place.block.name} is at "
                f"{place.t:.12g} s already and cannot return to an earlier state: use the fixed-step master."
            )

    def _require_announced(self, place: _Place, t: float) -> None:
        """Refuse a stop before `t`; at the same instant, it is rounding."""
        if place.t < t and place.t < t - self._instant(place, t) and not self.ended:
            raise SchedulingError(
                f"{place.block.name} stopped at t = {place.t:.12g} s for an event that it had not announced, on the "
                f"way to {t:.12g} s: its nextEventTime is wrong."
            )

    def _step(self, place: _Place, t: float) -> Step:
        try:
            made = place.block.step(place.t, t)
        except SimulationError as error:
            raise _of_block(place.block.name, error) from error
        reached, _, terminated = made
        self.steps += 1
        if reached < place.t or (reached > t and reached > t + self._instant(place, t)):
            raise SchedulingError(
                f"{place.block.name} stepped from {place.t:.12g} towards {t:.12g} s and says that it is at "
                f"{reached:.12g} s: that is outside the step."
            )
        # Blocks may have one event after the other where they are, but not without end.
        place.stalls = 0 if reached > place.t or terminated else place.stalls + 1
        if place.stalls > ITERATIONS:
            raise SchedulingError(
                f"{place.block.name} gets no further than t = {place.t:.12g} s: each of its last {ITERATIONS} steps "
                "ended there with an event."
            )
        place.t = reached
        if terminated:
            self.ended = place.block.name, reached, terminated
        return made

    def _leave_event_mode(self, place: _Place) -> None:
        place.block.enter_step_mode()
        place.version += 1
        place.t_event = place.t
        foreseen = place.next_event
        predicts = foreseen is not None and place.block.foresees
        (self._unpredictable.discard if predicts else self._unpredictable.add)(place.order)
        if foreseen is None:
            return
        if foreseen <= place.t:
            raise SchedulingError(
                f"{place.block.name} is at t = {place.t:.12g} s and says that its next event is at {foreseen:.12g} s: "
                "that is not ahead."
            )
        heapq.heappush(self._queue, (foreseen, place.order, place.version))

    def _next_instant(self, limit: float) -> tuple[float, set[int]]:
        """Find the next instant with events up to `limit`, and bring the blocks concerned there."""
        queue = self._queue
        self._drop_obsolete()
        first = min(queue[0][0] if queue else math.inf, limit)
        stopped = self._watch_unpredictable(first) if self._unpredictable else []
        if stopped:
            first = min(place.t for place in stopped)
        due = {place.order for place in stopped}
        instant = first
        while queue and queue[0][0] <= limit and self._is_at(first):
            time, order, _ = heapq.heappop(queue)
            instant = max(instant, time)
            due.add(order)
            self._drop_obsolete()
        for order in sorted(due):
            place = self._in_order[order]
            # What has stopped for an event is there; FMI allows no step before it is handled.
            if place.t < instant and place not in stopped and not self.ended:
                self._step(place, instant)
        return instant, set() if self.ended else due

    def _is_at(self, t: float) -> bool:
        """Return whether the first prediction is of the instant `t` in s."""
        time, order, _ = self._queue[0]
        return time <= t or time <= t + self._instant(self._in_order[order], t)

    def _instant(self, place: _Place, t: float) -> float:
        """Return in s how far a block's event may be from `t` and still be of that instant (rule 6)."""
        if self._tolerance is not None:
            return self._tolerance
        return one_instant(t, self._t_start, place.t_event)

    def _drop_obsolete(self) -> None:
        while self._queue and self._in_order[self._queue[0][1]].version != self._queue[0][2]:
            heapq.heappop(self._queue)

    def _watch_unpredictable(self, horizon: float) -> list[_Place]:
        """Step the blocks that cannot predict to the horizon; return those that stopped at an event.

        Each is stepped to the first stop of those before it. Those that are beyond the last one's return there; what
        cannot return stays ahead, for as long as nobody sends anything to it.
        """
        watched = [place for place in map(self._in_order.__getitem__, self._unpredictable) if place.t < horizon]
        watched.sort(key=lambda place: (not place.block.can_restore, place.order))
        # Nobody can be behind the one that is stepped last.
        saved = [(place, place.t, place.block.save()) for place in watched[:-1] if place.block.can_restore]
        stopped: list[_Place] = []
        first = horizon
        try:
            for place in watched:
                # Who stops where the others are is alone with that: there are no steps of no length.
                if place.t < first and self._step(place, first).event:
                    stopped.append(place)
                    first = min(first, place.t)
                if self.ended:
                    first = min(first, place.t)
                    break
            for place, t, state in saved:
                if place.t > first + self._instant(place, first):
                    place.block.restore(state)
                    place.t = t
                    stopped = [other for other in stopped if other is not place]
                    if t < first and self._step(place, first).event:
                        stopped.append(place)
        finally:
            for place, _, state in saved:
                place.block.release(state)
        if self.ended:
            return []
        for place in stopped:
            if place.t > first + self._instant(place, first) and not place.block.can_restore:
                heapq.heappush(self._queue, (place.t, place.order, place.version))
        return [place for place in stopped if place.t <= first + self._instant(place, first)]


def _of_block(name: str, error: SimulationError) -> SimulationError:
    """Return what a block of many says in an error, with its name: many are of one class."""
    return SimulationError(f"{name}: {error}")

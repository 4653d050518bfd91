"""Blocks of automata that have begun, joined to one network on the scheduler in C.

Its calls and results are those of `hybrid_model.schedule.scheduler.Scheduler`, which runs any blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping

import numpy as np

from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import SchedulingError, SimulationError
from hybrid_model.native.network_run import NativeNetwork, NetworkAdvance, PartGroup
from hybrid_model.native.run import Ending
from hybrid_model.scales import one_instant
from hybrid_model.schedule.blocks import StiffPart, Termination
from hybrid_model.schedule.native_block import OF_THE_RUN, NativeBlock
from hybrid_model.schedule.native_network import EVENTS_AT_ONCE, STEPS_AHEAD
from hybrid_model.schedule.part_table import ROWS, wires_by_source
from hybrid_model.schedule.scheduler import ANNOUNCED, RECEIVED, Event, Tick, Wire


class JoinedBlocks:
    """The queue of predicted events, and the event iteration at one instant; see `Scheduler`.

    Parameters
    ----------
    blocks : mapping
        Name -> block that has begun, in the order in which simultaneous events are handled.
    wires_from : callable
        Name of a block -> the wires that leave it; what arrives is what leaves. All carry signals that change only at
        events.
    span : (float, float)
        Start and end in s.
    give : callable
        ``give(name, variable, value)`` refuses a value that is not finite: it is called with the first that a block is
        sent.
    watch : callable, optional
        ``watch(t)`` is called before and after the events of each instant that `advance_to` comes to.

    Attributes
    ----------
    ticks, events, ended
        As those of `Scheduler`.
    """

    def __init__(
        self,
        blocks: Mapping[str, NativeBlock],
        wires_from: Callable[[str], Iterable[Wire]],
        span: tuple[float, float],
        give: Callable[[str, str, float], None],
        watch: Callable[[float], None] | None = None,
    ) -> None:
        self.ticks: list[Tick] = []
        self.events: list[Event] = []
        self.ended: tuple[str, float, Termination] | None = None
        self._t_start, self._give = span[0], give
        self._names, self._blocks, self._watch = list(blocks), list(blocks.values()), watch
        self._listed = [-np.inf] * len(blocks)
        self._numbers = {name: part for part, name in enumerate(blocks)}
        self._network = _network(self._blocks, self._names, wires_from)
        self._network.log_instants()
        self._network.require_finite()
        self._network.start(*span, computed=False)
        for part, block in enumerate(self._blocks):
            self._network.adopt(part, block.run)

    @property
    def t(self) -> float:
        """Time in s up to which all events are handled."""
        return self._network.time

    @property
    def steps(self) -> int:
        """Steps made by all parts together."""
        return self._network.steps

    @property
    def next_event(self) -> float:
        """Time in s before which nothing is foreseen to happen."""
        return self._network.next_event

    def advance_to(self, limit: float) -> None:
        """Handle all events up to and including `limit` in s, then bring every part there.

        Raises
        ------
        SchedulingError
            If a part asks for event iterations without end.
        SimulationError
            If a part's maps or its flow fail.
        StiffPart
            If a flow needs derivatives that are not there.
        """
        self._go_on(limit, self._network.advance)

    def approach(self, limit: float) -> None:
        """Handle all events before `limit` in s; those there come with `handle_events`. See `Scheduler.approach`."""
        self._go_on(limit, self._network.approach, leaves_last=True)

    def _go_on(
        self, limit: float, to_limit: Callable[[float, int], NetworkAdvance], *, leaves_last: bool = False
    ) -> None:
        """Go from instant to instant if somebody watches, and then to `limit` in s; events there may be left."""
        advance = NetworkAdvance.GOING
        while self._watch and advance is NetworkAdvance.GOING:
            advance = self._network.next_instant(limit)
            if advance is NetworkAdvance.GOING:
                if leaves_last and limit - self.t <= one_instant(limit, self._t_start, self._t_start):
                    return
                self._watch(self.t)
                if not self._network.handle():
                    advance = self._network.end.how
                self._take()
                self._watch(self.t)
        if advance in (NetworkAdvance.GOING, NetworkAdvance.REACHED):
            advance = NetworkAdvance.GOING
            while advance is NetworkAdvance.GOING:
                advance = to_limit(limit, EVENTS_AT_ONCE)
                self._take()
        self._note(advance)

    def handle_events(self, t: float, due: Collection[str]) -> None:
        """Let happen what is due at the time of the network, by what parts have been given too.

        Parameters
        ----------
        t : float
            That time, in s.
        due : collection of str
            The parts concerned.
        """
        del t, due
        going = self._network.handle()
        self._take()
        if not going:
            self._note(self._network.end.how)

    def get(self, name: str, variable: str) -> float:
        """Return the present value of a scalar of a part."""
        part = self._numbers[name]
        block = self._blocks[part]
        value = self._network.peek(part, *block.place(variable))
        if value is None:
            raise SimulationError(f"{name}: {block.automaton.name}: {self._network.problem(part)}")
        return value

    def set(self, name: str, variable: str, value: float) -> None:
        """Give a part a value now; `handle_events` has it bring about what it does."""
        part = self._numbers[name]
        if not self._network.receive(part, *self._blocks[part].place(variable), float(value)):
            self._note(self._network.end.how)

    def _take(self) -> None:
        events = self._network.take_events()
        for t, part, jump, own in zip(events.t, events.part, events.jump, events.values[:, 0], strict=True):
            name = self._names[part]
            self.ticks += [Tick(float(t), name, clock) for number, clock in self._blocks[part].clocks if number == jump]
            if own or (t > self._t_start and self._listed[part] < t):
                self.events.append(Event(float(t), name, ANNOUNCED if own else RECEIVED))
                self._listed[part] = t

    def _note(self, advance: NetworkAdvance) -> None:
        """Note why the run is over, if it is."""
        if advance in (NetworkAdvance.GOING, NetworkAdvance.REACHED):
            return
        if advance is NetworkAdvance.STIFF:
            raise StiffPart
        end = self._network.end
        name, automaton = self._names[end.part], self._blocks[end.part].automaton.name
        if end.how is NetworkAdvance.NOT_FINITE:
            self._give(name, layout_of(self._blocks[end.part].automaton).names(Kind.INPUT)[end.input], end.value)
        if end.how is NetworkAdvance.REFUSED:
            raise SchedulingError(f"{name} {end.message}")
        if end.ending not in OF_THE_RUN:
            raise SimulationError(f"{name}: {automaton}: {end.message}")
        self.ended = name, end.t, Termination(f"{automaton}: {end.message}", end.ending is Ending.ZENO)


def _network(blocks: list[NativeBlock], names: list[str], wires_from: Callable[[str], Iterable[Wire]]) -> NativeNetwork:
    """Return the parts in groups with the same maps and options."""
    kinds: dict[object, int] = {}
    keys = [(block.run.model.pointer, bytes(block.run.options)) for block in blocks]
    group_of = np.array([kinds.setdefault(key, len(kinds)) for key in keys], np.uint32)
    numbers = {name: part for part, name in enumerate(names)}
    signals: list[dict[tuple[Kind, int], int]] = [{} for _ in kinds]
    rows = []
    for part, name in enumerate(names):
        for wire in wires_from(name):
            sent = signals[group_of[part]]
            signal = sent.setdefault(blocks[part].place(wire.output), len(sent))
            target = numbers[wire.target]
            rows.append((part, signal, target, blocks[target].place(wire.input)[1]))
    wires = wires_by_source(len(blocks), *np.array(rows, np.uint32).reshape(-1, 4).T)
    first = [blocks[int(np.argmax(group_of == k))] for k in range(len(kinds))]
    groups = [
        PartGroup(block.run.model, tuple(signals[k]), _rows(block, int(np.sum(group_of == k))))
        for k, block in enumerate(first)
    ]
    network = NativeNetwork(groups, group_of, wires)
    for k, block in enumerate(first):
        network.set_options(k, block.run.options)
        network.options(k).look_ahead_steps = STEPS_AHEAD
    return network


def _rows(block: NativeBlock, count: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return rows for what parts begin with; the values come with the blocks."""
    sizes = layout_of(block.automaton).sizes
    x, z, u, p = (np.zeros((count, sizes[kind])) for kind in ROWS)
    return x, z, u, p

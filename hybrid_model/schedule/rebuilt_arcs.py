"""The arcs of the parts of a network, made again from its events when they are asked for."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.network_run import NO_JUMP, EventColumns, NativeNetwork
from hybrid_model.native.replay import EVENT, Happening, replayed
from hybrid_model.native.run import NativeRun
from hybrid_model.native.simulation import fill_options
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.arc_values import ReceivedValues
from hybrid_model.record.row_flows import RowFlows, RowJumps
from hybrid_model.record.run_record import RunRecord
from hybrid_model.scales import one_instant
from hybrid_model.schedule.outside import Outside
from hybrid_model.schedule.part_table import ROWS, PartTable
from hybrid_model.solver import Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard


class EventTable:
    """The events of a run, part by part.

    Parameters
    ----------
    events : EventColumns
        All of them, in order.
    parts : int
        How many parts there are.
    outside : Outside
        What they were given.
    """

    def __init__(self, events: EventColumns, parts: int, outside: Outside) -> None:
        self.events, self._parts, self._outside = events, parts, outside

    @functools.cached_property
    def _rows(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        order = np.argsort(self.events.part, kind="stable")
        return order, np.searchsorted(self.events.part[order], np.arange(self._parts + 1))

    def rows(self, part: int) -> npt.NDArray[np.int64]:
        """Return the numbers of a part's events, in order."""
        order, first = self._rows
        return order[first[part] : first[part + 1]]

    def of_part(self, table: PartTable, part: int) -> npt.NDArray[np.void]:
        """Return what happened to a part: its jumps, and what it received and was given (see `EVENT`)."""
        events, (order, first) = self.events, table.arrivals
        own = self.rows(part)
        own = own[events.jump[own] != NO_JUMP]
        wires = order[first[part] : first[part + 1]]
        sent = [self.rows(int(table.sources[wire])) for wire in wires]
        received = np.concatenate([np.zeros(0, np.int64), *sent])
        lengths = [len(rows) for rows in sent]
        inputs = np.repeat(table.wires.inputs[wires], lengths)
        values = events.values[received, np.repeat(table.wires.signals[wires], lengths)]
        found = np.zeros(len(own) + len(received), EVENT)
        rows = np.concatenate([own, received])
        found["t"], found["kind"][len(own) :] = events.t[rows], Happening.RECEIVED
        found["number"] = np.concatenate([events.jump[own], inputs])
        found["value"][len(own) :] = values
        given, after = self._outside.of_part(part)
        found, places = np.concatenate([given, found]), np.concatenate([after - 0.5, rows])
        found = found[np.lexsort((found["kind"], places))]
        # A reception may have been sent some rounding before the receiver's own last event.
        found["t"] = np.maximum.accumulate(found["t"])
        return found


class RebuiltArcs(Mapping[str, HybridArc]):
    """The hybrid arcs of the parts; each is made from the events when it is first asked for.

    Parameters
    ----------
    table : PartTable
        The parts.
    events : EventTable
        What happened.
    span : (float, float)
        From the start to where the run ended, in s.
    solver : Solver
        Accuracy.
    zeno : ZenoGuard
        As in the run.
    stop, message
        How it ended.
    start : callable
        Makes the parts as they are at the start.
    declared : callable
        Number of a part -> its automaton, and its inputs and parameters as they were at the start.
    """

    def __init__(
        self,
        table: PartTable,
        events: EventTable,
        span: tuple[float, float],
        solver: Solver,
        zeno: ZenoGuard,
        stop: Stop,
        message: str,
        start: Callable[[], NativeNetwork],
        declared: Callable[[int], tuple[Automaton, Inputs]],
    ) -> None:
        self._table, self._events, self._span = table, events, span
        self._solver, self._zeno, self._stop, self._message = solver, zeno, stop, message
        self._start, self._declared = start, declared
        self._made: dict[str, HybridArc] = {}

    def __len__(self) -> int:
        return len(self._table.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._table.names)

    def __contains__(self, name: object) -> bool:
        return name in self._table.names

    def __getitem__(self, name: str) -> HybridArc:
        if name not in self._made:
            self._made[name] = self._rebuilt(self._table.names.index(name))
        return self._made[name]

    @functools.cached_property
    def _started(self) -> NativeNetwork:
        return self._start()

    def _rebuilt(self, part: int) -> HybridArc:
        table = self._table
        automaton, inputs = self._declared(part)
        run = NativeRun(table.groups[table.group_of[part]].model)
        fill_options(run.options, self._solver, self._zeno, layout_of(automaton).sizes[Kind.STATE])
        # What has happened is within the bounds of the run.
        run.options.most_jumps = math.inf
        starts = [self._started.read_part(part, kind) for kind in ROWS]
        happened = self._events.of_part(table, part)
        end = self._span[1]
        if self._stop is not Stop.HORIZON:
            end = max([self._span[0], *happened["t"]])
        rows, before = replayed(run, starts, (self._span[0], end), happened)
        read = ReceivedValues(
            automaton, inputs, _received(starts[2][: len(inputs.held)], self._span[0], happened, before)
        )
        flows = [replace(flow, z=np.append(flow.z, j)) for j, flow in enumerate(RowFlows(rows))]
        given = self._solver.event_tolerance
        tolerance = one_instant(end, self._span[0], self._span[0]) if given is None else given
        engine = "native: its maps are compiled; its flows were made again from the events."
        return HybridArc(RunRecord(read, flows, RowJumps(rows), self._stop, self._message, tolerance, engine=engine))


def _received(
    held: FloatArray, start: float, happened: npt.NDArray[np.void], before: npt.NDArray[np.uint64]
) -> list[tuple[float, int, FloatArray]]:
    """Return the hybrid times from which on inputs had other values, and those."""
    received = [(start, 0, held)]
    for event, j in zip(happened, before, strict=True):
        if event["kind"] == Happening.RECEIVED and held[event["number"]] != event["value"]:
            held = held.copy()
            held[event["number"]] = event["value"]
            received.append((float(event["t"]), int(j), held))
    return received

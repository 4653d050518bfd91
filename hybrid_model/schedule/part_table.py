"""The parts of a network as rows of tables, as the scheduler in C runs them: a group for all parts with equal maps."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition, ElementWire
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.kept_models import model_of
from hybrid_model.native.network_run import NativeNetwork, Numbers, PartGroup, PartWires
from hybrid_model.native.run import NativeModel
from hybrid_model.reference.execution import Execution
from hybrid_model.reference.first_look import checked

ROWS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
"""What a part begins with, in the order of its rows."""
Place = tuple[Kind, int]


@dataclass(frozen=True, eq=False)
class PartTable:
    """A network of parts that meet only at events.

    Attributes
    ----------
    name : str
        Of the network.
    names : sequence of str
        Of the parts, in the order of simultaneous jumps.
    automata : tuple of Automaton
        Of each group, one that declares what its parts have.
    groups : tuple of PartGroup
        Parts with equal maps.
    group_of, row_of : ndarray of uint32, shape (parts,)
        The group of each part, and its row there.
    wires : PartWires
        Between the parts.
    computed : bool
        Whether start maps are still to be applied.
    """

    name: str
    names: Sequence[str]
    automata: tuple[Automaton, ...]
    groups: tuple[PartGroup, ...]
    group_of: Numbers
    row_of: Numbers
    wires: PartWires
    computed: bool

    def network(self) -> NativeNetwork:
        """Return the parts in memory, before the start."""
        return NativeNetwork(self.groups, self.group_of, self.wires)

    def starts(self, part: int) -> list[FloatArray]:
        """Return what a part begins with."""
        return [rows[self.row_of[part]] for rows in self.groups[self.group_of[part]].starts]

    @functools.cached_property
    def arrivals(self) -> tuple[Numbers, Numbers]:
        """The wires in the order of the parts that they go to, and where those of each part begin."""
        order = np.argsort(self.wires.targets, kind="stable").astype(np.uint32)
        counts = np.bincount(self.wires.targets, minlength=len(self.group_of))
        return order, np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)

    @functools.cached_property
    def sources(self) -> Numbers:
        """The part that each wire leaves."""
        first = self.wires.first.astype(np.int64)
        return np.repeat(np.arange(len(first) - 1, dtype=np.uint32), first[1:] - first[:-1])


def table_of(network: Composition, executions: Mapping[str, Execution], *, stiff: bool) -> PartTable:
    """Put the parts of a composition into groups.

    Parameters
    ----------
    network : Composition
        Whose parts meet only at events.
    executions : mapping
        Part -> its run at the start.
    stiff : bool
        Whether flows may need a method for stiff ones.

    Raises
    ------
    TraceError
        If a part's maps cannot be traced, or its inputs from outside follow time.
    BuildError
        If there is no compiler, or it fails.
    """
    parts = list(network.parts)
    models = {part: _model(executions[part], stiff=stiff) for part in parts}
    # Automata of other names may have the same code, which is in memory once.
    number: dict[int, int] = {}
    group_of = np.array([number.setdefault(models[part].pointer, len(number)) for part in parts], np.uint32)
    members: list[list[str]] = [[] for _ in number]
    for part, group in zip(parts, group_of, strict=True):
        members[group].append(part)
    row_of = np.zeros(len(parts), np.uint32)
    for group in range(len(number)):
        row_of[group_of == group] = np.arange(len(members[group]), dtype=np.uint32)
    signals, wires = _wired(network, parts, group_of, len(number))
    groups = tuple(
        PartGroup(models[names[0]], signals[group], _stacked([executions[part] for part in names]))
        for group, names in enumerate(members)
    )
    automata = tuple(network.parts[names[0]] for names in members)
    return PartTable(network.name, parts, automata, groups, group_of, row_of, wires, computed=False)


def _model(run: Execution, *, stiff: bool) -> NativeModel:
    return model_of(run.automaton, lambda: checked(run), stiff=stiff)


def _stacked(runs: Sequence[Execution]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    columns = (
        [run.x for run in runs],
        [run.z for run in runs],
        [run.inputs.held for run in runs],
        [run.p for run in runs],
    )
    x, z, u, p = (np.array(rows, np.float64).reshape(len(runs), -1) for rows in columns)
    return x, z, u, p


def _wired(
    network: Composition, parts: Sequence[str], group_of: Numbers, groups: int
) -> tuple[list[tuple[Place, ...]], PartWires]:
    """Return the signals that leave the parts of each group, and the wires by their numbers."""
    numbers = {part: k for k, part in enumerate(parts)}
    places = [_places(network.parts[part]) for part in parts]
    leaving: list[dict[Place, int]] = [{} for _ in range(groups)]
    rows: list[tuple[int, int, int, int]] = []
    wire: ElementWire
    for wire in network.wires:
        source, target = numbers[wire.source], numbers[wire.target]
        signals = leaving[group_of[source]]
        signal = signals.setdefault(places[source][wire.output], len(signals))
        rows.append((source, signal, target, places[target][wire.input][1]))
    table = np.array(rows, np.uint32).reshape(-1, 4)
    return [tuple(signals) for signals in leaving], wires_by_source(len(parts), *table.T)


def wires_by_source(parts: int, source: Numbers, signal: Numbers, target: Numbers, inputs: Numbers) -> PartWires:
    """Order wires by the parts that they leave, as rows of a compressed table.

    Parameters
    ----------
    parts : int
        How many there are.
    source, signal, target, inputs : ndarray of uint32, shape (wires,)
        Of each wire: the part it leaves and which of its signals, the part it goes to and which of its inputs.
    """
    order = np.argsort(source, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(source, minlength=parts))]).astype(np.uint64)
    return PartWires(first, *(np.ascontiguousarray(column[order], np.uint32) for column in (signal, target, inputs)))


def _places(automaton: Automaton) -> dict[str, Place]:
    layout = layout_of(automaton)
    return {element: (kind, k) for kind in Kind for k, element in enumerate(layout.names(kind))}

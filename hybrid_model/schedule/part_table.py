"""The parts of a network as rows of tables, as the scheduler in C runs them: a group for all parts with equal maps."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition, ElementWire
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.variables import FloatArray, Kind, unknown_name
from hybrid_model.errors import DeclarationError
from hybrid_model.native.kept_models import model_of
from hybrid_model.native.network_run import NativeNetwork, Numbers, PartGroup, PartWires
from hybrid_model.native.run import NativeModel
from hybrid_model.reference.execution import Execution
from hybrid_model.reference.first_look import checked
from hybrid_model.schedule.network_arrays import Network
from hybrid_model.schedule.outside import Given

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

    @property
    def width(self) -> int:
        """How many signals leave a part, at most."""
        return max((len(group.signals) for group in self.groups), default=0)

    @property
    def about(self) -> dict[str, Any]:
        """What `NetworkEvents` needs besides the columns of events."""
        kinds = self.group_of if len(self.groups) > 1 else np.uint32(0)
        names = [
            [layout_of(automaton).names(kind)[place] for kind, place in group.signals]
            for automaton, group in zip(self.automata, self.groups, strict=True)
        ]
        jumps = [[info.name for info in automaton.jumps] for automaton in self.automata]
        return {"jumps": jumps, "kind_of": kinds.tolist(), "signals": names}

    def values_of(self, ends: Sequence[Mapping[Kind, FloatArray]], name: str) -> FloatArray:
        """Return a state of all parts, one row a part, from the vectors of each group.

        Raises
        ------
        DeclarationError
            If it is no state of all parts, of one shape.
        """
        found: list[tuple[FloatArray, tuple[int, ...]]] = []
        for automaton, vectors in zip(self.automata, ends, strict=True):
            places = {place.variable.name: place for kind in vectors for place in layout_of(automaton).places[kind]}
            if name not in places:
                raise DeclarationError(unknown_name(automaton.name, name, places))
            variable = places[name].variable
            found.append((vectors[variable.kind][:, places[name].at], variable.shape))
        shapes = {shape for _, shape in found}
        if len(shapes) > 1:
            raise DeclarationError(f"{self.name}: {name} has several shapes, {shapes}: ask the arcs of single parts.")
        values = np.empty((len(self.group_of), *shapes.pop())) if shapes else np.empty(0)
        for k, (rows, shape) in enumerate(found):
            values[self.group_of == k] = rows.reshape(len(rows), *shape)
        return values

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


def table_of(
    network: Composition, executions: Mapping[str, Execution], given: Mapping[int, Given], *, stiff: bool
) -> PartTable:
    """Put the parts of a composition into groups.

    Parameters
    ----------
    network : Composition
        Whose parts meet only at events.
    executions : mapping
        Part -> its run at the start.
    given : mapping
        Number of a part -> what it is given from outside, where that changes.
    stiff : bool
        Whether flows may need a method for stiff ones.

    Raises
    ------
    TraceError
        If a part's maps cannot be traced.
    BuildError
        If there is no compiler, or it fails.
    """
    parts = list(network.parts)
    own = [given.get(k) for k in range(len(parts))]
    models = {part: _model(executions[part], one, stiff=stiff) for part, one in zip(parts, own, strict=True)}
    # Automata of other names may have the same code, which is in memory once.
    number: dict[int, int] = {}
    group_of = np.array([number.setdefault(models[part].pointer, len(number)) for part in parts], np.uint32)
    members: list[list[int]] = [[] for _ in number]
    for k, group in enumerate(group_of):
        members[group].append(k)
    row_of = np.zeros(len(parts), np.uint32)
    for group in range(len(number)):
        row_of[group_of == group] = np.arange(len(members[group]), dtype=np.uint32)
    signals, wires = _wired(network, parts, group_of, len(number))
    groups = tuple(
        PartGroup(models[parts[of[0]]], signals[group], _stacked([_begun(executions[parts[k]], own[k]) for k in of]))
        for group, of in enumerate(members)
    )
    automata = tuple(network.parts[parts[of[0]]] for of in members)
    return PartTable(network.name, parts, automata, groups, group_of, row_of, wires, computed=False)


def table_of_arrays(
    network: Network, given: Mapping[int, Given], start: float, stop: float, *, stiff: bool
) -> PartTable:
    """Put a network that is given as arrays into groups; its start values are computed when it starts.

    Parameters
    ----------
    network : Network
        Copies of few parts.
    given : mapping
        Number of a part -> what it is given from outside, where that changes.
    start, stop : float
        Of the run, in s.
    stiff : bool
        Whether flows may need a method for stiff ones.

    Raises
    ------
    TraceError
        If a part's maps cannot be traced.
    BuildError
        If there is no compiler, or it fails.
    """
    sent = list(dict.fromkeys(network.signals.values()))
    groups: list[PartGroup] = []
    automata: list[Automaton] = []
    group_of, row_of = (np.zeros(network.links.count, np.uint32) for _ in range(2))
    for k, (template, parts) in enumerate(zip(network.templates, network.members, strict=True)):
        places = _places(template)
        signals = tuple(places[name] for name in sent)
        rows = tuple(network.rows(k, kind) for kind in ROWS)
        run = Execution(template, t_start=start, t_stop=stop)
        for model, chosen in _by_model(run, [given.get(part) for part in parts], stiff=stiff):
            group_of[parts[chosen]] = len(groups)
            row_of[parts[chosen]] = np.arange(len(chosen), dtype=np.uint32)
            own = [given.get(part) for part in parts[chosen]]
            groups.append(PartGroup(model, signals, _given_rows(rows, chosen, own, start)))
            automata.append(template)
    links = network.links
    number = (np.arange(len(links.receivers)) - links.first[links.receivers]).astype(np.uint32)
    columns = []
    for into, output in network.signals.items():
        begins = np.array([_input(template, into) for template in network.templates], np.uint32)
        inputs = begins[network.group_of[links.receivers]] + number
        signal = np.full(len(number), sent.index(output), np.uint32)
        columns.append((links.senders.astype(np.uint32), signal, links.receivers.astype(np.uint32), inputs))
    wires = [np.concatenate([np.zeros(0, np.uint32), *column]) for column in zip(*columns, strict=True)]
    empty = [np.zeros(0, np.uint32)] * 4
    compressed = wires_by_source(links.count, *(wires or empty))
    return PartTable(
        network.name, network.parts, tuple(automata), tuple(groups), group_of, row_of, compressed, computed=True
    )


def _by_model(
    run: Execution, given: Sequence[Given | None], *, stiff: bool
) -> list[tuple[NativeModel, npt.NDArray[np.intp]]]:
    """Return the models that parts with one declaration need for what they are given, and which parts need each."""
    number: dict[int, int] = {}
    models: list[NativeModel] = []
    known: dict[int, int] = {}
    of = np.zeros(len(given), np.intp)
    for k, one in enumerate(given):
        if id(one) not in known:
            model = _model(run, one, stiff=stiff)
            known[id(one)] = number.setdefault(model.pointer, len(models))
            models += [model] * (known[id(one)] == len(models))
        of[k] = known[id(one)]
    return [(model, np.flatnonzero(of == k)) for k, model in enumerate(models)]


def _given_rows(
    rows: tuple[FloatArray, ...], chosen: npt.NDArray[np.intp], given: Sequence[Given | None], start: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the rows of some parts, with what they are given at the start, in s."""
    x, z, u, p = (kind[chosen] for kind in rows)
    if all(one is None for one in given):
        return x, z, u, p
    begun = [(own, of) if one is None else one.begin(own, of, start) for one, own, of in zip(given, u, p, strict=True)]
    return x, z, np.array([inputs for inputs, _ in begun]), np.array([of for _, of in begun])


def _input(template: Automaton, name: str) -> int:
    places = layout_of(template).places[Kind.INPUT]
    # Where nothing is heard, there may be no place for it.
    return next((int(place.at.start) for place in places if place.variable.name == name), 0)


def _model(run: Execution, given: Given | None = None, *, stiff: bool) -> NativeModel:
    return model_of(run.automaton, lambda: checked(run), stiff=stiff, driven=given.driven if given else None)


def _begun(run: Execution, given: Given | None) -> tuple[FloatArray, ...]:
    """Return what a part begins with, in the order of `ROWS`."""
    return (run.x, run.z, *((run.inputs.held, run.p) if given is None else given.piece(run.t, 0)))


def _stacked(rows: Sequence[tuple[FloatArray, ...]]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    x, z, u, p = (np.array(column, np.float64).reshape(len(rows), -1) for column in zip(*rows, strict=True))
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

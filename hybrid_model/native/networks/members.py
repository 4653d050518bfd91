"""The parts of a composition as members of a network: places of their vectors, and sources of their inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.elements import split_element
from hybrid_model.declare.layout import Layout, Place
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import TraceError

SOURCES = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.OUTPUT)
"""Kinds of vectors that inputs come from, in the order of hybrid_model/engine/networks/network.h."""
FEW = 12
"""Compositions of so few parts are traced whole."""

_MAPS = (
    *("start_values", "derivatives", "flow_margin", "jump_margins", "event_times", "reset", "output_values"),
    *("output_value", "has_flow_set", "part_values"),
)


class NotLoopable(TraceError):
    """A composition that is to be traced whole."""


@dataclass(frozen=True)
class Member:
    """A part of a network.

    Attributes
    ----------
    path : str
        Its name in the network, for messages.
    automaton, layout : Automaton, Layout
        The part.
    first : dict
        Kind -> place of the part's first element in the network's vector; for inputs, in the list of all inputs of all
        parts (see `Members`).
    margin, time, jump : int
        Places of its first jump margin, event time and jump among those of the network.
    """

    path: str
    automaton: Automaton
    layout: Layout
    first: dict[Kind, int]
    margin: int
    time: int
    jump: int

    def places(self, kind: Kind) -> range:
        """Return the places of the part's elements in the network's vector of a kind."""
        return range(self.first[kind], self.first[kind] + self.layout.sizes[kind])


@dataclass(frozen=True)
class Members:
    """All parts of a network, and where their inputs come from.

    Attributes
    ----------
    layout : Layout
        Of the whole composition.
    members : tuple of Member
        In the order of the composition; parts that are networks themselves are replaced by their parts.
    bank, place : ndarray of int, shape (inputs of all parts,)
        Source of each scalar input: number of its kind in `SOURCES`, and place in the network's vector.
    crossing : ndarray of bool
        Whether the input comes over a wire from outside the part's own composition.
    """

    layout: Layout
    members: tuple[Member, ...]
    bank: np.ndarray[tuple[int], np.dtype[np.int64]]
    place: np.ndarray[tuple[int], np.dtype[np.int64]]
    crossing: np.ndarray[tuple[int], np.dtype[np.bool_]]


def is_plain(automaton: Automaton) -> bool:
    """Whether an automaton is a composition that evaluates its maps as `Composition` does."""
    return isinstance(automaton, Composition) and all(
        getattr(type(automaton), name) is getattr(Composition, name) for name in _MAPS
    )


def leaves(automaton: Automaton) -> list[Automaton]:
    """Return the parts that a network is made of, those of nested networks included."""
    assert isinstance(automaton, Composition)
    return [leaf for part in automaton.parts.values() for leaf in (leaves(part) if _is_network(part) else [part])]


def _is_network(part: Automaton) -> bool:
    return is_plain(part) and len(leaves(part)) > FEW


def members_of(composition: Composition) -> Members:
    """Lay out the parts of a composition.

    Parameters
    ----------
    composition : Composition
        One that `is_plain`.

    Returns
    -------
    Members
        Parts in order, and the source of each of their inputs.
    """
    return _Lowering(composition).lower()


class _Lowering:
    def __init__(self, composition: Composition) -> None:
        self.composition = composition
        self.members: list[Member] = []
        # A part's place in the nesting: the names on the way to it.
        self.by_path: dict[tuple[str, ...], Member] = {}
        self.next = dict.fromkeys(Kind, 0)
        self.jumps, self.margins, self.times = 0, 0, 0

    def lower(self) -> Members:
        self._collect((), self.composition)
        layout = Layout(self.composition)
        external = {}
        for place in layout.places[Kind.INPUT]:
            external[place.variable.name] = range(place.at.start, place.at.stop)
        sources = [source for path in self.by_path for source in self._inputs(path, external)]
        table = np.array(sources, dtype=np.int64).reshape(len(sources), 3)
        return Members(layout, tuple(self.members), table[:, 0], table[:, 1], table[:, 2].astype(bool))

    def _collect(self, path: tuple[str, ...], composition: Composition) -> None:
        for name, part in composition.parts.items():
            if _is_network(part):
                assert isinstance(part, Composition)
                self._collect((*path, name), part)
            else:
                self._add((*path, name), part)

    def _add(self, path: tuple[str, ...], part: Automaton) -> None:
        layout = Layout(part)
        member = Member(".".join(path), part, layout, dict(self.next), self.margins, self.times, self.jumps)
        self.members.append(member)
        self.by_path[path] = member
        for kind in Kind:
            self.next[kind] += layout.sizes[kind]
        self.jumps += len(part.jumps)
        on_state = sum(info.trigger is Trigger.STATE for info in part.jumps)
        self.margins += on_state
        self.times += len(part.jumps) - on_state

    def _inputs(self, path: tuple[str, ...], external: dict[str, range]) -> Iterator[tuple[int, int, bool]]:
        for place in self.by_path[path].layout.places[Kind.INPUT]:
            yield from self._sources(path, place.variable.name, external)

    def _sources(self, path: tuple[str, ...], variable: str, external: dict[str, range]) -> list[tuple[int, int, bool]]:
        """Sources of the elements of an input of the part at `path`."""
        crossing = False
        while path:
            owner, part = self._composition(path[:-1]), path[-1]
            wire = owner._wires[part].get(variable)
            if wire is not None:
                return [
                    (bank, element, crossing)
                    for source, output in wire.sources
                    for bank, element in self._elements((*path[:-1], source), output)
                ]
            variable, path, crossing = owner.scoped_name(part, variable), path[:-1], True
        return [(SOURCES.index(Kind.INPUT), element, False) for element in external[variable]]

    def _elements(self, path: tuple[str, ...], variable: str) -> list[tuple[int, int]]:
        """Elements of the state or output `variable` of the part at `path`, in the network's vectors."""
        if split := split_element(variable):
            whole, index = split
            shape = next(v.shape for v in self._composition(path[:-1]).parts[path[-1]].variables if v.name == whole)
            return [self._elements(path, whole)[int(np.ravel_multi_index(index, shape))]]
        while path not in self.by_path:
            composition = self._composition(path)
            part, variable = next(key for key, name in composition._names.items() if name == variable)
            path = (*path, part)
        member = self.by_path[path]
        kind, place = _place(member.layout, variable)
        first = member.first[kind]
        return [(SOURCES.index(kind), first + k) for k in range(place.at.start, place.at.stop)]

    def _composition(self, path: tuple[str, ...]) -> Composition:
        composition = self.composition
        for name in path:
            part = composition.parts[name]
            assert isinstance(part, Composition)
            composition = part
        return composition


def _place(layout: Layout, variable: str) -> tuple[Kind, Place]:
    return next(
        (kind, place)
        for kind in (Kind.STATE, Kind.DISCRETE, Kind.OUTPUT)
        for place in layout.places[kind]
        if place.variable.name == variable
    )

"""Networks as arrays: many copies of a part, with a column for each number in which they differ."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.layout import Place, layout_of
from hybrid_model.declare.real_numbers import real_array, told
from hybrid_model.declare.variables import FloatArray, Kind, Variable, unknown_name
from hybrid_model.errors import DeclarationError, WiringError
from hybrid_model.schedule.copies import Copy
from hybrid_model.schedule.links import Links, Whole, links_of

_GIVEN = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)


class PartNames(Sequence[str]):
    """Names that end with a number, from 1; none is kept."""

    def __init__(self, label: str, count: int) -> None:
        self._label, self._count = label, count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, k: int) -> str: ...
    @overload
    def __getitem__(self, k: slice) -> list[str]: ...
    def __getitem__(self, k: int | slice) -> str | list[str]:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(self._count))]
        return f"{self._label}{range(self._count)[k] + 1}"

    def __iter__(self) -> Iterator[str]:
        return (f"{self._label}{k + 1}" for k in range(self._count))

    def __contains__(self, name: object) -> bool:
        return self._number(name) is not None

    def index(self, name: Any, start: int = 0, stop: int | None = None) -> int:
        """Return the number of a name, from 0."""
        number = self._number(name)
        if number is None:
            raise ValueError(f"{name!r} is no part: they are {self._label}1 to {self._label}{self._count}")
        return number

    def _number(self, name: object) -> int | None:
        if not isinstance(name, str) or not name.startswith(self._label):
            return None
        digits = name[len(self._label) :]
        plain = digits.isascii() and digits.isdigit() and not digits.startswith("0")
        return int(digits) - 1 if plain and int(digits) <= self._count else None


class Network:
    """Many copies of a part that hear each other at events; no object is made for any of them.

    Parameters
    ----------
    name : str
        Of the network.
    part : Automaton or callable
        What all parts are; or ``part(degree)``, where the shapes of its variables depend on how many others it hears.
    links : scipy sparse matrix, networkx graph, or (receivers, senders)
        Who hears whom, see `hybrid_model.schedule.links.links_of`.
    signals : mapping
        Input with an element for each link, or without shape where a part hears one other at most -> the discrete
        scalar of the sender that arrives there.
    values : mapping, optional
        State, input or parameter -> one value for all parts, or an array with a row for each.
    link_values : mapping, optional
        State or parameter whose last axis has an element for each link -> an array whose first axis has one for each
        link, in the order in which the links were given, or a matrix with the pattern of `links`.
    label : str
        Parts are called by it and their number, from 1.
    count : int, optional
        Number of parts, where `links` are two arrays.

    Raises
    ------
    WiringError
        If links or signals do not fit the parts.
    DeclarationError
        For a name that the parts do not have, or values that do not fit.
    """

    def __init__(
        self,
        name: str,
        part: Automaton | Callable[[int], Automaton],
        links: Any,
        signals: Mapping[str, str],
        *,
        values: Mapping[str, npt.ArrayLike] | None = None,
        link_values: Mapping[str, Any] | None = None,
        label: str = "part",
        count: int | None = None,
    ) -> None:
        self.name = name
        self.links: Links = links_of(links, count)
        self.parts = PartNames(label, self.links.count)
        self.signals = dict(signals)
        self.templates, self.group_of = _groups(part, self.links)
        for template in self.templates:
            require_automaton(template)
        for key in (values or {}).keys() & (link_values or {}).keys():
            raise DeclarationError(
                f"{name}: {key} is given among the values and among the link_values: leave one of them out."
            )
        self._values = {key: self._per_part(key, value) for key, value in (values or {}).items()}
        self._link_values = {key: self._per_link(key, value) for key, value in (link_values or {}).items()}
        self._check_signals()

    @functools.cached_property
    def members(self) -> tuple[Whole, ...]:
        """The parts of each group."""
        return tuple(np.flatnonzero(self.group_of == k) for k in range(len(self.templates)))

    def template(self, part: int) -> Automaton:
        """Return what declares the variables of a part."""
        return self.templates[int(self.group_of[part])]

    def rows(self, group: int, kind: Kind) -> FloatArray:
        """Return the vectors of a kind of all parts of a group, shape (parts, size)."""
        layout, members = layout_of(self.templates[group]), self.members[group]
        rows = np.tile(layout.start(kind), (len(members), 1))
        for place in layout.places[kind]:
            if place.variable.name in self._values:
                rows[:, place.at] = self._column(place, members)
            elif place.variable.name in self._link_values and place.variable.size:
                rows[:, place.at] = self._linked(place.variable.name, members)
        return rows

    def copy(self, part: int) -> Automaton:
        """Return a part as an automaton of its own."""
        template, member = self.template(part), np.array([part])
        starts: dict[str, FloatArray] = {}
        for kind in _GIVEN:
            for place in layout_of(template).places[kind]:
                if place.variable.name in self._values:
                    starts[place.variable.name] = self._column(place, member).reshape(place.variable.shape)
                elif place.variable.name in self._link_values and place.variable.size:
                    starts[place.variable.name] = self._linked(place.variable.name, member).reshape(
                        place.variable.shape
                    )
        return Copy(template, self.parts[part], starts)

    def composition(self) -> Composition:
        """Return the same network as a composition of automata, for few parts."""
        first, senders = self.links.first, self.links.senders
        connections: dict[str, str | list[str]] = {}
        for part, name in enumerate(self.parts):
            heard = [self.parts[k] for k in senders[first[part] : first[part + 1]]]
            for into, output in self.signals.items():
                sources = [f"{other}.{output}" for other in heard]
                if not sources:
                    continue
                scalar = not _variable(self.template(part), into).shape
                connections[f"{name}.{into}"] = sources[0] if scalar else sources
        return Composition(self.name, {name: self.copy(k) for k, name in enumerate(self.parts)}, connections)

    def _links_into(self, members: Whole) -> Whole:
        """Return the numbers of the links into parts that have equally many, one row a part."""
        first = self.links.first
        degree = int(first[members[0] + 1] - first[members[0]]) if len(members) else 0
        return first[members][:, None] + np.arange(degree)[None, :]

    def _linked(self, name: str, members: Whole) -> FloatArray:
        """Return the values of the links into parts, the links along the last axis; one row a part."""
        values = self._link_values[name][self._links_into(members)]
        return np.moveaxis(values, 1, -1).reshape(len(members), -1)

    def _column(self, place: Place, members: Whole) -> FloatArray:
        value = self._values[place.variable.name]
        shape = place.variable.shape
        chosen = value[members] if value.ndim == len(shape) + 1 else np.broadcast_to(value, (len(members), *shape))
        return np.ascontiguousarray(chosen).reshape(len(members), -1)

    def _per_part(self, name: str, given: npt.ArrayLike) -> FloatArray:
        value = _finite(self.name, name, given)
        for template in self._having(name):
            shape = _variable(template, name).shape
            if value.shape not in ((), shape, (self.links.count, *shape)):
                raise DeclarationError(
                    f"{self.name}: {name} is given with shape {value.shape}: give one value of shape {shape}, or one "
                    f"for each of the {self.links.count} parts, shape {(self.links.count, *shape)}."
                )
        return value

    def _per_link(self, name: str, given: Any) -> FloatArray:
        if hasattr(given, "tocsr"):
            matrix = given.tocsr()
            matrix.sort_indices()
            given = matrix.tocoo().data
        value = _finite(self.name, name, given)
        links = len(self.links.order)
        if value.shape[:1] != (links,):
            raise DeclarationError(
                f"{self.name}: {name} is given with shape {value.shape}: give one value for each of {links} links."
            )
        for template, members in zip(self.templates, self.members, strict=True):
            degrees = np.unique(self.links.degrees[members])
            if not degrees.any():
                continue
            shape = _variable(template, name).shape
            if any(shape != (*value.shape[1:], degree) for degree in degrees):
                raise DeclarationError(
                    f"{self.name}: {name} has shape {shape}, but there are parts that hear {int(degrees[-1])} others: "
                    "give it among the values, or make the part for its degree, part=lambda degree: ..."
                )
        return value[self.links.order]

    def _having(self, name: str) -> tuple[Automaton, ...]:
        for template in self.templates:
            _variable(template, name)
        return self.templates

    def _check_signals(self) -> None:
        degrees = self.links.degrees
        for into, output in self.signals.items():
            for group, template in enumerate(self.templates):
                most = int(degrees[self.members[group]].max(initial=0))
                if most == 0 and len(self.templates) > 1:
                    continue
                size = _variable(template, into, Kind.INPUT).size
                if size < most:
                    raise WiringError(
                        f"{self.name}: {into} has {size} elements, but a part hears {most} others: make the part for "
                        "its degree, part=lambda degree: ..."
                    )
                leaving = _variable(template, output, Kind.STATE, Kind.DISCRETE, Kind.OUTPUT)
                if leaving.shape or not (leaving.discrete or leaving.kind is Kind.DISCRETE):
                    raise WiringError(
                        f"{self.name}: {output} arrives at {into}, but only a scalar that changes at jumps can be "
                        "sent: a discrete state, or an output declared discrete."
                    )


def _groups(
    part: Automaton | Callable[[int], Automaton], links: Links
) -> tuple[tuple[Automaton, ...], npt.NDArray[np.uint32]]:
    """Return what the parts are, one for each degree if that makes a difference, and which of them each part is."""
    if isinstance(part, Automaton) or not callable(part):
        return (part,), np.zeros(links.count, np.uint32)
    degrees, group_of = np.unique(links.degrees, return_inverse=True)
    return tuple(part(int(degree)) for degree in degrees), group_of.astype(np.uint32)


def _variable(template: Automaton, name: str, *kinds: Kind) -> Variable:
    known = {variable.name: variable for variable in template.of_kind(*(kinds or _GIVEN))}
    if name not in known:
        raise DeclarationError(unknown_name(template.name, name, known))
    return known[name]


def _finite(owner: str, name: str, given: npt.ArrayLike) -> FloatArray:
    try:
        value = real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(
            f"{owner}: {name} = {told(given)} is no array of real numbers: give numbers, as many in each row."
        ) from error
    if not np.all(np.isfinite(value)):
        raise DeclarationError(f"{owner}: {name} has values that are not finite.")
    return value

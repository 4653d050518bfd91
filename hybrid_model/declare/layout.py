"""Where each variable lives in the vectors that solvers and generated code work on."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hybrid_model.declare.real_numbers import FLOATS, real_array, told
from hybrid_model.declare.transitions import Assignments
from hybrid_model.declare.variables import FloatArray, Kind, Value, Values, Variable, element_names
from hybrid_model.errors import DeclarationError


class Declares(Protocol):
    """What has variables, as every automaton does."""

    name: str
    variables: tuple[Variable, ...]


@dataclass(frozen=True)
class Place:
    """A variable's place in the vector of its kind."""

    variable: Variable
    at: slice

    def take(self, vector: Value) -> Value:
        """Return the variable's value, a scalar or an array of its shape, out of `vector`."""
        if not self.variable.shape:
            return vector[self.at.start]
        part = vector[self.at]
        return part if len(self.variable.shape) == 1 else part.reshape(self.variable.shape)


class Layout:
    """The vectors x, z, u, p (and y) of an automaton, and the way from vectors to values and back.

    Parameters
    ----------
    automaton : Automaton
        Whose variables are laid out, kind by kind in declaration order, arrays row by row.

    Attributes
    ----------
    owner : str
        The automaton's name, for messages.
    """

    def __init__(self, automaton: Declares) -> None:
        self.owner = automaton.name
        self.places: dict[Kind, tuple[Place, ...]] = {}
        self.sizes: dict[Kind, int] = {}
        for kind in Kind:
            at = 0
            places = []
            for variable in automaton.variables:
                if variable.kind is kind:
                    places.append(Place(variable, slice(at, at + variable.size)))
                    at += variable.size
            self.places[kind] = tuple(places)
            self.sizes[kind] = at
        # Values are read in the inner loop of every run, so what does not change is looked up once.
        self._entries = tuple(
            tuple(
                (p.variable.name, p.at if p.variable.shape else p.at.start, p.variable.shape[1:] and p.variable.shape)
                for p in self.places[kind]
            )
            for kind in (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
        )
        self._has_arrays = tuple(any(isinstance(at, slice) for _, at, _ in entries) for entries in self._entries)

    def start(self, kind: Kind) -> FloatArray:
        """Return the vector of start values of one kind."""
        starts = [place.variable.start.ravel() for place in self.places[kind]]
        return np.concatenate(starts) if starts else np.zeros(0)

    @property
    def whole(self) -> list[bool]:
        """Of each scalar discrete state, whether it is declared integer."""
        return [place.variable.integer for place in self.places[Kind.DISCRETE] for _ in range(place.variable.size)]

    def names(self, kind: Kind) -> list[str]:
        """Return the names of the scalars in the vector of one kind."""
        return [name for place in self.places[kind] for name in element_names(place.variable)]

    def values(self, t: Value, x: Value, z: Value, u: Value, p: Value) -> Values:
        """Return the values at one instant, by name; works for vectors of floats and of symbols."""
        values: dict[str, Value] = {"t": t}
        for vector, entries, has_arrays in zip((x, z, u, p), self._entries, self._has_arrays, strict=True):
            if has_arrays:
                # A map that writes into an array would write into the state of the run.
                vector = vector[:]
                vector.flags.writeable = False
            for name, at, shape in entries:
                values[name] = vector[at].reshape(shape) if shape else vector[at]
        return Values(self.owner, values)

    def pack(self, kind: Kind, assignments: Assignments, otherwise: FloatArray | None = None) -> FloatArray:
        """Write values by name into a vector of floats.

        Parameters
        ----------
        kind : Kind
            Whose vector.
        assignments : mapping
            Variable name -> value.
        otherwise : ndarray, optional
            Values of the variables that `assignments` does not name; default zeros.

        Raises
        ------
        DeclarationError
            If a value is neither one number nor an array of the variable's shape: numbers of another shape would land
            on the wrong elements.
        """
        vector = np.zeros(self.sizes[kind]) if otherwise is None else otherwise.copy()
        for place in self.places[kind]:
            if place.variable.name in assignments:
                vector[place.at] = self._flat(place.variable, assignments[place.variable.name])
        return vector

    def _flat(self, variable: Variable, value: Value) -> Value:
        """Return a value as one number, or row by row."""
        if type(value) in FLOATS:
            return value
        try:
            given = real_array(value)
        except (TypeError, ValueError, OverflowError) as error:
            raise DeclarationError(
                f"{self.owner}: the value computed for {variable.name} is {told(value)}: {_remedy(variable)}."
            ) from error
        if given.shape not in ((), variable.shape):
            raise DeclarationError(
                f"{self.owner}: the value computed for {variable.name} has shape {given.shape}, but "
                f"{variable.name} has shape {variable.shape}: {_remedy(variable)}."
            )
        return given.ravel() if given.shape else given

    def describe(self, vectors: Mapping[Kind, FloatArray]) -> str:
        """Return ``name = value`` for the scalars of some vectors, for messages."""
        pairs = [
            f"{name} = {value:.9g}"
            for kind, vector in vectors.items()
            for name, value in zip(self.names(kind), vector, strict=True)
        ]
        shown = ", ".join(pairs[:12])
        return shown + (f", and {len(pairs) - 12} more" if len(pairs) > 12 else "")


_layouts: weakref.WeakKeyDictionary[Declares, tuple[object, str, Layout]] = weakref.WeakKeyDictionary()


def layout_of(automaton: Declares) -> Layout:
    """Return the layout of an automaton, which is made once for all its runs."""
    known = _layouts.get(automaton)
    if known is not None and known[0] is automaton.variables and known[1] == automaton.name:
        return known[2]
    layout = Layout(automaton)
    _layouts[automaton] = (automaton.variables, automaton.name, layout)
    return layout


def _remedy(variable: Variable) -> str:
    if not variable.shape:
        return "return one number"
    return f"return an array of shape {variable.shape}, or one number for all elements"


def not_finite(layout: Layout, kind: Kind, vector: FloatArray) -> str | None:
    """Return the first ``name = value`` in the vector of a kind that is not finite, or None."""
    bad = np.flatnonzero(~np.isfinite(vector))
    return None if bad.size == 0 else f"{layout.names(kind)[bad[0]]} = {vector[bad[0]]}"

"""A point of an automaton's flow: values of all variables, which can be set by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import Layout, Place
from hybrid_model.declare.variables import FloatArray, Kind, Values, element_names, start_array, unknown_name
from hybrid_model.errors import DeclarationError
from hybrid_model.reference.execution import Execution

VECTORS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
"""Kinds of the vectors that maps take, in the order of `Layout.values`."""


class OperatingPoint:
    """The start values of an automaton, computed ones included, and what is put in their place.

    Parameters
    ----------
    automaton : Automaton
        Whose values.

    Attributes
    ----------
    t : float
        Time in s.
    vectors : dict
        Kind -> vector, for the kinds in `VECTORS`.
    """

    def __init__(self, automaton: Automaton) -> None:
        start = Execution(automaton)
        self.layout = Layout(automaton)
        self.t = start.t
        self.vectors = {
            Kind.STATE: start.x.copy(),
            Kind.DISCRETE: start.z.copy(),
            Kind.INPUT: self.layout.start(Kind.INPUT),
            Kind.PARAMETER: start.p.copy(),
        }

    def put(self, name: str, value: npt.ArrayLike, kinds: Sequence[Kind] = VECTORS) -> None:
        """Set a variable of one of the given kinds, or one scalar of it, ``"x[2]"``.

        Raises
        ------
        DeclarationError
            For an unknown name, a wrong shape, or a value that is not finite.
        """
        owner = self.layout.owner
        given = start_array(f"{owner}.{name}", value)
        known: dict[str, tuple[Kind, slice, tuple[int, ...]]] = {}
        for kind in kinds:
            for place in self.layout.places[kind]:
                scalars = enumerate(element_names(place.variable), place.at.start)
                known |= {scalar: (kind, slice(i, i + 1), ()) for i, scalar in scalars}
                known[place.variable.name] = (kind, place.at, place.variable.shape)
        if name not in known:
            raise DeclarationError(unknown_name(owner, name, known))
        kind, at, shape = known[name]
        if given.shape not in ((), shape):
            raise DeclarationError(
                f"{owner}.{name} has shape {shape}, but the value given has shape {given.shape}: give one number for "
                f"all elements, or an array of shape {shape}."
            )
        self.vectors[kind][at] = given.ravel() if given.shape else given

    def take(self, places: Sequence[Place]) -> FloatArray:
        """Return the scalars of some variables in one vector."""
        parts = [self.vectors[place.variable.kind][place.at] for place in places]
        return np.concatenate(parts) if parts else np.zeros(0)

    def values(self, x: FloatArray, places: Sequence[Place], scalars: FloatArray) -> Values:
        """Return all values with the states `x`, and with new scalars for the variables at some places."""
        moved = {kind: vector.copy() for kind, vector in self.vectors.items()} | {Kind.STATE: x}
        at = 0
        for place in places:
            moved[place.variable.kind][place.at] = scalars[at : at + place.variable.size]
            at += place.variable.size
        return self.layout.values(self.t, *(moved[kind] for kind in VECTORS))


def find_places(layout: Layout, names: Sequence[str], kinds: Sequence[Kind]) -> tuple[Place, ...]:
    """Return the places of variables of the given kinds, by name.

    Raises
    ------
    DeclarationError
        For an unknown name.
    """
    known = {place.variable.name: place for kind in kinds for place in layout.places[kind]}
    for name in names:
        if name not in known:
            what = " and ".join(kind.value for kind in kinds)
            raise DeclarationError(unknown_name(f"{layout.owner} ({what})", name, known))
    return tuple(known[name] for name in names)


def outputs_of_flow(layout: Layout) -> tuple[Place, ...]:
    """Return the variables that a flow shows: computed outputs and output states, or all states if there are none."""
    states = layout.places[Kind.STATE]
    return (*layout.places[Kind.OUTPUT], *(place for place in states if place.variable.output)) or states


def read_outputs(automaton: Automaton, places: Sequence[Place], s: Values) -> FloatArray:
    """Return the scalars of computed outputs and states at one instant, in one vector."""
    computed = automaton.output_values(s) if any(q.variable.kind is Kind.OUTPUT for q in places) else {}
    parts = [
        np.asarray(computed[q.variable.name] if q.variable.kind is Kind.OUTPUT else s[q.variable.name], np.float64)
        for q in places
    ]
    return np.concatenate([part.ravel() for part in parts]) if parts else np.zeros(0)

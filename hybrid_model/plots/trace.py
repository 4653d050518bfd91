"""A run on a grid of hybrid time that is fine enough to be drawn, and variables or functions of them on that grid."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray, Kind, Value, Values, Variable, element_names, unknown_name
from hybrid_model.errors import DeclarationError
from hybrid_model.plots.curves import POINTS
from hybrid_model.plots.style import with_unit
from hybrid_model.record.arc import HybridArc

POINTS_PER_FLOW = 8
"""Least number of points inside a flow: a short flight of a ball is a parabola as well."""


@dataclass(frozen=True, eq=False)
class Scalar:
    """A scalar of a run: a variable, or an element of one.

    Attributes
    ----------
    name : str
        ``h``, or ``x[2]`` for an element, counted from 1.
    variable : Variable
        Whose scalar it is.
    index : tuple of int
        Of the element, counted from 0; ``()`` for a scalar variable.
    """

    name: str
    variable: Variable
    index: tuple[int, ...]

    @property
    def label(self) -> str:
        """Name and unit."""
        return with_unit(self.name, self.variable.unit)


class Trace:
    """A run on a grid of hybrid time: its own samples, and further points inside each flow.

    Parameters
    ----------
    arc : HybridArc
        The run.

    Attributes
    ----------
    t, j : ndarray, shape (n,)
        Hybrid time of the points.
    first, last : ndarray of int, shape (flows,)
        The points with which each flow starts and ends; jump k leads from ``last[k]`` to ``first[k + 1]``.
    """

    def __init__(self, arc: HybridArc) -> None:
        self.arc = arc
        span = arc.t[-1] - arc.t[0]
        starts = np.flatnonzero(np.diff(arc.j, prepend=arc.j[0] - 1))
        times: list[FloatArray] = []
        jumps: list[npt.NDArray[np.int_]] = []
        inside: list[npt.NDArray[np.bool_]] = []
        for own in np.split(arc.t, starts[1:]):
            length = own[-1] - own[0]
            count = max(POINTS_PER_FLOW, math.ceil(POINTS * length / span)) if length > 0.0 else 0
            between = np.setdiff1d(np.linspace(own[0], own[-1], count + 2)[1:-1], own)
            both = np.concatenate([own, between])
            # A stable sort keeps samples of one time in their order.
            order = np.argsort(both, kind="stable")
            times.append(both[order])
            jumps.append(np.full(both.size, len(jumps)))
            inside.append(order >= own.size)
        self.t: FloatArray = np.concatenate(times)
        self.j = np.concatenate(jumps) + arc.j[0]
        self._inside = np.concatenate(inside)
        self.first = np.flatnonzero(np.diff(self.j, prepend=self.j[0] - 1))
        self.last = np.append(self.first[1:] - 1, self.t.size - 1)

    def variable(self, name: str) -> FloatArray:
        """Return a variable on the grid, shape (n, *shape)."""
        samples = self.arc[name]
        values = np.empty((self.t.size, *samples.shape[1:]))
        values[~self._inside] = samples
        values[self._inside] = self.arc.at(name, self.t[self._inside])
        return values

    def scalar(self, scalar: Scalar) -> FloatArray:
        """Return a scalar on the grid, shape (n,)."""
        at: tuple[Any, ...] = (slice(None), *scalar.index)
        values: FloatArray = self.variable(scalar.variable.name)[at]
        return values

    def function(self, function: Callable[[Values], Value]) -> FloatArray:
        """Return a function of the run's values on the grid, shape (n, ...)."""
        columns: dict[str, FloatArray] = {"t": self.t}
        return np.array([function(_Row(self, columns, k)) for k in range(self.t.size)], dtype=np.float64)


class _Row(Values):
    """The values at one point of a trace; a variable is taken from the run when a function first asks for it."""

    __slots__ = ("_at", "_trace")

    def __init__(self, trace: Trace, columns: dict[str, FloatArray], at: int) -> None:
        super().__init__(trace.arc.automaton.name, columns)
        self._trace = trace
        self._at = at

    def __getitem__(self, name: str) -> Value:
        if name not in self._values:
            find_scalars(self._trace.arc, [name])
            self._values[name] = self._trace.variable(name)
        return self._values[name][self._at]


def find_scalars(arc: HybridArc, names: Sequence[str]) -> list[Scalar]:
    """Return the scalars that `names` stand for; an array stands for its elements, no names for the continuous states.

    Raises
    ------
    DeclarationError
        For a name that the run's automaton does not have, or an element outside of its array.
    """
    chosen = names or [variable.name for variable in arc.automaton.of_kind(Kind.STATE)]
    return [scalar for name in chosen for scalar in _scalars(arc, name)]


def find_scalar(arc: HybridArc, name: str) -> Scalar:
    """Return the one scalar that `name` stands for.

    Raises
    ------
    DeclarationError
        As `find_scalars`, and for an array.
    """
    scalars = find_scalars(arc, [name])
    if len(scalars) != 1 or scalars[0].name != name:
        raise DeclarationError(
            f"{arc.automaton.name}: {name} has shape {scalars[0].variable.shape if scalars else (0,)}, but one number "
            f"is wanted here: name an element, as in {name}[{','.join('1' * len(scalars[0].index)) if scalars else 1}]."
        )
    return scalars[0]


def jump_mask(arc: HybridArc, names: Sequence[str]) -> npt.NDArray[np.bool_]:
    """Return which of the run's jumps have one of some names, shape (jumps,).

    Raises
    ------
    DeclarationError
        For a jump that the automaton does not have.
    """
    known = {info.name: info for info in arc.automaton.jumps}
    for name in names:
        if name not in known:
            raise DeclarationError(unknown_name(arc.automaton.name, name, known, "jump"))
    return np.array([jump.name in names for jump in arc.jumps], dtype=np.bool_)


def _scalars(arc: HybridArc, name: str) -> list[Scalar]:
    owner = arc.automaton.name
    if not isinstance(name, str):
        raise DeclarationError(
            f"{owner}: the name of a variable is wanted, but {type(name).__name__} was given: write names one after "
            "the other, plot(arc, 'x', 'y', ax=ax)."
        )
    known = {variable.name: variable for variable in arc.automaton.variables}
    if name in known:
        variable = known[name]
        indices = np.ndindex(*variable.shape)
        return [Scalar(n, variable, i) for n, i in zip(element_names(variable), indices, strict=True)]
    base = re.sub(r"\[[^\[\]]*\]$", "", name)
    if base == name or base not in known:
        raise DeclarationError(unknown_name(owner, name, known))
    elements = _scalars(arc, base)
    found = [scalar for scalar in elements if scalar.index and scalar.name == name.replace(" ", "")]
    if not found:
        shape = known[base].shape
        told = f"its elements are {elements[0].name} to {elements[-1].name}" if shape and elements else "it has none"
        raise DeclarationError(f"{owner} has no element {name}: {base} has shape {shape}, and {told}.")
    return found

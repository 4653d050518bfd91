"""Tunable parameters in time: constant between the instants at which somebody sets them."""

from __future__ import annotations

import bisect
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.elements import gathered
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.real_numbers import is_real, told
from hybrid_model.declare.variables import FloatArray, Kind, Variable, start_array, unknown_name
from hybrid_model.errors import DeclarationError, SimulationError


class Steps:
    """A tunable parameter as a function of time: what `value` gives at the start and at each breakpoint, held.

    The function is called in order of need, so it never looks beyond the time that is asked for, nor before the first
    one.

    Parameters
    ----------
    variable : Variable
        The parameter.
    value : callable
        ``value(t) -> float or array``.
    breakpoints : sequence of float
        Times in s at which it changes, in any order.
    """

    def __init__(
        self, variable: Variable, value: Callable[[float], npt.ArrayLike], breakpoints: Sequence[float]
    ) -> None:
        self._variable, self._value = variable, value
        self.times = sorted(breakpoints)
        self._origin: float | None = None
        self._known: dict[int, FloatArray] = {}

    def at(self, t: float) -> FloatArray:
        """Return the value at `t` in s, row by row; continuous from the right.

        Raises
        ------
        SimulationError
            If the function gives what the parameter cannot be.
        """
        if self._origin is None:
            self._origin = t
        row = bisect.bisect_right(self.times, t)
        if row not in self._known:
            since = self._origin if row == 0 else max(self.times[row - 1], self._origin)
            try:
                self._known[row] = tuned_value(self._variable, self._value(since))
            except DeclarationError as error:
                raise SimulationError(f"at t = {since:.9g} s {error}") from error
        return self._known[row]


def tuned_value(variable: Variable, given: npt.ArrayLike, what: str = "parameter") -> FloatArray:
    """Return a new value of a variable, row by row and of its full size; `what` it is, for messages.

    Raises
    ------
    DeclarationError
        If it has another shape, is not finite, lies outside the variable's range, or is a fraction where the variable
        holds whole numbers.
    """
    value = start_array(f"{what} {variable.name}", given)

    def told() -> str:
        # Not before it is wanted: texts of arrays take longer than all the rest.
        return f"{what} {variable.name} is set to {given!r}"

    if value.shape not in ((), variable.shape):
        raise DeclarationError(
            f"{told()}, of shape {value.shape}: give one number"
            + (f" for all elements, or an array of shape {variable.shape}." if variable.shape else ".")
        )
    low = -np.inf if variable.minimum is None else variable.minimum
    high = np.inf if variable.maximum is None else variable.maximum
    if not (low <= value).all() or not (value <= high).all():
        raise DeclarationError(f"{told()}, outside its range from {low:g} to {high:g}: give a value within it.")
    if variable.integer and (value != np.round(value)).any():
        raise DeclarationError(f"{told()}, but it holds whole numbers: round it.")
    return np.full(variable.size, value) if value.shape == () else value.ravel()


def named_value(owner: str, variable: Variable, given: npt.ArrayLike) -> npt.ArrayLike:
    """Return the value of a variable whose values have names: that of a name, or the given one.

    Raises
    ------
    DeclarationError
        If it is neither a name nor a value that has one.
    """
    names = variable.value_names
    if isinstance(given, str) and given in names:
        return names.index(given)
    if isinstance(given, str) or (is_real(given) and given not in range(len(names))):
        listed = ", ".join(f"{k} {name}" for k, name in enumerate(names))
        raise DeclarationError(f"{owner} has no {variable.name} {told(given)}; it has {listed}.")
    return given


def start_vectors(layout: Layout, given: Mapping[str, npt.ArrayLike] | None) -> dict[Kind, FloatArray]:
    """Return the start values of states, discrete states, inputs and parameters, with others in place of some.

    Parameters
    ----------
    layout : Layout
        Of the automaton.
    given : mapping, optional
        Variable name -> value.

    Raises
    ------
    DeclarationError
        For an unknown name, an output, a state that is computed, or a value that `tuned_value` refuses.
    """
    vectors: dict[Kind, FloatArray] = {kind: layout.start(kind) for kind in Kind if kind is not Kind.OUTPUT}
    places = {place.variable.name: place for kind in vectors for place in layout.places[kind]} if given else {}
    declared = {name: place.variable.start for name, place in places.items()}
    for name, value in gathered(layout.owner, declared, given or {}).items():
        if name not in places:
            raise DeclarationError(f"starts: {unknown_name(layout.owner, name, places)}")
        variable = places[name].variable
        if variable.computed:
            raise DeclarationError(
                f"starts: {layout.owner}.{name} is computed at the start: give the values that it is computed from."
            )
        if variable.value_names:
            value = named_value(layout.owner, variable, value)
        vectors[variable.kind][places[name].at] = tuned_value(variable, value, "start value of")
    return vectors

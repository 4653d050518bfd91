"""From a point of a flow to the values of all variables: what an arc is read by.

A flow carries a vector along. In a run it holds the continuous states, and inputs and outputs are computed from it. In
an arc from a file it holds states, inputs and outputs one after the other, so nothing has to be computed. Everything
else about arcs is the same for both.
"""

from __future__ import annotations

import bisect
import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.elements import no_element
from hybrid_model.declare.layout import Place, layout_of
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import FloatArray, Kind, Values, Variable, element_names, unknown_name
from hybrid_model.errors import DeclarationError

CompiledOutputs = Callable[[Sequence[FloatArray], int], FloatArray | None]


class ArcValues(ABC):
    """Reads the variables of an automaton off the points of its flows.

    Parameters
    ----------
    automaton : Automaton
        Whose variables.
    """

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.layout = layout_of(automaton)

    @functools.cached_property
    def _places(self) -> dict[str, Place]:
        return {place.variable.name: place for places in self.layout.places.values() for place in places}

    @abstractmethod
    def states(self, x: FloatArray) -> FloatArray:
        """Return the continuous states in the vector that a flow carries."""

    @abstractmethod
    def parameters(self, t: float) -> FloatArray:
        """Return the parameter vector at time `t` in s, continuous from the right."""

    @abstractmethod
    def parameter_steps(self, t0: float, t1: float) -> tuple[FloatArray, FloatArray]:
        """Return the times in [t0, t1] from which on the parameters are constant, t0 first, and their rows."""

    @abstractmethod
    def inputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return the input vector at a point of a flow."""

    @abstractmethod
    def outputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return the output vector at a point of a flow."""

    def variable(self, name: str) -> Variable:
        """Return a variable, or an element of one such as ``v[1]``, by name.

        Raises
        ------
        DeclarationError
            If there is none.
        """
        return self._place(name).variable

    def part(self, name: str) -> slice | None:
        """Return which of the states, continuous or discrete, a variable is; None for what is no state."""
        place = self._place(name)
        return place.at if place.variable.kind in (Kind.STATE, Kind.DISCRETE) else None

    def _place(self, name: str) -> Place:
        place = self._places.get(name) or self._elements.get(name)
        if place is not None:
            return place
        known = {variable.name: variable for variable in self.automaton.variables}
        whole = name.partition("[")[0] if isinstance(name, str) else name
        if whole in self._places and whole != name:
            raise DeclarationError(no_element(self.automaton.name, name, whole, self._places[whole].variable.shape))
        raise DeclarationError(unknown_name(self.automaton.name, name, known))

    @functools.cached_property
    def _elements(self) -> dict[str, Place]:
        """The scalars in arrays, by the names that FMUs, tables and plots have for them."""
        found = {}
        for place in self._places.values():
            if place.variable.shape:
                names, starts = element_names(place.variable), place.variable.start.ravel()
                for name, start, at in zip(names, starts, range(place.at.start, place.at.stop), strict=True):
                    found[name] = Place(replace(place.variable, name=name, start=np.array(start)), slice(at, at + 1))
        return found

    def interpolation_error(self, name: str) -> FloatArray:
        """Return how far a value inside a step may lie from the dense output of the run."""
        return np.zeros(self.variable(name).shape)

    def values(self, t: float, x: FloatArray, z: FloatArray) -> Values:
        """Return all values but the outputs, by name."""
        return self.layout.values(t, self.states(x), z, self.inputs(t, x, z), self.parameters(t))

    def value(self, name: str, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return one variable's value, of the variable's shape."""
        kind = self.variable(name).kind
        if kind is Kind.STATE:
            vector = self.states(x)
        elif kind is Kind.DISCRETE:
            vector = z
        elif kind is Kind.PARAMETER:
            vector = self.parameters(t)
        else:
            vector = self.inputs(t, x, z) if kind is Kind.INPUT else self.outputs(t, x, z)
        return np.asarray(self._place(name).take(vector), dtype=np.float64)

    def column(self, name: str, t: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return one variable's values at points, shape (points, *shape): t has an element for each, x and z a row."""
        kind, place = self.variable(name).kind, self._place(name)
        if kind is Kind.STATE:
            table = self.states(x)
        elif kind is Kind.DISCRETE:
            table = z
        elif kind is Kind.OUTPUT:
            table = self.outputs_along(t, x, z)
        else:
            rows = [self.parameters(float(s)) for s in t] if kind is Kind.PARAMETER else self._inputs_along(t, x, z)
            table = np.array(rows).reshape(len(t), self.layout.sizes[kind])
        return np.array(table[:, place.at], dtype=np.float64).reshape(len(t), *place.variable.shape)

    def outputs_along(self, t: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return the output vectors at points, one row each."""
        rows = [self.outputs(float(s), *point) for s, *point in zip(t, x, z, strict=True)]
        return np.array(rows).reshape(len(t), self.layout.sizes[Kind.OUTPUT])

    def _inputs_along(self, t: FloatArray, x: FloatArray, z: FloatArray) -> list[FloatArray]:
        return [self.inputs(float(s), *point) for s, *point in zip(t, x, z, strict=True)]

    def channels(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return states, inputs and outputs in one vector."""
        return np.concatenate([self.states(x), self.inputs(t, x, z), self.outputs(t, x, z)])

    def channels_along(self, t: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return the same at points, one row each, bit by bit as `column` does."""
        inputs = np.array(self._inputs_along(t, x, z)).reshape(len(t), self.layout.sizes[Kind.INPUT])
        return np.hstack([self.states(x), inputs, self.outputs_along(t, x, z)])


class ComputedValues(ArcValues):
    """Reads a run: inputs and parameters from their signals, outputs from the automaton.

    Parameters
    ----------
    automaton : Automaton
        What ran.
    signals : Inputs
        Its inputs and parameters as functions of time.
    compiled : callable, optional
        Computes so many outputs at points, of whose t, x, z, u and p there is a row each; None where it cannot.
    """

    def __init__(self, automaton: Automaton, signals: Inputs, compiled: CompiledOutputs | None = None) -> None:
        super().__init__(automaton)
        self._signals, self._compiled = signals, compiled
        self._computed: tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray] | None = None

    def __getstate__(self) -> dict[str, Any]:
        # What is compiled belongs to this process.
        return {**self.__dict__, "_compiled": None, "_computed": None}

    def states(self, x: FloatArray) -> FloatArray:
        """See `ArcValues.states`."""
        return x

    def parameters(self, t: float) -> FloatArray:
        """See `ArcValues.parameters`."""
        return self._signals.parameters_at(t)

    def parameter_steps(self, t0: float, t1: float) -> tuple[FloatArray, FloatArray]:
        """See `ArcValues.parameter_steps`."""
        return self._signals.parameter_steps(t0, t1)

    def inputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.inputs`; continuous from the right."""
        return self._signals.at(t)

    def outputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.outputs`."""
        if self.layout.sizes[Kind.OUTPUT] == 0:
            return np.zeros(0)
        return self.layout.pack(Kind.OUTPUT, self.automaton.output_values(self.values(t, x, z)))

    def outputs_along(self, t: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.outputs_along`."""
        rows, size = None, self.layout.sizes[Kind.OUTPUT]
        if self._compiled is not None and len(t) and size:
            p = [self.parameters(float(s)) for s in t]
            rows = self._compiled([t, x, z, np.array(self._inputs_along(t, x, z)), np.array(p)], size)
        return self._once_for_all_outputs(t, x, z) if rows is None else rows

    def _once_for_all_outputs(self, t: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return the output vectors at points, computed once for all who read one of them after the other there."""
        points = (t, x, z)
        if self._computed is None or not all(map(np.array_equal, points, self._computed[0])):
            self._computed = (np.array(t), np.array(x), np.array(z)), super().outputs_along(t, x, z)
        return self._computed[1]


class ReceivedValues(ComputedValues):
    """Reads the run of one part of a network, whose inputs are what it received.

    Several receptions and jumps may fall on one instant, so the inputs depend on t and j: the flows carry j as one
    more discrete state, the last.

    Parameters
    ----------
    automaton, signals
        As in `ComputedValues`; `signals` tells what the inputs from outside the network are.
    received : sequence of (float, int, ndarray)
        Hybrid time from which on, and the constants in the input vector; in order, the first at the start.
    """

    def __init__(
        self,
        automaton: Automaton,
        signals: Inputs,
        received: Sequence[tuple[float, int, FloatArray]],
    ) -> None:
        super().__init__(automaton, signals)
        self._times = [(t, j) for t, j, _ in received]
        self._held = [held for _, _, held in received]

    def inputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.inputs`."""
        last = bisect.bisect_right(self._times, (t, int(z[-1]))) - 1
        return self._signals.with_held(self._held[max(last, 0)], t)


class LoadedValues(ArcValues):
    """Reads an arc whose flows carry states, inputs and outputs, see `ArcValues.channels`.

    Parameters
    ----------
    automaton : Automaton
        Whose variables.
    parameter_times : ndarray, shape (n,)
        Times in s from which on the parameters are constant, ascending.
    parameters : ndarray, shape (n, size)
        The parameter vector from each of those times on.
    errors : ndarray
        Interpolation error of each channel.
    """

    def __init__(
        self, automaton: Automaton, parameter_times: FloatArray, parameters: FloatArray, errors: FloatArray
    ) -> None:
        super().__init__(automaton)
        self._parameter_times, self._parameters = parameter_times, parameters
        self.errors = errors

    def parameters(self, t: float) -> FloatArray:
        """See `ArcValues.parameters`."""
        row: FloatArray = self._parameters[max(int(np.searchsorted(self._parameter_times, t, side="right")) - 1, 0)]
        return row

    def parameter_steps(self, t0: float, t1: float) -> tuple[FloatArray, FloatArray]:
        """See `ArcValues.parameter_steps`."""
        later = self._parameter_times[(self._parameter_times > t0) & (self._parameter_times <= t1)]
        times = np.concatenate([[t0], later])
        return times, np.array([self.parameters(float(t)) for t in times])

    def states(self, x: FloatArray) -> FloatArray:
        """See `ArcValues.states`."""
        return x[..., : self.layout.sizes[Kind.STATE]]

    def inputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.inputs`."""
        first = self.layout.sizes[Kind.STATE]
        return x[first : first + self.layout.sizes[Kind.INPUT]]

    def outputs(self, t: float, x: FloatArray, z: FloatArray) -> FloatArray:
        """See `ArcValues.outputs`."""
        return x[self.layout.sizes[Kind.STATE] + self.layout.sizes[Kind.INPUT] :]

    def interpolation_error(self, name: str) -> FloatArray:
        """See `ArcValues.interpolation_error`."""
        vectors = {
            Kind.STATE: self.states(self.errors),
            Kind.INPUT: self.inputs(0.0, self.errors, np.zeros(0)),
            Kind.OUTPUT: self.outputs(0.0, self.errors, np.zeros(0)),
        }
        kind = self.variable(name).kind
        return np.array(self._place(name).take(vectors[kind])) if kind in vectors else super().interpolation_error(name)

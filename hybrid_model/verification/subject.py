"""The maps of an automaton at the points of somebody's samples; no code of the simulator is used here."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.elements import gathered
from hybrid_model.declare.real_numbers import is_real, real_array, told
from hybrid_model.declare.signals import InputValue, Signal, require_tunable, unknown_input
from hybrid_model.declare.signatures import ExplainedCall
from hybrid_model.declare.transitions import Assignments, Trigger
from hybrid_model.declare.tuning import tuned_value
from hybrid_model.declare.variables import FloatArray, Kind, Values, Variable, unknown_name
from hybrid_model.errors import DataError, DeclarationError
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.samples import Samples

InputAt = Callable[[float, int], Any]
"""An input at time t of the step that begins with sample k."""


@dataclass(frozen=True)
class Tolerances(ExplainedCall):
    """How exact samples must be to count as a hybrid arc.

    Attributes
    ----------
    time : float, optional
        In s: an event may lie so far from its exact time. Default: 1e-8 of the length of the data.
    rtol : float
        Relative tolerance of values.
    atol : float, optional
        A value may differ from the one recomputed by ``atol + rtol |value|``, in the variable's unit; a margin may be
        on the wrong side of zero by `atol`, in the margin's unit. Default: 1e-9 of each state's nominal value, else of
        its largest in the data; for a margin, what it changes when states move by that.

    Raises
    ------
    DataError
        If a number is not positive and finite.
    """

    time: float | None = None
    rtol: float = 1e-8
    atol: float | None = None

    def __post_init__(self) -> None:
        for name in ("time", "rtol", "atol"):
            given = getattr(self, name)
            if given is None and name != "rtol":
                continue
            if not (is_real(given) and 0.0 < given < math.inf):
                raise DataError(f"tolerance {name} = {told(given)}: give a positive number.")


class Subject:
    """An automaton and samples that claim to be a run of it.

    Parameters
    ----------
    automaton : Automaton
        Its maps and its parameter values.
    data : Samples or HybridArc
        With every state; an arc gives its inputs between samples too.
    inputs : mapping, optional
        Input name -> number, array, function of time or `Signal`; tunable parameter -> number, array or `Signal`.
    starts : mapping, optional
        Input or parameter -> value of the run in place of the declared one; start values of states are in the data.

    Raises
    ------
    DataError
        If a state is missing or has the wrong shape.
    DeclarationError
        If an input is unknown or has the wrong shape.
    """

    def __init__(
        self,
        automaton: Automaton,
        data: Samples | HybridArc,
        inputs: Mapping[str, InputValue] | None = None,
        starts: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        self.automaton = automaton
        self.samples = data.samples() if isinstance(data, HybridArc) else _own_names(automaton, data)
        self._states = automaton.of_kind(Kind.STATE)
        self._discrete = automaton.of_kind(Kind.DISCRETE)
        self.x = self._columns(self._states)
        self.z = self._columns(self._discrete)
        self.guards = [k for k, info in enumerate(automaton.jumps) if info.trigger is Trigger.STATE]
        self.timed = [k for k, info in enumerate(automaton.jumps) if info.trigger is Trigger.TIME]
        self._starts = _starts(automaton, starts or {})
        self._fixed = {v.name: self._starts[v.name] for v in automaton.of_kind(Kind.PARAMETER) if not v.tunable}
        self.breakpoints: FloatArray = np.zeros(0)
        self._inputs = self._input_sources(data, inputs or {})

    def values(self, t: float, x: FloatArray, k: int) -> Values:
        """Return all values at time `t` of the step that begins with sample `k`, with the states `x`."""
        found: dict[str, Any] = {"t": t, **self._fixed}
        for variables, vector in ((self._states, x), (self._discrete, self.z[k])):
            at = 0
            for variable in variables:
                found[variable.name] = _value(variable, vector[at : at + variable.size])
                at += variable.size
        found.update((name, source(t, k)) for name, source in self._inputs.items())
        return Values(self.automaton.name, found)

    def rates(self, t: float, x: FloatArray, k: int) -> FloatArray:
        """Return the time derivatives of the continuous states, in one vector."""
        with np.errstate(all="ignore"):
            rates = self.automaton.derivatives(self.values(t, x, k))
        return _vector(self._states, rates, np.zeros(len(x)))

    def flow_margin(self, t: float, x: FloatArray, k: int) -> float:
        """Return the margin of the flow set."""
        if not self.automaton.has_flow_set:
            return math.inf
        with np.errstate(all="ignore"):
            return float(self.automaton.flow_margin(self.values(t, x, k)))

    def jump_margins(self, t: float, x: FloatArray, k: int) -> FloatArray:
        """Return the margins of the jumps on state, in the order of `guards`."""
        if not self.guards:
            return np.zeros(0)
        with np.errstate(all="ignore"):
            return np.array([float(margin) for margin in self.automaton.jump_margins(self.values(t, x, k))])

    def event_times(self, k: int) -> FloatArray:
        """Return the times in s of the jumps on time at sample `k`, in the order of `timed`."""
        if not self.timed:
            return np.zeros(0)
        with np.errstate(all="ignore"):
            times = self.automaton.event_times(self.values(float(self.samples.t[k]), self.x[k], k))
        return np.array([float(time) for time in times])

    def reset(self, jump: int, k: int) -> FloatArray:
        """Return continuous and discrete states after a jump from sample `k`, in one vector."""
        with np.errstate(all="ignore"):
            new = self.automaton.reset(jump, self.values(float(self.samples.t[k]), self.x[k], k))
        return np.concatenate(
            [_vector(self._states, new, self.x[k]), _vector(self._discrete, new, self.z[k])],
        )

    @property
    def names(self) -> list[str]:
        """Name of every scalar of x, then of z; elements counted from 1."""
        return [
            v.name if not v.shape else f"{v.name}[{','.join(str(i + 1) for i in index)}]"
            for v in (*self._states, *self._discrete)
            for index in np.ndindex(*v.shape)
        ]

    def _columns(self, variables: list[Variable]) -> FloatArray:
        rows = len(self.samples)
        columns = []
        for variable in variables:
            if variable.name not in self.samples.values:
                raise DataError(
                    f"the samples have no {variable.name}, a state of {self.automaton.name}: give a column for each of "
                    f"{', '.join(v.name for v in (*self._states, *self._discrete))}."
                )
            given = self.samples.values[variable.name]
            if given.shape[1:] != variable.shape:
                raise DataError(
                    f"{variable.name} has shape {given.shape[1:]} in the samples, but {variable.shape} in "
                    f"{self.automaton.name}."
                )
            columns.append(given.reshape(rows, variable.size))
        return np.concatenate([np.zeros((rows, 0)), *columns], axis=1)

    def _input_sources(self, data: Samples | HybridArc, given: Mapping[str, InputValue]) -> dict[str, InputAt]:
        owner, parameters = self.automaton.name, {v.name: v for v in self.automaton.of_kind(Kind.PARAMETER)}
        variables = {v.name: v for v in self.automaton.of_kind(Kind.INPUT)}
        for name in given:
            if name in parameters:
                require_tunable(owner, parameters[name], given[name])
            elif name not in variables:
                raise DeclarationError(unknown_input(owner, name, variables))
        variables |= {name: variable for name, variable in parameters.items() if variable.tunable}
        sources = {}
        for name, variable in variables.items():
            if name in given:
                sources[name] = self._given(variable, given[name])
            elif name in self.samples.values:
                sources[name] = self._sampled(variable, data)
            else:
                sources[name] = _constant(self._starts[name])
        return sources

    def _given(self, variable: Variable, value: InputValue) -> InputAt:
        # The sets are also looked at a little before and after a sample, where the user's function need not be defined.
        known = self.samples.t[np.isfinite(self.samples.t)]
        start, end = (float(known.min()), float(known.max())) if known.size else (-math.inf, math.inf)
        if isinstance(value, Signal):
            own = np.unique(np.asarray(value.breakpoints, dtype=np.float64))
            self.breakpoints = np.union1d(self.breakpoints, own)
            function = _held(value.value, own, start) if variable.tunable else value.value
        elif callable(value):
            function = value
        else:
            return _constant(_input(variable, value))
        return lambda t, k: _input(variable, function(min(max(t, start), end)))

    def _sampled(self, variable: Variable, data: Samples | HybridArc) -> InputAt:
        """Read an input off the data: between samples by an arc's own function of time, else by a rule."""
        t, column = self.samples.t, self.samples.values[variable.name]
        if np.all(column == column[:1]):
            return _constant(_value(variable, column[0]))
        # Anything may happen to an input at a sample, so nothing is integrated across one.
        self.breakpoints = np.union1d(self.breakpoints, t[np.isfinite(t)])
        if isinstance(data, HybridArc) and not (variable.discrete or variable.tunable):
            return lambda time, k: _value(variable, data.at(variable.name, np.clip(time, t[0], t[-1])))

        def source(time: float, k: int) -> Any:
            length = t[k + 1] - t[k] if k + 1 < len(t) else 0.0
            if variable.discrete or variable.tunable or not length > 0.0:
                return _value(variable, column[k])
            part = (time - t[k]) / length
            return _value(variable, (1.0 - part) * column[k] + part * column[k + 1])

        return source


def _starts(automaton: Automaton, given: Mapping[str, npt.ArrayLike]) -> dict[str, Any]:
    """Return the values of inputs and parameters at the start of a run that was given some starts."""
    variables = {v.name: v for v in automaton.of_kind(Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)}
    found = {name: _value(variable, variable.start.ravel()) for name, variable in variables.items()}
    for name, value in gathered(automaton.name, {n: v.start for n, v in variables.items()}, given).items():
        if name not in variables:
            raise DeclarationError(f"starts: {unknown_name(automaton.name, name, variables)}")
        found[name] = _value(variables[name], tuned_value(variables[name], value, "start value"))
    return found


def _own_names(automaton: Automaton, samples: Samples) -> Samples:
    """Return samples under the automaton's own names, where a co-simulation has put the block's before them."""
    states = {v.name for v in automaton.of_kind(Kind.STATE, Kind.DISCRETE)}
    scope = f"{automaton.name}."
    if states & set(samples.values) or not states <= {name.removeprefix(scope) for name in samples.values}:
        return samples
    own = {name.removeprefix(scope): value for name, value in samples.values.items() if name.startswith(scope)}
    return Samples(samples.t, samples.j, own)


def _value(variable: Variable, flat: FloatArray) -> Any:
    array = np.asarray(flat, dtype=np.float64)
    if not variable.shape:
        return array.reshape(-1)[0]
    value = array.reshape(variable.shape)
    # As in a run: a map that writes into it would write into the samples.
    value.flags.writeable = False
    return value


def _input(variable: Variable, given: Any) -> Any:
    """Return an input that somebody gave, as a number or an array of the input's shape."""
    try:
        array = real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(f"input {variable.name} is {told(given)}: give numbers.") from error
    if array.shape not in ((), variable.shape):
        raise DeclarationError(
            f"input {variable.name} has shape {variable.shape}, but the value given has shape {array.shape}: give one "
            f"number for all elements, or an array of shape {variable.shape}."
        )
    return _value(variable, np.broadcast_to(array, variable.shape))


def _constant(value: Any) -> InputAt:
    return lambda t, k: value


def _held(function: Callable[[float], Any], breakpoints: FloatArray, start: float) -> Callable[[float], Any]:
    """Return the function that holds from the start, and from each breakpoint, what it is there."""

    def value(t: float) -> Any:
        return function(max([start, *breakpoints[breakpoints <= t].tolist()]))

    return value


def _vector(variables: list[Variable], assigned: Assignments, otherwise: FloatArray) -> FloatArray:
    vector = otherwise.copy()
    at = 0
    for variable in variables:
        if variable.name in assigned:
            vector[at : at + variable.size] = _flat(variable, assigned[variable.name])
        at += variable.size
    return vector


def _flat(variable: Variable, value: Any) -> FloatArray:
    try:
        array = real_array(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(
            f"the value computed for {variable.name} is {told(value)}: return one number, or an array of numbers."
        ) from error
    if array.shape not in ((), variable.shape):
        raise DeclarationError(
            f"the value computed for {variable.name} has shape {array.shape}, but {variable.name} has shape "
            f"{variable.shape}: return one number, or an array of that shape."
        )
    return array.ravel()

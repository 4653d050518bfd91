"""Inputs of a run: constants, functions of time, and functions with known discontinuities."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.elements import filled, gathered
from hybrid_model.declare.layout import Layout, Place
from hybrid_model.declare.real_numbers import real_array, told
from hybrid_model.declare.signatures import ExplainedCall, require_map
from hybrid_model.declare.tuning import Steps, start_vectors, tuned_value
from hybrid_model.declare.variables import FloatArray, Kind, Variable, start_array, unknown_name
from hybrid_model.errors import DeclarationError, SimulationError


@dataclass(frozen=True)
class Signal(ExplainedCall):
    """A function of time that jumps at known times, or does something short there.

    A run sees a plain function of time only at the points that its solver chooses, and steps over a pulse between two
    of them in silence; it never steps over a breakpoint. A pulse is ``Signal(lambda t: 1.0 if 50 <= t < 50.1 else 0.0,
    [50, 50.1])``.

    Attributes
    ----------
    value : callable
        ``value(t) -> float or array``, continuous from the right.
    breakpoints : sequence of float
        Times in s at which it is discontinuous, in any order; runs stop there and go on.

    Raises
    ------
    DeclarationError
        If the value is no function of one time, or the breakpoints are no finite times.
    """

    value: Callable[[float], npt.ArrayLike]
    breakpoints: Sequence[float] = ()

    def __post_init__(self) -> None:
        require_map("value of a Signal", self.value, ("t",))
        _require_times(self.breakpoints)


InputValue = npt.ArrayLike | Callable[[float], npt.ArrayLike] | Signal


class Inputs:
    """What comes from outside as functions of time: the input vector u of an automaton, and its parameter vector p.

    Parameters
    ----------
    layout : Layout
        Of the automaton.
    given : mapping, optional
        Input name -> number, array, function of time or `Signal`; inputs not named keep their start values. A tunable
        parameter is given like a discrete input: it takes the value of its `Signal` at the start and at each
        breakpoint, and holds it in between.
    starts : mapping, optional
        Name of a state, discrete state, input or parameter -> start value in place of the declared one.

    Attributes
    ----------
    layout : Layout
        The same.

    Raises
    ------
    DeclarationError
        For an unknown input, a parameter that is not tunable, or a value of the wrong shape.
    """

    def __init__(
        self,
        layout: Layout,
        given: Mapping[str, InputValue] | None = None,
        starts: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        self.layout = layout
        self._starts = start_vectors(layout, starts)
        self._held = self._starts[Kind.INPUT]
        self._signals: list[tuple[Place, Callable[[float], npt.ArrayLike], tuple[float, ...]]] = []
        self._parameters = self._starts[Kind.PARAMETER]
        self._tuned: list[tuple[Place, Steps]] = []
        breakpoints: list[float] = []
        places = {place.variable.name: place for place in layout.places[Kind.INPUT]}
        parameters = {place.variable.name: place for place in layout.places[Kind.PARAMETER]}
        declared = {name: place.variable.start for name, place in (places | parameters).items()}
        for name, value in gathered(f"{layout.owner} (inputs)", declared, given or {}, _joined).items():
            if name in parameters:
                breakpoints += self._tune(parameters[name], value)
            elif name not in places:
                raise DeclarationError(unknown_input(layout.owner, name, places))
            elif isinstance(value, Signal):
                times = [float(b) for b in value.breakpoints]
                self._signals.append((places[name], value.value, tuple(times)))
                breakpoints += times
            elif callable(value):
                require_map(f"input {name}", value, ("t",))
                if places[name].variable.discrete:
                    raise DeclarationError(
                        f"{layout.owner}: input {name} changes at jumps only, so it cannot be a plain "
                        "function of time: give a number, or a Signal with the times at which it changes."
                    )
                self._signals.append((places[name], value, ()))
            else:
                self.hold(name, value)
        self._breakpoints = sorted(breakpoints)

    def start(self, kind: Kind) -> FloatArray:
        """Return the vector of start values of states or of discrete states."""
        return self._starts[kind].copy()

    def _tune(self, place: Place, value: InputValue) -> list[float]:
        """Take what is given for a parameter, and return its breakpoints."""
        require_tunable(self.layout.owner, place.variable, value)
        if isinstance(value, Signal):
            times = [float(b) for b in value.breakpoints]
            self._tuned.append((place, Steps(place.variable, value.value, times)))
            return times
        assert not callable(value)
        self._parameters[place.at] = tuned_value(place.variable, value)
        return []

    def parameters_at(self, t: float) -> FloatArray:
        """Return p at time `t`, continuous from the right; the array must not be written to."""
        if not self._tuned:
            return self._parameters
        p = self._parameters.copy()
        for place, steps in self._tuned:
            p[place.at] = steps.at(t)
        return p

    def parameter_steps(self, t0: float, t1: float) -> tuple[FloatArray, FloatArray]:
        """Return the times in [t0, t1] from which on p is constant, t0 first, and p from there, one row a time."""
        times = sorted({t0, *(b for _, steps in self._tuned for b in steps.times if t0 < b <= t1)})
        return np.array(times), np.array([self.parameters_at(t) for t in times])

    def hold_parameter(self, index: int, value: float) -> bool:
        """Set one scalar of p to a constant; return whether that changed it."""
        changed = bool(self._parameters[index] != value)
        if changed:
            self._parameters = self._parameters.copy()
            self._parameters[index] = value
        return changed

    def hold(self, name: str, value: npt.ArrayLike) -> bool:
        """Set an input to a constant; return whether that changed it."""
        place = next((q for q in self.layout.places[Kind.INPUT] if q.variable.name == name), None)
        if place is None:
            raise DeclarationError(unknown_input(self.layout.owner, name, dict.fromkeys(self.names)))
        given = start_array(f"{self.layout.owner}.{name}", value)
        if given.shape not in ((), place.variable.shape):
            raise DeclarationError(
                f"input {name} has shape {place.variable.shape}, but the value given has shape {given.shape}: give one "
                "number, or an array of that shape; a table over time is a function, "
                "lambda t: np.interp(t, times, values)."
            )
        before, self._held = self._held, self._held.copy()
        self._held[place.at] = given.ravel() if given.shape else given
        return not np.array_equal(before, self._held)

    def hold_element(self, index: int, value: float) -> bool:
        """Set one scalar of u to a constant; return whether that changed it."""
        changed = bool(self._held[index] != value)
        if changed:
            self._held = self._held.copy()
            self._held[index] = value
        return changed

    @property
    def held(self) -> FloatArray:
        """The constants in u; the array must not be written to."""
        return self._held

    @property
    def names(self) -> list[str]:
        """Names of the inputs."""
        return [place.variable.name for place in self.layout.places[Kind.INPUT]]

    @property
    def signals(self) -> Sequence[tuple[Place, Callable[[float], npt.ArrayLike], tuple[float, ...]]]:
        """The inputs that are functions of time: their places, functions, and breakpoints in s."""
        return self._signals

    @property
    def tuned(self) -> Sequence[Place]:
        """The parameters that change in a run."""
        return [place for place, _ in self._tuned]

    def breakpoints_in(self, t0: float, t1: float) -> list[float]:
        """Return the breakpoints of inputs and parameters in (t0, t1], in order, each once."""
        return sorted({b for b in self._breakpoints if t0 < b <= t1})

    @property
    def vary(self) -> bool:
        """Whether some input is a function of time."""
        return bool(self._signals)

    def at(self, t: float) -> FloatArray:
        """Return u at time `t`; the array must not be written to."""
        return self.with_held(self._held, t)

    def with_held(self, held: FloatArray, t: float) -> FloatArray:
        """Return u at time `t` as it is with other constants in it; the array must not be written to."""
        if not self._signals:
            return held
        u = held.copy()
        for place, signal, _ in self._signals:
            u[place.at] = sampled_signal(place.variable, signal, t)
        return u

    def next_breakpoint(self, t: float) -> float:
        """Return the first breakpoint after `t`, or infinity."""
        return next((b for b in self._breakpoints if b > t), math.inf)

    def copy(self) -> Inputs:
        """Return an independent copy."""
        other = copy.copy(self)
        other._held = self._held.copy()
        return other


def _joined(start: FloatArray, values: Mapping[tuple[int, ...], InputValue]) -> InputValue:
    """Return what is given for some elements of an array as one value of it."""
    if not any(callable(value) or isinstance(value, Signal) for value in values.values()):
        return filled(start, values)  # type: ignore[no-any-return]
    parts = {place: value.value if isinstance(value, Signal) else value for place, value in values.items()}

    def joined(t: float) -> npt.ArrayLike:
        now = {place: part(t) if callable(part) else part for place, part in parts.items()}
        return filled(start, now)  # type: ignore[no-any-return]

    # Plain functions of time stay plain: an array is one if any of its elements is.
    plain = any(callable(value) and not isinstance(value, Signal) for value in values.values())
    times = [b for value in values.values() if isinstance(value, Signal) for b in value.breakpoints]
    return joined if plain and not times else Signal(joined, times)


def require_tunable(owner: str, variable: Variable, value: InputValue) -> None:
    """Refuse to change a parameter that is fixed for a run, or in another way than at events.

    Raises
    ------
    DeclarationError
        With what to give instead.
    """
    if not variable.tunable:
        raise DeclarationError(
            f"{owner}: parameter {variable.name} is fixed for a run: give its value when the instance is made, or "
            "declare it with tunable=True."
        )
    if callable(value) and not isinstance(value, Signal):
        raise DeclarationError(
            f"{owner}: parameter {variable.name} changes at events only, so it cannot be a plain function of time: "
            "give a number, or a Signal with the times at which it changes."
        )


def unknown_input(owner: str, name: str, known: Mapping[str, object]) -> str:
    """Return the sentence for an input that an automaton does not have."""
    if not known:
        return f"{owner} has no input {name!r}; it has no inputs: leave it out."
    return unknown_name(owner, name, known, "input")


def _require_times(given: Sequence[float]) -> None:
    try:
        breakpoints = real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(f"a Signal has the breakpoints {told(given)}: give times in s.") from error
    if breakpoints.ndim != 1 or not np.isfinite(breakpoints).all():
        raise DeclarationError(f"a Signal has the breakpoints {told(given)}: give a sequence of finite times in s.")


def sampled_signal(variable: Variable, signal: Callable[[float], npt.ArrayLike], t: float) -> FloatArray:
    """Return what a function of time gives for an input at `t` in s: one number for all elements, or a row.

    Raises
    ------
    SimulationError
        If that is no finite number, or of another shape than the input.
    """
    given = signal(t)
    try:
        value = real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise SimulationError(f"input {variable.name} is {told(given)} at t = {t:.9g} s: return numbers.") from error
    if value.shape not in ((), variable.shape):
        raise SimulationError(
            f"input {variable.name} has shape {variable.shape}, but its function gives shape {value.shape} at "
            f"t = {t:.9g} s: return one number for all elements, or an array of shape {variable.shape}."
        )
    if not np.all(np.isfinite(value)):
        raise SimulationError(f"input {variable.name} is {value} at t = {t:.9g} s: inputs must be finite.")
    return value.ravel() if value.shape else value

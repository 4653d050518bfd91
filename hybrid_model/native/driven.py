"""Inputs that are functions of time, on the engine in C.

A function without breakpoints is traced: it becomes a part of the model's maps. One with breakpoints is, between two of
them, a polynomial of time whose coefficients are inputs of the compiled model: whoever runs it changes them at each
breakpoint. One that is no polynomial there is traced as well, and sees times of the present piece only, whose ends are
such inputs too. What is none of these runs in Python.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from hybrid_model.declare.layout import Place
from hybrid_model.declare.signals import Inputs, sampled_signal
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError, TraceError
from hybrid_model.native.symbols import expressions, symbols
from hybrid_model.native.trace import ARGUMENTS, Trace

DEGREE = 8
"""Of the polynomials."""
_SEED_POINTS = 23
"""Points of a piece at which a polynomial must hold: none of them is one of the points it was made from."""
_HELD = 64.0
"""In units of rounding of the largest value: how well."""
_OF_PIECE = 4
"""Numbers in front of the coefficients: middle and half of the length of a piece, its start, the last time in it."""


@dataclass(frozen=True)
class _Pieced:
    """An input that is a polynomial between breakpoints."""

    place: Place
    signal: Callable[[float], npt.ArrayLike]
    known: dict[float, FloatArray] = field(default_factory=dict)

    def on(self, a: float, b: float, last: float) -> FloatArray:
        """Return what `_fitted` does, once for a piece."""
        if a not in self.known:
            self.known[a] = _fitted(self.place, self.signal, a, b, last)
        return self.known[a]


@dataclass(frozen=True)
class Driven:
    """Inputs that follow functions of time.

    Attributes
    ----------
    followed : casadi.Function
        Of time, the input vector and the coefficients behind it: the input vector that the maps get.
    pieced : tuple of _Pieced
        The inputs that are polynomials, in the order of their coefficients.
    """

    followed: ca.Function
    pieced: tuple[_Pieced, ...]

    @functools.cached_property
    def key(self) -> bytes:
        """The same for all that make one model of one automaton."""
        return str(self.followed.serialize()).encode()

    def driving(self, traced: Trace) -> Trace:
        """Return the maps of an automaton whose inputs these are, with the coefficients behind its input vector."""

        def function(given: ca.Function) -> ca.Function:
            t, x, z, u, p = (ca.SX.sym(name, given.size1_in(k)) for k, name in enumerate(ARGUMENTS))
            extra = ca.SX.sym("coefficients", self.extra)
            followed = self.followed(t, u, extra)
            return ca.Function(given.name(), [t, x, z, ca.vertcat(u, extra), p], given.call([t, x, z, followed, p]))

        return replace(
            traced,
            start=function(traced.start),
            flow=function(traced.flow),
            flow_set=function(traced.flow_set),
            margins=function(traced.margins),
            times=function(traced.times),
            outputs=function(traced.outputs),
            resets=tuple(map(function, traced.resets)),
        )

    @property
    def extra(self) -> int:
        """Number of inputs that the model has behind those of the automaton."""
        return int(self.followed.size1_in(2))

    def coefficients(self, a: float, b: float, *, closed: bool) -> FloatArray:
        """Return what the extra inputs are on a piece from `a` to `b`, in s, its end included if it is `closed`.

        Raises
        ------
        TraceError
            If a signal is no polynomial there.
        SimulationError
            If it gives what the input cannot be.
        """
        if not self.extra:
            return np.zeros(0)
        last = _last(a, b, closed=closed)
        rows = [pieced.on(a, b, last) for pieced in self.pieced]
        return np.concatenate([[0.5 * (a + b), 0.5 * (b - a) or 1.0, a, last], *(row.ravel() for row in rows)])


def given_on(
    inputs: Inputs, driven: Driven | None, a: float, b: float, *, closed: bool
) -> tuple[FloatArray, FloatArray]:
    """Return what is given from outside between two breakpoints: inputs of the compiled model, and parameters.

    Parameters
    ----------
    inputs : Inputs
        As functions of time.
    driven : Driven, optional
        Those that vary.
    a, b : float
        The breakpoints, in s.
    closed : bool
        Whether the end is part of the piece, as at the end of a run.
    """
    extra = np.zeros(0) if driven is None else driven.coefficients(a, b, closed=closed)
    return np.concatenate([inputs.held, extra]), inputs.parameters_at(a)


def drive(inputs: Inputs, span: tuple[float, float]) -> Driven:
    """Return inputs that follow functions of time from the start to the end of a span, in s.

    Raises
    ------
    TraceError
        If a function cannot be traced, and has no breakpoints or is no polynomial between two of them.
    """
    t, u, of_piece = ca.SX.sym("t"), ca.SX.sym("u", len(inputs.held)), ca.SX.sym("piece", _OF_PIECE)
    ends = [span[0], *inputs.breakpoints_in(*span), span[1]]
    elements = ca.vertsplit(u)
    pieced = []
    for place, signal, breakpoints in inputs.signals:
        if not breakpoints:
            elements[place.at] = _traced(place, signal, t)
        elif (unfitted := _unfitted(one := _Pieced(place, signal), ends)) is None:
            pieced.append(one)
        else:
            # A step that ends at a breakpoint must not see what is from there on.
            inside = ca.fmin(ca.fmax(t, of_piece[2]), of_piece[3])
            try:
                elements[place.at] = _traced(place, signal, inside)
            except TraceError as error:
                raise TraceError(f"{unfitted} And {error}") from error
    size = sum(one.place.variable.size for one in pieced) * (DEGREE + 1)
    any_pieces = any(breakpoints for _, _, breakpoints in inputs.signals)
    coefficients = ca.vertcat(of_piece, ca.SX.sym("coefficients", size)) if any_pieces else ca.SX.sym("none", 0)
    first = _OF_PIECE
    for place in (one.place for one in pieced):
        last = first + place.variable.size * (DEGREE + 1)
        columns = [coefficients[first + k : last : DEGREE + 1] for k in range(DEGREE + 1)]
        elements[place.at] = ca.vertsplit(_clenshaw(columns, (t - coefficients[0]) / coefficients[1]))
        first = last
    return Driven(ca.Function("followed", [t, u, coefficients], [ca.vertcat(*elements)]), tuple(pieced))


def _last(a: float, b: float, *, closed: bool) -> float:
    # At the end a signal is the next piece's already, if there is one.
    return b if closed else float(np.nextafter(b, a))


def _unfitted(pieced: _Pieced, ends: Sequence[float]) -> TraceError | None:
    """Return why a signal that may change between its breakpoints is no polynomial on some piece of a run."""
    try:
        for k, (a, b) in enumerate(itertools.pairwise(ends)):
            pieced.on(a, b, _last(a, b, closed=k == len(ends) - 2))
    except TraceError as error:
        if pieced.place.variable.discrete:
            raise
        return error
    except SimulationError:
        pass  # A value that cannot be is told when the run gets there, if it does.
    return None


def _traced(place: Place, signal: Callable[[float], npt.ArrayLike], t: ca.SX) -> list[ca.SX]:
    name, size = place.variable.name, place.variable.size
    try:
        given = expressions(signal(symbols(t)))  # type: ignore[arg-type]
    except (TraceError, RuntimeError, TypeError, ValueError) as error:
        raise TraceError(f"the function of time given for input {name} cannot be traced: {error}") from error
    if len(given) not in (1, size):
        raise TraceError(f"the function of time given for input {name} gives {len(given)} values for {size} elements.")
    return given * size if len(given) == 1 else given


def _clenshaw(columns: Sequence[Any], part: Any) -> Any:
    """Return the sum of coefficients times Chebyshev polynomials at `part`, from -1 to 1."""
    one, two = 0.0 * columns[0], 0.0 * columns[0]
    for column in reversed(columns[1:]):
        one, two = column + 2.0 * part * one - two, one
    return columns[0] + part * one - two


def _fitted(place: Place, signal: Callable[[float], npt.ArrayLike], a: float, b: float, last: float) -> FloatArray:
    """Return the coefficients of a signal on a piece, shape (size, DEGREE + 1), asked up to the time `last`."""
    size = place.variable.size

    def values(parts: FloatArray) -> FloatArray:
        times = np.clip(0.5 * (a + b) + 0.5 * (b - a) * parts, a, last)
        return np.array([np.broadcast_to(sampled_signal(place.variable, signal, float(t)), size) for t in times])

    nodes = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    basis = np.cos(np.outer(np.arange(DEGREE + 1), np.arccos(nodes)))
    apart = np.linspace(-1.0, 1.0, _SEED_POINTS)
    given, seen = values(nodes), values(apart)
    constant = (given == given[0]).all() and (seen == given[0]).all()
    if place.variable.discrete and not constant:
        raise TraceError(f"the discrete input {place.variable.name} changes between its breakpoints.")
    coefficients = basis @ given * (2.0 / (DEGREE + 1))
    coefficients[0] *= 0.5
    if constant:
        # To the last bit: maps may ask whether a value is another one than before.
        coefficients[0], coefficients[1:] = given[0], 0.0
    largest = float(np.abs(seen).max(initial=0.0))
    error = float(np.abs(_clenshaw(list(coefficients[:, None, :]), apart[:, None]) - seen).max(initial=0.0))
    if not error <= _HELD * np.finfo(float).eps * largest:
        raise TraceError(
            f"the signal given for input {place.variable.name} is no polynomial of degree {DEGREE} or less from "
            f"t = {a:.9g} to {b:.9g} s."
        )
    return np.ascontiguousarray(coefficients.T)

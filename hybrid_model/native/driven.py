"""Inputs that are functions of time, on the engine in C.

A function without breakpoints is traced: it becomes a part of the model's maps. One with breakpoints is, between two of
them, a polynomial of time whose coefficients are inputs of the compiled model: whoever runs it changes them at each
breakpoint. What is neither runs in Python.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from hybrid_model.declare.layout import Place
from hybrid_model.declare.signals import Inputs, sampled_signal
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import TraceError
from hybrid_model.native.symbols import expressions, symbols
from hybrid_model.native.trace import ARGUMENTS, Trace

DEGREE = 8
"""Of the polynomials."""
_SEED_POINTS = 23
"""Points of a piece at which a polynomial must hold: none of them is one of the points it was made from."""
_HELD = 64.0
"""In units of rounding of the largest value: how well."""


@dataclass(frozen=True)
class Driven:
    """Inputs that follow functions of time.

    Attributes
    ----------
    followed : casadi.Function
        Of time, the input vector and the coefficients behind it: the input vector that the maps get.
    pieced : tuple of (Place, callable)
        The inputs that are polynomials, in the order of their coefficients.
    """

    followed: ca.Function
    pieced: tuple[tuple[Place, Callable[[float], npt.ArrayLike]], ...]

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
        return _extra(self.pieced)

    def coefficients(self, a: float, b: float, *, closed: bool) -> FloatArray:
        """Return what the extra inputs are on a piece from `a` to `b`, in s, its end included if it is `closed`.

        Raises
        ------
        TraceError
            If a signal is no polynomial there.
        SimulationError
            If it gives what the input cannot be.
        """
        if not self.pieced:
            return np.zeros(0)
        # At the end the signal is the next piece's already, if there is one.
        last = b if closed else float(np.nextafter(b, a))
        rows = [_fitted(place, signal, a, b, last) for place, signal in self.pieced]
        return np.concatenate([[0.5 * (a + b), 0.5 * (b - a) or 1.0], *(row.ravel() for row in rows)])


def drive(inputs: Inputs) -> Driven:
    """Return inputs that follow functions of time.

    Raises
    ------
    TraceError
        If a function without breakpoints cannot be traced.
    """
    t, u = ca.SX.sym("t"), ca.SX.sym("u", len(inputs.held))
    elements = ca.vertsplit(u)
    pieced = []
    for place, signal, breakpoints in inputs.signals:
        if breakpoints:
            pieced.append((place, signal))
        else:
            elements[place.at] = _traced(place, signal, t)
    coefficients = ca.SX.sym("coefficients", _extra(pieced))
    first = 2
    for place, _ in pieced:
        last = first + place.variable.size * (DEGREE + 1)
        columns = [coefficients[first + k : last : DEGREE + 1] for k in range(DEGREE + 1)]
        elements[place.at] = ca.vertsplit(_clenshaw(columns, (t - coefficients[0]) / coefficients[1]))
        first = last
    return Driven(ca.Function("followed", [t, u, coefficients], [ca.vertcat(*elements)]), tuple(pieced))


def _extra(pieced: Sequence[tuple[Place, Any]]) -> int:
    return 2 + sum(place.variable.size for place, _ in pieced) * (DEGREE + 1) if pieced else 0


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

"""Weights given by a Python function of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import not_negative
from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.consensus.clocks.rows import RowAutomaton, RowClock, check_rows
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.weights.edge_automata import EdgeAutomaton
from hybrid_model.consensus.weights.primitive import Primitive
from hybrid_model.consensus.weights.tabulated import common_clock
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.declare.variables import Value

__all__ = ["FunctionCarrier", "FunctionWeight", "FunctionWeights", "TimeFunction"]

TimeFunction = Callable[[Any], Any]
"""A function of time [s] in numpy style: the same line serves floats, arrays and symbols."""

_CHECKS, _SAMPLES = 257, 2049
_ROUNDING = 1e-12
"""Share of the largest value by which rounding may leave a weight below 0."""
_TRIED = 100.0
"""Time [s] over which a function without a period is tried out."""


@dataclass(frozen=True)
class FunctionCarrier:
    """The function itself as a carrier; two are equal if they hold the same function object."""

    function: TimeFunction
    kinks: tuple[float, ...] = ()
    period: float | None = None

    @cached_property
    def rate(self) -> float:
        """An estimate: as many half waves as the samples of one period, or of 100 s, have turning points."""
        span = self.period if self.period is not None else _TRIED
        rises = np.sign(np.diff(self.value(np.linspace(0.0, span, _SAMPLES))))
        rises = rises[rises != 0]
        return float(np.pi * np.count_nonzero(rises[1:] != rises[:-1]) / span)

    @property
    def steepness(self) -> None:
        """None: not known."""

    @cached_property
    def clock(self) -> RowClock | None:
        """The kinks as beginnings of rows; None if there are none."""
        return RowClock(self.kinks, self.period) if self.kinks else None

    @cached_property
    def _primitive(self) -> Primitive:
        return Primitive(self.value, self.breakpoints, self.period)

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Kinks strictly between `t0` and `t1` [s], ascending."""
        return self.clock.breakpoints(t0, t1) if self.clock is not None else np.empty(0)

    def value(self, t: Value) -> Value:
        """Value at time `t` [s]; what is below 0 counts as 0."""
        return not_negative(self.raw(t))

    def raw(self, t: Value) -> Value:
        """What the function gives at time `t` [s], below 0 or not, in the shape of `t`."""
        return self.function(t) + 0.0 * t

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Integral from `t0` to `t1` [s] by Gauss quadrature, to about 12 digits of the integral of one cell."""
        begin, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        return self._primitive(end) - self._primitive(begin)


class FunctionWeights(RowAutomaton, EdgeAutomaton):
    """Weights that are functions of time given in Python; the rows begin where one of them has a kink.

    Parameters
    ----------
    functions : sequence of callable
        For each edge ``function(t)`` in numpy style, continuous; what is below 0 counts as 0.
    name : str, optional
        Name of the instance.
    **values
        ``starts`` (the kinks) and ``period``.
    """

    def __init__(self, functions: Sequence[TimeFunction], name: str | None = None, **values: Any) -> None:
        self.functions = tuple(functions)
        super().__init__(name, degree=len(self.functions), **{"starts": [0.0], **values})

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": np.stack([FunctionCarrier(function).value(s.t) for function in self.functions])}

    @classmethod
    def are_columns(cls, waveforms: Sequence[Any]) -> bool:
        """Whether all are one function."""
        return len(set(waveforms)) == 1

    @classmethod
    def of(cls, waveforms: Sequence[Any]) -> Self:
        """The functions, and the kinks of all; ScenarioError if these have no common period."""
        clocks = [waveform.carrier.clock for waveform in waveforms if waveform.carrier.clock is not None]
        clock = common_clock(clocks) if clocks else RowClock((0.0,))
        return cls([waveform.function for waveform in waveforms], starts=clock.starts, period=clock.period or 0.0)


@dataclass(frozen=True)
class FunctionWeight(Waveform):
    """A weight that is a given function of time.

    Parameters
    ----------
    function : callable
        ``function(t)`` in numpy style (``np.where``, ``np.exp``, ... instead of ``if`` and ``math``), so that it runs
        on arrays and is traced into exported FMUs. It must be at least 0, up to rounding, and continuous; a weight that
        also jumps is this one under a switching, or a table. What is below 0 counts as 0, in all executions.
    kinks : tuple of float
        Times [s] of the points where it is not smooth, ascending; those of one period if it has a period. Runs stop
        there and go on.
    period : float, optional
        A period of the function [s].

    Raises
    ------
    ScenarioError
        If it is no function, or none that takes arrays.
    ValueError
        If the function is negative by more than rounding, not finite or not periodic at one of the times at which this
        is tried out, or the kinks do not ascend within one period.
    """

    function: TimeFunction
    kinks: tuple[float, ...] = ()
    period: float | None = None
    automaton = FunctionWeights

    def __post_init__(self) -> None:
        """Try the function out."""
        if not callable(self.function) or isinstance(self.function, type):
            raise ScenarioError(f"the weight is {self.function!r}, no function: write lambda t: ..., in numpy style.")
        if self.period is not None:
            require("period", self.period, self.period > 0, "must be positive")
        if self.kinks:
            check_rows(self.kinks, self.period, ("kinks", "period"))
        span = self.period if self.period is not None else _TRIED
        times = np.linspace(0.0, span, _CHECKS)
        values = self._tried(times)
        rounding = _ROUNDING * float(np.max(np.abs(values)))
        for time, value in zip(times.tolist(), values.tolist(), strict=True):
            require(f"the weight at t = {time:.6g}", value, value >= -rounding, "must not be negative")
        if self.period is not None:
            later = self.carrier.raw(times + self.period)
            wrong = np.abs(later - values) > 1e-9 * (1 + values.max())
            if wrong.any():
                time = float(times[wrong.argmax()])
                raise ValueError(
                    f"period is {self.period}, but the weight is {float(values[wrong.argmax()]):.9g} at t = {time:.6g} "
                    f"and {float(later[wrong.argmax()]):.9g} one period later; give a period of the function, or none."
                )

    def _tried(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        try:
            return np.asarray(self.carrier.raw(times))
        except (TypeError, ValueError) as error:
            raise ScenarioError(
                f"the weight is no function in numpy style ({error}): it is called with arrays of times, so write "
                "np.sin, np.where, ... in the place of math.sin and if."
            ) from error

    @cached_property
    def carrier(self) -> FunctionCarrier:
        """The function."""
        return FunctionCarrier(self.function, self.kinks, self.period)

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """1, in the shape of `t` [s]."""
        return np.ones(np.shape(t))

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Kinks strictly between `t0` and `t1` [s], ascending."""
        return self.carrier.breakpoints(t0, t1)

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """Refuse: a file names the function itself."""
        raise entries.error("kind", "function", "must name the function, as 'file.py:function'")

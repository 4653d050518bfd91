"""Fast runs in Python: the maps of an automaton evaluated as CasADi functions.

The maps are traced as for an FMU, and CasADi evaluates the expressions without going through Python: no dictionary of
values, no call for each part of a composition. The numbers are those of the maps, up to the rounding of another order
of operations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.declare.vector_form import VectorForm, vector_form
from hybrid_model.declare.wrapper import Wrapper
from hybrid_model.native.trace import Trace, trace


def compiled(automaton: Automaton) -> Automaton:
    """Return the same automaton with maps that are traced once and then evaluated without Python.

    Parameters
    ----------
    automaton : Automaton
        With maps written in numpy style, as for the export to an FMU.

    Returns
    -------
    Automaton
        Same variables, jumps and clocks; for `hybrid_model.simulate` and everything else that runs automata.

    Raises
    ------
    TraceError
        As in `hybrid_model.native.trace.trace`.
    """
    require_automaton(automaton)
    return _Compiled(automaton)


class _Compiled(Wrapper):
    """An automaton that has a faster vector form."""

    def __init__(self, automaton: Automaton) -> None:
        super().__init__(automaton)
        self.traced = trace(automaton)


class _TracedForm(VectorForm):
    """The vector form over CasADi functions of one vector, t, x, z, u and p one after the other."""

    def __init__(self, automaton: Automaton, traced: Trace) -> None:
        super().__init__(automaton)
        sizes = [1, *(self.layout.sizes[kind] for kind in (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER))]
        ends = np.cumsum(sizes)
        self._x, self._z, self._u, self._p = (slice(ends[k], ends[k + 1]) for k in range(4))
        self._size = int(ends[-1])
        arguments = ca.SX.sym("arguments", self._size)
        split = ca.vertsplit(arguments, [0, *(int(end) for end in ends)])

        def joined(*functions: ca.Function) -> ca.Function:
            results = [result for function in functions for result in function.call(split)]
            return ca.Function("joined", [arguments], [ca.vertcat(*results)])

        margins = joined(traced.margins, *([traced.flow_set] if automaton.has_flow_set else []))
        self._start = _Buffered(joined(traced.start))
        self._rates = _Buffered(joined(traced.flow))
        self._margins = _Buffered(margins)
        self._times = _Buffered(joined(traced.times))
        self._resets = [_Buffered(joined(reset)) for reset in traced.resets]
        self._margin_function, self._along = margins, dict[int, _Buffered]()

    def start(
        self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `VectorForm.start`."""
        return self._split(self._call(self._start, t, x, z, u, p))

    def rates(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """See `VectorForm.rates`."""
        return self._call(self._rates, t, x, z, u, p)

    def margins(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """See `VectorForm.margins`."""
        return self._call(self._margins, t, x, z, u, p)

    def margins_along(
        self, times: FloatArray, x: FloatArray, z: FloatArray, u: Sequence[FloatArray], p: FloatArray
    ) -> FloatArray:
        """See `VectorForm.margins_along`."""
        count = len(times)
        if count not in self._along:
            self._along[count] = _Buffered(self._margin_function.map(count), count)
        along = self._along[count]
        table = along.argument.reshape(count, self._size)
        table[:, 0], table[:, self._x], table[:, self._z], table[:, self._p] = times, x, z, p
        table[:, self._u] = u
        return along().reshape(count, -1)

    def event_times(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """See `VectorForm.event_times`."""
        return self._call(self._times, t, x, z, u, p)

    def reset(
        self, jump: int, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `VectorForm.reset`."""
        return self._split(self._call(self._resets[jump], t, x, z, u, p))

    def _call(
        self, function: _Buffered, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray
    ) -> FloatArray:
        argument = function.argument
        argument[0] = t
        argument[self._x], argument[self._z], argument[self._u], argument[self._p] = x, z, u, p
        return function()

    def _split(self, states: FloatArray) -> tuple[FloatArray, FloatArray]:
        count = self.layout.sizes[Kind.STATE]
        return states[:count], states[count:]


@vector_form.register
def _(automaton: _Compiled) -> VectorForm:
    """Each call has buffers of its own."""
    return _TracedForm(automaton, automaton.traced)


class _Buffered:
    """A CasADi function with its argument and result in two numpy arrays, so that a call converts nothing."""

    def __init__(self, function: ca.Function, count: int = 1) -> None:
        self.argument = np.zeros(function.numel_in(0))
        self._result = np.zeros(function.numel_out(0))
        # The buffer refers to the function and to both arrays without holding them.
        self._function = function
        self._buffer, self._evaluate = _buffer(function)
        if self.argument.size:
            self._buffer.set_arg(0, self.argument.data)
        if self._result.size:
            self._buffer.set_res(0, self._result.data)

    def __call__(self) -> FloatArray:
        self._evaluate()
        return self._result.copy()


def _buffer(function: ca.Function) -> tuple[Any, Callable[[], None]]:
    buffer, evaluate = function.buffer()
    return buffer, evaluate

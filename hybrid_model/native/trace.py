"""Trace an automaton: call its maps once with symbols and keep the expressions as functions.

Every function has the inputs t, x, z, u, p (see hybrid_model/engine/model.h); nothing of the model is written again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.transitions import Assignments, Trigger
from hybrid_model.declare.variables import Kind, Values, Variable
from hybrid_model.errors import TraceError
from hybrid_model.native.symbol_columns import taken_apart
from hybrid_model.native.symbols import expressions, symbol_vector, symbols

if TYPE_CHECKING:
    from scipy import sparse

ARGUMENTS = ("t", "x", "z", "u", "p")
"""Arguments of every traced function, in order."""

_COMPARISONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR)


@dataclass(frozen=True, eq=False)
class Trace:
    """An automaton as functions of (t, x, z, u, p).

    Attributes
    ----------
    automaton : Automaton
        What was traced.
    layout : Layout
        Where each variable lives in x, z, u, p and y.
    start, flow, flow_set, margins, times, outputs : casadi.Function
        See hybrid_model/engine/model.h.
    resets : tuple of casadi.Function
        One a jump, in the order of the automaton's jumps; results x+ and z+.
    """

    automaton: Automaton
    layout: Layout
    start: ca.Function
    flow: ca.Function
    flow_set: ca.Function
    margins: ca.Function
    times: ca.Function
    outputs: ca.Function
    resets: tuple[ca.Function, ...]

    @property
    def inputs(self) -> int:
        """Number of scalars in u."""
        return int(self.flow.size1_in(ARGUMENTS.index("u")))

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """All functions, in a fixed order."""
        return (self.start, self.flow, self.flow_set, self.margins, self.times, self.outputs, *self.resets)

    def pattern(self, result: str, argument: str) -> sparse.csr_array:
        """Return which elements of a result depend on which elements of an argument.

        Parameters
        ----------
        result : {"flow", "outputs", "margins", "flow_set", "start_x", "start_z"}
            Result of a map.
        argument : {"t", "x", "z", "u", "p"}
            Argument of all maps.

        Returns
        -------
        csr_array of bool, shape (elements of the result, elements of the argument)
        """
        name, _, part = result.partition("_")
        which = (self.start, "xz".index(part)) if name == "start" else (getattr(self, result), 0)
        function, row = which
        sparsity = function.jac_sparsity(row, ARGUMENTS.index(argument))
        # Runs need no patterns, and this package takes long to import.
        from scipy import sparse

        rows, columns = sparsity.get_triplet()
        shape = (function.size1_out(row), function.size1_in(ARGUMENTS.index(argument)))
        return sparse.csr_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=shape)

    def changes(self, kind: Kind) -> list[frozenset[int]]:
        """Return which continuous or discrete states each jump may change.

        Parameters
        ----------
        kind : {Kind.STATE, Kind.DISCRETE}
            Which vector.

        Returns
        -------
        list of frozenset of int
            One a jump: elements of the vector.
        """
        return [changed(reset, kind) for reset in self.resets]


def changed(function: ca.Function, kind: Kind) -> frozenset[int]:
    """Return the elements of the new states, continuous or discrete, that a traced map does not give back as they were.

    Parameters
    ----------
    function : casadi.Function
        Of t, x, z, ...; with results x+ and z+.
    kind : {Kind.STATE, Kind.DISCRETE}
        Which of them.
    """
    result = (Kind.STATE, Kind.DISCRETE).index(kind)
    arguments = function.sx_in()
    pairs = zip(taken_apart(function.call(arguments)[result]), taken_apart(arguments[1 + result]), strict=True)
    return frozenset(k for k, (after, before) in enumerate(pairs) if not ca.is_equal(after, before, 0))


def trace(automaton: Automaton) -> Trace:
    """Trace the maps of an automaton.

    Parameters
    ----------
    automaton : Automaton
        With maps written in numpy style.

    Returns
    -------
    Trace
        The maps as CasADi functions.

    Raises
    ------
    TraceError
        If a map does with a value what only a number allows, if it gives other expressions when it is called again, if
        the time of a time event depends on anything but parameters and discrete states, or if an internal event depends
        on or changes more than those.
    """
    return steady_trace(_Tracer, automaton)


def steady_trace(tracer: type[_Tracer], automaton: Automaton) -> Trace:
    """Trace an automaton twice: what changes from call to call, such as a random number, would be frozen for ever.

    Parameters
    ----------
    tracer : type
        `_Tracer`, or a class derived from it.
    automaton : Automaton
        What is traced.

    Raises
    ------
    TraceError
        As `trace`.
    """
    traced, again = tracer(automaton).trace(), tracer(automaton).trace()
    whose = ["start_map", "flow_map", "flow_set", "a jump set", "the time of an event", "outputs"]
    whose += [f"the jump map of {info.name!r}" for info in automaton.jumps]
    for what, one, other in zip(whose, traced.functions, again.functions, strict=True):
        if one.serialize() != other.serialize():
            raise TraceError(
                f"{what} of {automaton.name} is another one when it is called again: what changes from call to call "
                "(np.random, the time of day, a counter) cannot be traced, because its present value would stay for "
                "ever; make it an input, or a parameter with a value drawn beforehand."
            )
    return traced


class _Tracer:
    def __init__(self, automaton: Automaton) -> None:
        # Scalars that leave an array by a path of numpy's own meet numpy functions as bare CasADi values.
        ca.GlobalOptions.setNumpyMode(-1)
        self.automaton = automaton
        self.layout = Layout(automaton)
        kinds = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
        self.t = ca.SX.sym("t")
        self.vectors = {kind: ca.SX.sym(kind.name.lower(), self.layout.sizes[kind]) for kind in kinds}
        self.arguments = [self.t, *self.vectors.values()]
        self.arrays = {kind: symbol_vector(vector) for kind, vector in self.vectors.items()}

    def trace(self) -> Trace:
        automaton = self.automaton
        traced = Trace(
            automaton,
            self.layout,
            start=self._function("start", *self._new_states(automaton.start_values, "start_map")),
            flow=self._function("flow", self._assigned(Kind.STATE, self._call(automaton.derivatives, "flow_map"))),
            flow_set=self._function("flow_set", self._scalars([self._flow_margin()], "the flow set")),
            margins=self._function(
                "margins", self._scalars(self._call(automaton.jump_margins, "a jump set"), "a jump set")
            ),
            times=self._function("times", self._times()),
            outputs=self._function(
                "outputs", self._assigned(Kind.OUTPUT, self._call(automaton.output_values, "outputs"))
            ),
            resets=tuple(self._reset(k) for k in range(len(automaton.jumps))),
        )
        return traced

    def _values(self) -> Values:
        return self.layout.values(symbols(self.t), *self.arrays.values())

    def _call(self, method: Callable[[Values], Any], what: str) -> Any:
        try:
            return method(self._values())
        except TraceError as error:
            raise TraceError(f"{what} of {self.automaton.name} cannot be traced: {error}") from error
        except (RuntimeError, TypeError) as error:
            raise TraceError(
                f"{what} of {self.automaton.name} cannot be traced: {error} Remedy: functions that need the numbers "
                "themselves (np.argmax, np.sort, ...) have no symbols; write np.where, np.minimum, "
                "np.maximum and arithmetic instead."
            ) from error

    def _flow_margin(self) -> Any:
        if not self.automaton.has_flow_set:
            return 1.0
        return self._call(self.automaton.flow_margin, "flow_set")

    def _new_states(self, method: Callable[[Values], Assignments], what: str) -> tuple[ca.SX, ca.SX]:
        new = self._call(method, what)
        return self._assigned(Kind.STATE, new, keep=True), self._assigned(Kind.DISCRETE, new, keep=True)

    def _assigned(self, kind: Kind, assignments: Assignments, *, keep: bool = False) -> ca.SX:
        elements: list[ca.SX] = []
        for place in self.layout.places[kind]:
            variable = place.variable
            if variable.name in assignments:
                given = self._elements(variable, assignments[variable.name])
            elif keep:
                given = expressions(self.arrays[kind][place.at])
            else:
                raise TraceError(f"{self.automaton.name} gives no value to {variable.name}.")
            elements += given
        return ca.vertcat(*elements) if elements else ca.SX(0, 1)

    def _elements(self, variable: Variable, value: Any) -> list[ca.SX]:
        """Return a computed value row by row; numbers of another shape would land on the wrong elements."""
        remedy = f"return an array of shape {variable.shape}, or one number for all elements"
        remedy = remedy if variable.shape else "return one number"
        try:
            given = expressions(value)
        except NotImplementedError as error:
            raise TraceError(
                f"{self.automaton.name}: the value computed for {variable.name} is {told(value)}: {remedy}."
            ) from error
        shape = value.shape if isinstance(value, ca.SX) and not value.is_scalar() else symbols(value).shape
        if shape == () and len(given) == 1:
            return given * variable.size
        if shape != variable.shape:
            raise TraceError(
                f"{self.automaton.name}: the value computed for {variable.name} has shape {shape}, but {variable.name} "
                f"has shape {variable.shape}: {remedy}."
            )
        return given

    def _scalars(self, margins: list[Any], what: str) -> ca.SX:
        elements = []
        for margin in margins:
            try:
                given = expressions(margin)
            except NotImplementedError as error:
                raise TraceError(f"{what} of {self.automaton.name} is {told(margin)}: return one number.") from error
            if len(given) != 1:
                raise TraceError(
                    f"{what} of {self.automaton.name} has {len(given)} margins: join them to one number by least "
                    "(intersection) or greatest (union)."
                )
            if any(ca.SX(given[0]).is_op(operation) for operation in _COMPARISONS):
                raise TraceError(
                    f"{what} of {self.automaton.name} is a comparison: return a margin instead, a number that is "
                    "zero or above inside the set (for h <= 0 return -h; join by least for 'and', greatest for 'or')."
                )
            elements += given
        return ca.vertcat(*elements) if elements else ca.SX(0, 1)

    def _times(self) -> ca.SX:
        times = self._scalars(self._call(self.automaton.event_times, "an event's time"), "an event's time")
        free = ca.vertcat(self.t, self.vectors[Kind.STATE], self.vectors[Kind.INPUT])
        if times.numel() and ca.depends_on(times, free):
            names = [info.name for info in self.automaton.jumps if info.trigger is Trigger.TIME]
            raise TraceError(
                f"{self.automaton.name}: the time of an event ({', '.join(names)}) depends on the time, a continuous "
                "state or an input: a known time comes from parameters and discrete states; use a jump set otherwise."
            )
        return times

    def _reset(self, index: int) -> ca.Function:
        info = self.automaton.jumps[index]
        x, z = self._new_states(lambda s: self.automaton.reset(index, s), f"the jump map of {info.name!r}")
        if info.internal:
            outside = ca.vertcat(self.vectors[Kind.STATE], self.vectors[Kind.INPUT])
            changes_x = x.numel() and not ca.is_equal(x, self.vectors[Kind.STATE], 2)
            if changes_x or (z.numel() and ca.depends_on(z, outside)):
                raise TraceError(
                    f"{self.automaton.name}: the internal event {info.name!r} uses or changes a continuous state or an "
                    "input: only events that are not internal may."
                )
        return self._function(f"reset{index}", x, z)

    def _function(self, name: str, *results: ca.SX) -> ca.Function:
        return ca.Function(f"hybrid_{name}", self.arguments, [ca.densify(result) for result in results])

"""Linear time-invariant systems as automata, given by their matrices: continuous, or clocked by a sampling period."""

from __future__ import annotations

import keyword
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.class_body import RESERVED
from hybrid_model.declare.hybrid_automaton import HybridAutomaton
from hybrid_model.declare.transitions import Assignments, Clock, TimeEvent
from hybrid_model.declare.variables import (
    Dimension,
    DiscreteState,
    FloatArray,
    Input,
    Output,
    Parameter,
    State,
    Value,
    Values,
    start_array,
)
from hybrid_model.errors import DeclarationError

MATRICES = ("A", "B", "C", "D", "order", "width", "height", "through")
"""Names of the matrices and their lengths, which a signal cannot have."""
SAME_SAMPLE = 1.0 - 8.0 * np.finfo(np.float64).eps
"""A run that starts at ``3 * 0.1`` s starts at sample 3, though the quotient is a rounding above 3."""


@dataclass(frozen=True)
class Signals:
    """Names of a system's signals, in the order of its matrices; `through` are the inputs with direct feedthrough.

    `matrices` names those that are not empty.
    """

    state: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    through: tuple[str, ...]
    matrices: tuple[str, ...]


class LinearAutomaton(HybridAutomaton):
    """What the automata of `state_space` have in common: scalar inputs and outputs, matrices as parameters."""

    signals: ClassVar[Signals]
    made_from: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make it again: a class made at run time cannot be found by its name, as pickle does."""
        return _made, self.made_from

    def read(self, s: Values, names: Sequence[str]) -> Value:
        """Return scalar variables as one vector."""
        return np.stack([s[name] for name in names])

    def combined(self, s: Values, of_state: str, of_inputs: str, inputs: Sequence[str]) -> Value:
        """Return a state's and some inputs' contributions, each by its matrix; None if there is neither."""
        has = self.signals.matrices
        terms = [s[of_state] @ s[self.signals.state]] if of_state in has else []
        terms += [s[of_inputs] @ self.read(s, inputs)] if of_inputs in has else []
        return sum(terms[1:], terms[0]) if terms else None


class ContinuousStateSpace(LinearAutomaton):
    """``x' = A x + B u``, ``y = C x + D u`` with constant matrices, the parameters of the automaton.

    D holds the columns of the inputs that some output depends on directly; the other inputs are not read by the
    outputs, so that they make no algebraic loop in a composition.
    """

    def flow_map(self, s: Values) -> Assignments:
        """The linear flow."""
        rate = self.combined(s, "A", "B", self.signals.inputs)
        return {} if rate is None else {self.signals.state: rate}

    def outputs(self, s: Values) -> Assignments:
        """The linear outputs."""
        y = self.combined(s, "C", "D", self.signals.through)
        return {name: 0.0 if y is None else y[i] for i, name in enumerate(self.signals.outputs)}


class DiscreteStateSpace(LinearAutomaton):
    """``x[k+1] = A x[k] + B u[k]``, ``y[k] = C x[k] + D u[k]`` at the times ``k period``, computed from the index k.

    Outputs are held between samples. Sample k reads the inputs at its time, gives the outputs their new values and
    moves the state on; the first sample is the first one not before the start of the run, and the state at the start
    is the one that it meets. Outputs change at samples only, so a loop over such a system is never algebraic: of two
    systems of one period the part that comes first in a composition samples first, and reads what the other had put
    out at the sample before. Join such systems before (``control.feedback``) where that delay is not meant.
    """

    k = DiscreteState(computed=True, integer=True, internal=True, description="number of the next sample")
    period = Parameter(1.0, unit="s", description="sampling period")
    sampled = Clock("sample", description="ticks with each sample")

    def start_map(self, s: Values) -> Assignments:
        """Number of the first sample."""
        return {"k": np.ceil(s.t / s.period * SAME_SAMPLE)}

    def next_time(self, s: Values) -> Value:
        """Time of the next sample."""
        return s.k * s.period

    def take(self, s: Values) -> Assignments:
        """Take a sample."""
        y = self.combined(s, "C", "D", self.signals.through)
        new: dict[str, Value] = {name: 0.0 if y is None else y[i] for i, name in enumerate(self.signals.outputs)}
        state = self.combined(s, "A", "B", self.signals.inputs)
        return {"k": s.k + 1, **new, **({} if state is None else {self.signals.state: state})}

    transitions = (TimeEvent("sample", next_time, take),)


def state_space(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    D: npt.ArrayLike | None = None,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    period: float | None = None,
    name: str | None = None,
    state: str = "x",
    start: npt.ArrayLike = 0.0,
) -> LinearAutomaton:
    """Make an automaton of a linear time-invariant system.

    Its class is made at run time, with one scalar input and output for each name; the matrices are parameters, and can
    be read and changed in an exported FMU too.

    Parameters
    ----------
    A, B, C, D : array_like
        Shapes (n, n), (n, m), (p, n), (p, m). Without D there is no direct feedthrough. n may be zero.
    inputs, outputs : sequence of str
        Names of the m inputs and p outputs: Python identifiers.
    period : float, optional
        Sampling period in s of a discrete-time system; default: the system is continuous.
    name : str, optional
        Name of the automaton.
    state : str
        Name of the state vector.
    start : float or array_like
        State at the start, shape (n,).

    Returns
    -------
    LinearAutomaton
        `ContinuousStateSpace` or `DiscreteStateSpace`.

    Raises
    ------
    DeclarationError
        For matrices that do not fit together or are not finite, a period that is not positive, and for names that are
        no identifiers or are used twice.
    """
    base = ContinuousStateSpace if period is None else DiscreteStateSpace
    owner = name or base.__name__
    n, m, p = np.shape(A)[0] if np.size(A) else 0, len(inputs), len(outputs)
    A = _matrix(owner, "A", A, (n, n))
    B = _matrix(owner, "B", B, (n, m))
    C = _matrix(owner, "C", C, (p, n))
    D = _matrix(owner, "D", np.zeros((p, m)) if D is None else D, (p, m))
    if period is not None and not (np.isfinite(period) and period > 0.0):
        raise DeclarationError(f"{owner}: the sampling period is {period} s: give a positive number.")
    _require_names(owner, base, [*inputs, *outputs, *([state] if n else [])])
    feeds = np.any(D != 0.0, axis=0)
    through = tuple(u for u, feed in zip(inputs, feeds, strict=True) if feed)
    declared, values = _matrices({"A": A, "B": B, "C": C, "D": D[:, feeds]})
    signals = Signals(state, tuple(inputs), tuple(outputs), through, tuple(values))
    declared |= {"__doc__": base.__doc__, "__module__": __name__, "signals": signals}
    declared |= {u: Input(0.0) for u in inputs}
    if n:
        values[state] = start
        kind = State if period is None else DiscreteState
        declared[state] = kind(0.0, shape="order", description="state")
    if period is None:
        declared |= {y: Output() for y in outputs}
    else:
        values["period"] = period
        declared |= {y: DiscreteState(0.0, output=True) for y in outputs}
    made: LinearAutomaton = type(base.__name__, (base,), declared)(name, **values)
    named = {"inputs": inputs, "outputs": outputs, "period": period, "name": name, "state": state, "start": start}
    made.made_from = (A, B, C, D, named)
    return made


def _made(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, named: dict[str, Any]) -> LinearAutomaton:
    return state_space(A, B, C, D, **named)


def _matrices(given: Mapping[str, FloatArray]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return declarations and values of the matrices that have elements."""
    shapes = {"A": ("order", "order"), "B": ("order", "width"), "C": ("height", "order"), "D": ("height", "through")}
    values = {key: matrix for key, matrix in given.items() if matrix.size}
    declared: dict[str, Any] = {size: Dimension() for key in values for size in shapes[key]}
    declared |= {key: Parameter(0.0, shape=shapes[key], description=f"matrix {key}") for key in values}
    return declared, values


def _matrix(owner: str, key: str, value: npt.ArrayLike, shape: tuple[int, int]) -> FloatArray:
    matrix = start_array(f"{owner}.{key}", value)
    if matrix.size == 0 and 0 in shape:
        return np.zeros(shape)
    if matrix.shape != shape:
        raise DeclarationError(
            f"{owner}.{key} has shape {matrix.shape}, but with {shape[0]} rows for its results and {shape[1]} columns "
            f"for what it multiplies it must be {shape}: give a matrix of that shape."
        )
    return matrix


def _require_names(owner: str, base: type[LinearAutomaton], names: Sequence[str]) -> None:
    for given in names:
        if not given.isidentifier() or keyword.iskeyword(given):
            raise DeclarationError(
                f"{owner}: a signal is called {given!r}, which is no Python identifier: name the signals by "
                "inputs=[...] and outputs=[...]."
            )
        if given in (*MATRICES, *RESERVED) or hasattr(base, given):
            raise DeclarationError(f"{owner}: a signal is called {given!r}, a name of the block itself: rename it.")
        if names.count(given) > 1:
            raise DeclarationError(
                f"{owner}: two of the inputs, outputs and the state vector are called {given!r}: rename them by "
                "inputs=[...], outputs=[...] or state='...'."
            )

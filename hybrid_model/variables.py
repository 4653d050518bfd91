"""Declarations: what a hybrid automaton consists of, with units and start values."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.errors import DeclarationError

FloatArray = npt.NDArray[np.float64]
Value = Any
"""A scalar or array of floats in a run, of symbols in a trace: maps are written for both."""


class Kind(enum.Enum):
    """What a variable is in an automaton; the value is the plural used in messages."""

    STATE = "continuous states"
    DISCRETE = "discrete states"
    PARAMETER = "parameters"
    INPUT = "inputs"
    OUTPUT = "outputs"


@dataclass(frozen=True, eq=False)
class Variable:
    """A declared variable of an automaton, with its name and its start value.

    Attributes
    ----------
    name : str
        Unique in the automaton; in a composition scoped by dots.
    kind : Kind
        Continuous state, discrete state, parameter, input or output.
    start : ndarray of float
        Start value, of the variable's shape; ``()`` for a scalar.
    unit, description : str
        For people and for the FMU's description; the unit in FMI notation, ``"m/s2"``.
    discrete : bool
        Changes only at jumps (inputs and outputs; states know it by their kind).
    integer : bool
        Holds whole numbers (discrete states and parameters).
    output : bool
        A state that is also an output of the block.
    internal : bool
        A discrete state nobody outside the block needs to see, such as an index into a schedule.
    computed : bool
        The start value comes from ``start_map``.
    dimensions : tuple of str
        Names of the lengths that give the shape, where they have names.
    minimum, maximum : float or None
        Between them, both included, lie the values that make sense; for people and for importers of an FMU.
    nominal : float or None
        A usual size of the value, above zero, by which solvers can scale.
    """

    name: str
    kind: Kind
    start: FloatArray
    unit: str = ""
    description: str = ""
    discrete: bool = False
    integer: bool = False
    output: bool = False
    internal: bool = False
    computed: bool = False
    dimensions: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the value; ``()`` for a scalar."""
        return self.start.shape

    @property
    def size(self) -> int:
        """Number of scalars in the value."""
        return self.start.size

    def renamed(self, name: str, scope: str = "") -> Variable:
        """Return the same variable under another name; its dimensions go into the scope ``"part."``."""
        return replace(self, name=name, dimensions=tuple(scope + dimension for dimension in self.dimensions))


class Dimension:
    """A length that an automaton's vectors share, fixed when an instance is made.

    ``degree = Dimension()`` and ``neighbours = Input(0.0, shape="degree")`` make a block for any number of
    neighbours: ``Agent(degree=3)``, or ``Agent(neighbours=[1.0, 2.0, 0.3])``.
    """

    def __init__(self, description: str = "") -> None:
        self.description = description


class Declaration:
    """A variable as the author of an automaton writes it: a class attribute without a name yet.

    Parameters
    ----------
    start : float or array_like
        Start value; a scalar stands for every element when a shape is given.
    unit, description : str
        See `Variable`.
    shape : str or tuple of str, optional
        Names of the automaton's `Dimension` attributes.
    minimum, maximum, nominal : float, optional
        See `Variable`.
    **traits : bool
        The flags of `Variable`.
    """

    kind: Kind

    def __init__(
        self,
        start: npt.ArrayLike = 0.0,
        *,
        unit: str = "",
        description: str = "",
        shape: str | tuple[str, ...] = (),
        minimum: float | None = None,
        maximum: float | None = None,
        nominal: float | None = None,
        **traits: bool,
    ) -> None:
        self.start = start
        self.minimum, self.maximum, self.nominal = minimum, maximum, nominal
        self.unit = unit
        self.description = description
        self.shape = (shape,) if isinstance(shape, str) else shape
        self.traits = traits

    def named(self, owner: str, name: str, value: npt.ArrayLike, sizes: Mapping[str, int]) -> Variable:
        """Make the variable `name` of automaton `owner` with start value `value`.

        Raises
        ------
        DeclarationError
            If the value has the wrong shape, is not finite, or lies outside the range declared.
        """
        given = start_array(f"{owner}.{name}", value)
        unknown = [dimension for dimension in self.shape if dimension not in sizes]
        if unknown:
            raise DeclarationError(
                f"{owner}.{name} has the shape {self.shape}, but {unknown[0]!r} is not one of the dimensions of "
                f"{owner}, which are {list(sizes)}: declare it with Dimension()."
            )
        shape = tuple(sizes[d] for d in self.shape) if self.shape else np.shape(self.start)
        if given.shape not in ((), shape):
            raise DeclarationError(
                f"{owner}.{name} has shape {shape}, but the value given has shape {given.shape}: "
                f"give one number for all elements, or an array of shape {shape}."
            )
        start = np.full(shape, given) if given.shape == () else given
        if self.traits.get("integer") and not np.all(start == np.round(start)):
            raise DeclarationError(f"{owner}.{name} holds whole numbers, but its start value is {start}: round it.")
        self._check_range(f"{owner}.{name}", start)
        return Variable(
            name,
            self.kind,
            start,
            self.unit,
            self.description,
            **self.traits,
            dimensions=self.shape,
            minimum=self.minimum,
            maximum=self.maximum,
            nominal=self.nominal,
        )

    def _check_range(self, name: str, start: FloatArray) -> None:
        low = -np.inf if self.minimum is None else self.minimum
        high = np.inf if self.maximum is None else self.maximum
        if not low <= high:
            raise DeclarationError(f"{name} is declared from minimum {low:g} to maximum {high:g}: exchange them.")
        if self.nominal is not None and not 0.0 < self.nominal < np.inf:
            raise DeclarationError(f"{name} has the nominal value {self.nominal:g}: give a finite size above zero.")
        # Computed starts and outputs have no value yet.
        given = self.kind is not Kind.OUTPUT and not self.traits.get("computed")
        outside = start[(start < low) | (start > high)]
        if given and outside.size:
            raise DeclarationError(
                f"{name} = {outside.flat[0]:g} lies outside its range from {low:g} to {high:g}: give a value within it."
            )


def start_array(name: str, value: npt.ArrayLike) -> FloatArray:
    """Return `value` as an array of finite floats, or say which variable is not one.

    Raises
    ------
    DeclarationError
        If the value is not a number or not finite.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DeclarationError(f"{name} = {value!r} is not a number or an array of numbers.") from error
    if not np.all(np.isfinite(array)):
        raise DeclarationError(f"{name} = {value!r} is not finite: start values and parameters must be finite numbers.")
    return array


class State(Declaration):
    """A continuous state: it flows by the flow map and may be reset by jumps.

    Parameters
    ----------
    start : float or array_like
        Start value.
    output : bool
        Whether the state is also an output of the block.
    computed : bool
        Whether the start value comes from ``start_map``.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.STATE

    def __init__(
        self, start: npt.ArrayLike = 0.0, *, output: bool = False, computed: bool = False, **options: Any
    ) -> None:
        super().__init__(start, output=output, computed=computed, **options)


class DiscreteState(Declaration):
    """A discrete state: constant along flows, changed by jumps.

    Parameters
    ----------
    start : float or array_like
        Start value.
    output, computed : bool
        As in `State`.
    integer : bool
        Whether it holds whole numbers: a counter, a mode.
    internal : bool
        Whether it is bookkeeping that nobody outside the block needs to see.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.DISCRETE

    def __init__(
        self,
        start: npt.ArrayLike = 0.0,
        *,
        output: bool = False,
        computed: bool = False,
        integer: bool = False,
        internal: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(start, output=output, computed=computed, integer=integer, internal=internal, **options)


class Parameter(Declaration):
    """A number fixed for a run.

    Parameters
    ----------
    start : float or array_like
        Its value unless an instance is given another.
    integer : bool
        Whether it holds whole numbers.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.PARAMETER

    def __init__(self, start: npt.ArrayLike, *, integer: bool = False, **options: Any) -> None:
        super().__init__(start, integer=integer, **options)


class Input(Declaration):
    """A signal from outside.

    Parameters
    ----------
    start : float or array_like
        Its value while nothing is connected.
    discrete : bool
        Whether it changes only at events. A block whose inputs are all discrete can predict its next event.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.INPUT

    def __init__(self, start: npt.ArrayLike = 0.0, *, discrete: bool = False, **options: Any) -> None:
        super().__init__(start, discrete=discrete, **options)


class Output(Declaration):
    """A signal computed by ``outputs`` from states, inputs, parameters and time.

    Parameters
    ----------
    discrete : bool
        Whether it changes only at events.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.OUTPUT

    def __init__(self, *, discrete: bool = False, **options: Any) -> None:
        super().__init__(0.0, discrete=discrete, **options)


class Values:
    """The values of an automaton's variables at one instant: ``s.h``, ``s["agent1.x"]``, and the time ``s.t``."""

    __slots__ = ("_owner", "_values")

    def __init__(self, owner: str, values: dict[str, Value]) -> None:
        self._owner = owner
        self._values = values

    def __getitem__(self, name: str) -> Value:
        try:
            return self._values[name]
        except KeyError:
            raise DeclarationError(unknown_name(self._owner, name, self._values)) from None

    def __getattr__(self, name: str) -> Value:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]


def unknown_name(owner: str, name: str, known: Mapping[str, Any]) -> str:
    """Return the sentence for a name that an automaton does not have."""
    return f"{owner} has no variable {name!r}; it has {', '.join(known) or 'none'}."


def element_names(variable: Variable) -> list[str]:
    """Return the names of a variable's scalars, counted from 1: ``x``; ``w[1]``, ``w[2]``; row by row ``m[2,1]``."""
    if not variable.shape:
        return [variable.name]
    indices = np.ndindex(*variable.shape)
    return [f"{variable.name}[{','.join(str(i + 1) for i in index)}]" for index in indices]

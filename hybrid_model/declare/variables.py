"""Declarations: what a hybrid automaton consists of, with units and start values."""

from __future__ import annotations

import enum
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn, Self, overload

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.elements import require_element, split_element
from hybrid_model.declare.real_numbers import real_array, told
from hybrid_model.declare.signatures import ExplainedCall
from hybrid_model.errors import DeclarationError

FloatArray = npt.NDArray[np.float64]
Value = Any
"""A scalar or array of floats in a run, of symbols in a trace: maps are written for both."""
INTEGERS = (-(2**31), 2**31 - 1)
"""The least and the greatest that what is declared integer may be: those of FMI's Integer and Int32 (rule 10)."""


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
    tunable : bool
        A parameter that may be given another value during a run, at an event.
    dimensions : tuple of str
        Names of the lengths that give the shape, where they have names.
    minimum, maximum : float or None
        Between them, both included, lie the values that make sense; for people and for importers of an FMU.
    nominal : float or None
        A usual size of the value, above zero, by which solvers can scale.
    value_names : tuple of str
        What its values 0, 1, ... are called, where they have names: the modes of a classical automaton.
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
    tunable: bool = False
    dimensions: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    value_names: tuple[str, ...] = ()

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


class ClassAttribute:
    """What an author declares in the body of a class and executions read from a run, never from the instance.

    An instance has no such attribute: a value set there would be ignored, and one read there would be frozen in an FMU.
    """

    _name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> NoReturn: ...
    def __get__(self, instance: object | None, owner: type) -> Self:
        """Return the declaration of a class; refuse the attribute of an instance."""
        if instance is None:
            return self
        raise DeclarationError(
            f"{owner.__name__}.{self._name} is one of the {self.plural()}, whose values an instance does not hold: "
            f"write s.{self._name} in a map, and arc[{self._name!r}] for a run."
        )

    def __set__(self, instance: object, value: object) -> None:
        """Refuse a value of an instance that is there already."""
        cls = type(instance).__name__
        raise DeclarationError(
            f"{cls}.{self._name} is one of the {self.plural()}, whose values are given when an instance is made: write "
            f"{cls}({self._name}={told(value)}){self.otherwise()}."
        )

    def otherwise(self) -> str:
        """Return what else somebody may have wanted who sets the attribute of an instance."""
        return ""

    def plural(self) -> str:
        """Return what such attributes are called in messages."""
        return "declarations"


class Dimension(ClassAttribute):
    """A length that an automaton's vectors share, fixed when an instance is made.

    ``degree = Dimension()`` and ``neighbours = Input(0.0, shape="degree")`` make a block for any number of
    neighbours: ``Agent(degree=3)``, or ``Agent(neighbours=[1.0, 2.0, 0.3])``.

    Parameters
    ----------
    description : str
        For people.
    """

    def __init__(self, description: str = "") -> None:
        self.description = description

    def plural(self) -> str:
        """See `ClassAttribute.plural`."""
        return "dimensions"


class Declaration(ExplainedCall, ClassAttribute):
    """A variable as the author of an automaton writes it: a class attribute without a name yet.

    Parameters
    ----------
    start : float or array_like, of the declared shape
        Start value; a scalar stands for every element when a shape is given.
    unit, description : str
        See `Variable`.
    shape : str or int or tuple, optional
        Names of the automaton's `Dimension` attributes; or, for the same shape in every instance, its lengths.
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
        shape: str | int | tuple[str, ...] | tuple[int, ...] = (),
        minimum: float | None = None,
        maximum: float | None = None,
        nominal: float | None = None,
        **traits: bool,
    ) -> None:
        self.start = start
        self.minimum, self.maximum, self.nominal = minimum, maximum, nominal
        self.unit = unit
        self.description = description
        for option, text in (("unit", unit), ("description", description)):
            if not isinstance(text, str):
                raise DeclarationError(f"{option} = {told(text)} is no text: write {option}={str(text)!r}.")
        for option, said in traits.items():
            if not isinstance(said, bool):
                raise DeclarationError(
                    f"{option} = {told(said)} is not yes or no: write {option}=True or {option}=False."
                )
        lengths = shape if isinstance(shape, tuple) else (shape,)
        self.shape = tuple(name for name in lengths if isinstance(name, str))
        self.traits = traits
        if not self.shape and lengths:
            self.start = _filled(start, lengths)
        elif len(self.shape) < len(lengths):
            raise DeclarationError(
                f"shape = {shape!r} mixes names and lengths: give names of Dimension attributes, or whole numbers only."
            )

    def plural(self) -> str:
        """See `ClassAttribute.plural`."""
        return self.kind.value

    def otherwise(self) -> str:
        """See `ClassAttribute.otherwise`."""
        reset = self.kind in (Kind.STATE, Kind.DISCRETE)
        return f", and return {{{self._name!r}: ...}} from a jump map" if reset else ""

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
                + (f"give one number for all elements, or an array of shape {shape}." if shape else "give one number.")
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
            value_names=(),
        )

    def _check_range(self, name: str, start: FloatArray) -> None:
        for option in ("minimum", "maximum", "nominal"):
            value = getattr(self, option)
            if not (value is None or isinstance(value, numbers.Real)):
                raise DeclarationError(f"{name} has the {option} {value!r}: give a number, or leave it out.")
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


def _filled(start: npt.ArrayLike, lengths: tuple[Any, ...]) -> FloatArray:
    """Return the start value of a variable whose shape is given by numbers."""
    try:
        return np.broadcast_to(start_array("start", start), lengths)
    except (TypeError, ValueError) as error:
        raise DeclarationError(
            f"shape = {lengths!r} does not fit the start value {told(start)}: leave it out, since an array has its "
            "shape, or give whole numbers of elements."
        ) from error


def start_array(name: str, value: npt.ArrayLike) -> FloatArray:
    """Return `value` as an array of finite floats, or say which variable is not one.

    Raises
    ------
    DeclarationError
        If the value is not a number or not finite.
    """
    try:
        array = real_array(value)
    except OverflowError as error:
        raise DeclarationError(f"{name} = {told(value)} is too large: numbers end at 1.8e308.") from error
    except (TypeError, ValueError) as error:
        raise DeclarationError(f"{name} = {told(value)} is not a number or an array of numbers.") from error
    if not np.all(np.isfinite(array)):
        raise DeclarationError(f"{name} = {value!r} is not finite: start values and parameters must be finite numbers.")
    return array


class State(Declaration):
    """A continuous state: it flows by the flow map and may be reset by jumps.

    Parameters
    ----------
    start : float or array_like, of the declared shape
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
    start : float or array_like, of the declared shape
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
    """A number fixed for a run, or for the time between two events.

    Parameters
    ----------
    start : float or array_like, of the declared shape
        Its value unless an instance is given another.
    integer : bool
        Whether it holds whole numbers.
    tunable : bool
        Whether it may be given another value during a run: by ``inputs`` of `simulate`, by a master, or by the importer
        of an FMU. A change is an event from outside: predictions are made anew, and what it makes due happens there.
    **options
        ``unit``, ``description``, ``shape``, ``minimum``, ``maximum``, ``nominal``: see `Declaration`.
    """

    kind = Kind.PARAMETER

    def __init__(self, start: npt.ArrayLike, *, integer: bool = False, tunable: bool = False, **options: Any) -> None:
        super().__init__(start, integer=integer, tunable=tunable, **options)


class Input(Declaration):
    """A signal from outside.

    Parameters
    ----------
    start : float or array_like, of the declared shape
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
    """The values of an automaton's variables at one instant: ``s.h``, ``s["agent1.x"]``, and the time ``s.t``.

    Parameters
    ----------
    owner : str
        Name of the automaton, for messages.
    values : dict
        Variable -> its value, of its shape; ``t`` is the time in s.
    """

    __slots__ = ("_owner", "_values")
    _owner: str
    _values: dict[str, Value]

    def __init__(self, owner: str, values: dict[str, Value]) -> None:
        # Past `__setattr__`: values are made in the inner loop of every execution.
        _set_owner(self, owner)
        _set_values(self, values)

    def __setattr__(self, name: str, value: object) -> None:
        if not name.startswith("_"):
            self[name] = value
        object.__setattr__(self, name, value)

    def __setitem__(self, name: str, value: object) -> None:
        raise DeclarationError(
            f"{self._owner}: {name} cannot be set on the values: return the new ones instead, from a jump map as "
            f"{{{name!r}: ...}}."
        )

    def __repr__(self) -> str:
        return f"{self._owner}: {', '.join(f'{name} = {self[name]}' for name in self._values)}"

    def __getitem__(self, name: str) -> Value:
        try:
            return self._values[name]
        except KeyError:
            return self._element(name, self._values)

    def _element(self, name: str, known: Mapping[str, Any]) -> Value:
        """Return the value of ``v[1]``; refuse every other name."""
        whole, place = split_element(name) or (name, ())
        if not place or whole not in known:
            raise DeclarationError(unknown_name(self._owner, name, known), name=name)
        value = self[whole]
        require_element(self._owner, name, whole, place, np.shape(value))
        return value[place]

    def __getattr__(self, name: str) -> Value:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]


_set_owner, _set_values = (vars(Values)[slot].__set__ for slot in Values.__slots__)


def unknown_name(owner: str, name: str, known: Mapping[str, Any], kind: str = "variable") -> str:
    """Return the sentence for a name that an automaton does not have."""
    return f"{owner} has no {kind} {name!r}; it has {', '.join(known) or 'none'}."


def element_names(variable: Variable) -> list[str]:
    """Return the names of a variable's scalars, counted from 1: ``x``; ``w[1]``, ``w[2]``; row by row ``m[2,1]``."""
    if not variable.shape:
        return [variable.name]
    indices = np.ndindex(*variable.shape)
    return [f"{variable.name}[{','.join(str(i + 1) for i in index)}]" for index in indices]

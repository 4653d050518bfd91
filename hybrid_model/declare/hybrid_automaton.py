"""Automata written by hand: flow set, flow map, jump set and jump map over variables declared in a class."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.class_body import UNBOUND, require_sound_body
from hybrid_model.declare.elements import gathered, split_element
from hybrid_model.declare.map_results import (
    checked_assignments,
    checked_margin,
    checked_scalar,
    explain,
)
from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.transitions import (
    Assignments,
    Clock,
    ClockInfo,
    Jump,
    JumpInfo,
    Priority,
    TimeEvent,
    Trigger,
)
from hybrid_model.declare.variables import Declaration, Dimension, Kind, Value, Values
from hybrid_model.errors import DeclarationError


class HybridAutomaton(Automaton):
    """Base class of automata written by hand: declare variables as class attributes and write the maps.

    Subclasses write ``flow_map`` and, as needed, ``flow_set``, ``jump_set`` with ``jump_map`` (one jump, named
    ``"jump"``) or a tuple ``transitions`` of `Jump` and `TimeEvent`, ``start_map`` and ``outputs``.
    Sets are margins: continuous functions that are zero or above inside. ``stiff = True`` asks for a method for stiff
    flows from the start and ``stiff = False`` for none at all; otherwise an FMU changes to it for good where a
    flow shows itself to be stiff.

    Parameters
    ----------
    name : str, optional
        Name of the instance; default: the class's.
    **values : float or array_like of the declared shape, or int
        Start values, parameter values, and lengths of dimensions, by name.

    Raises
    ------
    DeclarationError
        For an unknown name, a wrong shape, or a value that is not finite.
    """

    priority = Priority.JUMP
    transitions: ClassVar[tuple[Jump | TimeEvent, ...]] = ()
    written_by_authors: ClassVar[frozenset[str]] = frozenset(
        {"flow_map", "flow_set", "start_map", "outputs", "transitions", "priority", "stiff"}
    )
    listed: ClassVar[Mapping[str, tuple[type, ...]]] = {"transitions": (Jump, TimeEvent)}

    def __init__(self, name: str | None = None, **values: Any) -> None:
        require_sound_body(type(self), self.listed)
        self.name = _instance_name(type(self), name)
        declarations = _declared(type(self), Declaration)
        dimensions = _declared(type(self), Dimension)
        for given in values:
            given, _ = split_element(given) or (given, ())
            if given not in declarations and given not in dimensions:
                raise DeclarationError(
                    f"{self.name} has nothing named {given!r} to set; it has {', '.join([*declarations, *dimensions])}."
                )
            if given in declarations and declarations[given].traits.get("computed"):
                raise DeclarationError(
                    f"{self.name}.{given} is computed by start_map, so its start value cannot be given: "
                    "give the values that it is computed from."
                )
        sizes = _sizes(self.name, declarations, dimensions, values)
        self.variables = tuple(
            declaration.named(self.name, key, values.get(key, declaration.start), sizes)
            for key, declaration in declarations.items()
        )
        if any(map(split_element, values)):
            values = gathered(self.name, {variable.name: variable.start for variable in self.variables}, values)
            self.variables = tuple(
                declarations[v.name].named(self.name, v.name, values.get(v.name, v.start), sizes)
                for v in self.variables
            )
        self._transitions = self._collect_transitions()
        self.jumps = tuple(
            JumpInfo(t.name, Trigger.STATE)
            if isinstance(t, Jump)
            else JumpInfo(t.name, Trigger.TIME, internal=t.internal)
            for t in self._transitions
        )
        self.clocks = self._collect_clocks()

    # The maps that an author writes.

    def flow_map(self, s: Values) -> Assignments:
        """Return the time derivative of each continuous state."""
        return {}

    def flow_set(self, s: Values) -> Value:
        """Return the margin of the flow set: zero or above inside. Not overridden: flow is allowed everywhere."""
        return 1.0

    def start_map(self, s: Values) -> Assignments:
        """Return the start values of the states declared with ``computed=True``."""
        return {}

    def outputs(self, s: Values) -> Assignments:
        """Return the values of the declared outputs."""
        return {}

    # What executions use.

    @property
    def has_flow_set(self) -> bool:
        """Whether ``flow_set`` is overridden."""
        return type(self).flow_set is not HybridAutomaton.flow_set

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.written_by_authors or name in UNBOUND:
            raise DeclarationError(
                f"{type(self).__name__}: {name} is read from the class, so it cannot be set on an instance: write it "
                "in the class, or in a subclass."
            )
        super().__setattr__(name, value)

    def __getstate__(self) -> dict[str, Any]:
        # Functions without a name, as transitions and modes have them, cannot be pickled; they are those of the class.
        return {key: value for key, value in vars(self).items() if key != "_transitions"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._transitions = self._collect_transitions()

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`."""
        computed = [v.name for v in self.variables if v.computed]
        return checked_assignments(self.name, "start_map", self.start_map(s), computed, computed)

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`."""
        states = [v.name for v in self.variables if v.kind is Kind.STATE]
        try:
            return checked_assignments(self.name, "flow_map", self.flow_map(s), states, states)
        except ValueError as error:
            explain(self.name, type(self), "flow_map", error)
            raise

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`."""
        return checked_margin(self.name, "flow_set", self.flow_set(s))

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`."""
        return [
            checked_margin(self.name, f"the jump set of {t.name!r}", t.jump_set(self, s))
            for t in self._transitions
            if isinstance(t, Jump)
        ]

    def event_times(self, s: Values) -> list[Value]:
        """See `Automaton.event_times`."""
        return [
            checked_scalar(self.name, f"the time of {t.name!r}", "a time in s, or np.inf for never", t.time(self, s))
            for t in self._transitions
            if isinstance(t, TimeEvent)
        ]

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`."""
        transition = self._transitions[jump]
        states = [v.name for v in self.variables if v.kind in (Kind.STATE, Kind.DISCRETE)]
        what = f"the jump map of {transition.name!r}"
        try:
            return checked_assignments(self.name, what, transition.jump_map(self, s), states, [])
        except ValueError as error:
            explain(self.name, type(self), what, error)
            raise

    def output_values(self, s: Values) -> Assignments:
        """See `Automaton.output_values`."""
        declared = [v.name for v in self.variables if v.kind is Kind.OUTPUT]
        try:
            return checked_assignments(self.name, "outputs", self.outputs(s), declared, declared)
        except ValueError as error:
            explain(self.name, type(self), "outputs", error)
            raise

    def _collect_transitions(self) -> tuple[Jump | TimeEvent, ...]:
        cls = type(self)
        single = getattr(cls, "jump_set", None), getattr(cls, "jump_map", None)
        if (single[0] is None) != (single[1] is None):
            raise DeclarationError(f"{self.name} has one of jump_set and jump_map: write both, or neither.")
        own = (Jump("jump", single[0], single[1]),) if single[0] is not None and single[1] is not None else ()
        return self._named_once((*own, *cls.transitions))

    def _named_once(self, transitions: tuple[Jump | TimeEvent, ...]) -> tuple[Jump | TimeEvent, ...]:
        names = [t.name for t in transitions]
        if len(set(names)) < len(names):
            raise DeclarationError(f"{self.name} has two transitions of one name among {names}: rename one.")
        return transitions

    def _collect_clocks(self) -> tuple[ClockInfo, ...]:
        names = [j.name for j in self.jumps]
        clocks = []
        for key, clock in _declared(type(self), Clock).items():
            if clock.jump not in names:
                raise DeclarationError(
                    f"{self.name}.{key} ticks with jump {clock.jump!r}, but the jumps are {names}: name one of them."
                )
            clocks.append(ClockInfo(key, names.index(clock.jump), clock.description))
        return tuple(clocks)


def _instance_name(cls: type, given: object) -> str:
    if given is not None and not isinstance(given, str):
        raise DeclarationError(
            f"{cls.__name__} was given {told(given)} as the name of the instance: give values by name, "
            f"{cls.__name__}(variable={told(given)})."
        )
    return given or cls.__name__


def _declared(cls: type, kind: type) -> dict[str, Any]:
    # Base classes first, so that declaration order is reading order.
    found: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        for key, value in vars(base).items():
            if isinstance(value, kind):
                found[key] = value
    return found


def _sizes(
    owner: str, declarations: Mapping[str, Declaration], dimensions: Mapping[str, Dimension], values: dict[str, Any]
) -> dict[str, int]:
    """Find the length of each dimension, from its own value or from the vectors given."""
    sizes: dict[str, int] = {}
    for dimension in dimensions:
        lengths = {dimension: _length(owner, dimension, values[dimension])} if dimension in values else {}
        for key, declaration in declarations.items():
            given = np.shape(values[key]) if key in values else ()
            if dimension in declaration.shape and len(given) == len(declaration.shape):
                lengths[key] = given[declaration.shape.index(dimension)]
        if not lengths:
            raise DeclarationError(f"{owner} needs the length {dimension!r}: give {dimension}=..., a whole number.")
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{key} says {n}" for key, n in lengths.items())
            raise DeclarationError(f"{owner} has one length {dimension!r}, but {told}: make them equal.")
        sizes[dimension] = next(iter(lengths.values()))
    return sizes


def _length(owner: str, dimension: str, value: Any) -> int:
    try:
        length = int(value)
    except (TypeError, ValueError, OverflowError):
        length = -1
    if length < 0 or length != value:
        raise DeclarationError(
            f"{owner}: the length {dimension} = {value!r} is not possible: give a whole number >= 0."
        )
    return length

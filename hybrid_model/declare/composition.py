"""Composition: one automaton out of many, wired by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.elements import gathered, require_element, split_element
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.transitions import Assignments, ClockInfo, JumpInfo, Priority, Trigger
from hybrid_model.declare.variables import Kind, Value, Values, Variable, element_names, unknown_name
from hybrid_model.errors import AlgebraicLoopError, WiringError

Source = str | Sequence[str]
"""``"part.output"``, or one such name per element of a vector input."""


@dataclass(frozen=True)
class _Wire:
    """Where a part's input comes from: (part, variable) per element, or one for the whole input."""

    sources: tuple[tuple[str, str], ...]
    stacked: bool


@dataclass(frozen=True)
class ElementWire:
    """A scalar signal from a part's output to a part's input; elements of vectors are named as in ``w[1]``."""

    source: str
    output: str
    target: str
    input: str

    def carried(self, value: float) -> float:
        """Return what arrives of a value: both ends have one unit."""
        return value

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"


class Composition(Automaton):
    """Parts that run together, as one automaton.

    The states of the composition are those of its parts, under names ``part.variable``; inputs that nothing is
    connected to become its inputs. A flow is a flow of all parts. A jump is a jump of one part: where several are
    enabled at one instant the first part in the order of `parts` jumps first, and the others are then tested again,
    with the values that the jump gave (rule 6).

    Parameters
    ----------
    name : str
        Name of the composition.
    parts : mapping
        Part name -> automaton. The order of the mapping is the order of simultaneous jumps.
    connections : mapping
        ``"part.input"`` -> ``"part.output"``, or a sequence of such names for the elements of a vector input, for the
        rows of a matrix.
    names : mapping, optional
        ``"part.variable"`` -> name in the composition, where the scoped name is not wanted.

    Raises
    ------
    WiringError
        For unknown names, double names, shapes or units that differ, or a continuous signal on a discrete input.
    AlgebraicLoopError
        If outputs need each other without a state in between.
    """

    @explained(WiringError)
    def __init__(
        self,
        name: str,
        parts: Mapping[str, Automaton],
        connections: Mapping[str, Source] | None = None,
        names: Mapping[str, str] | None = None,
    ) -> None:
        _require_arguments(name, parts, connections or {}, names or {})
        self.name = name
        self.parts = dict(parts)
        for automaton in self.parts.values():
            require_automaton(automaton)
        self._wires: dict[str, dict[str, _Wire]] = {part: {} for part in self.parts}
        for (part, variable), wire in _wires(self, connections or {}).items():
            self._wires[part][variable] = wire
        self._names = _scoped_names(self, names or {})
        self._lay_out_variables()
        self._lay_out_jumps()
        self.priority = _common_priority(self)
        self.stiff = _common_stiffness(self)
        self._refuse_loops()

    def _lay_out_variables(self) -> None:
        self.variables = tuple(
            variable.renamed(self._names[part, variable.name], f"{part}.")
            for part, automaton in self.parts.items()
            for variable in automaton.variables
            if variable.name not in self._wires[part]
        )
        self._own = {
            part: {"t": "t"}
            | {
                variable.name: self._names[part, variable.name]
                for variable in automaton.variables
                if variable.kind is not Kind.OUTPUT and variable.name not in self._wires[part]
            }
            for part, automaton in self.parts.items()
        }
        # Most parts have no say in most maps: this list and those of jumps keep evaluation short.
        self._with_states = [(p, a) for p, a in self.parts.items() if a.of_kind(Kind.STATE)]
        self._computed = {
            (p, v.name): None for p, automaton in self.parts.items() for v in automaton.of_kind(Kind.OUTPUT)
        }
        self._computed_by_name = {self._names[owner]: owner for owner in self._computed}

    def _lay_out_jumps(self) -> None:
        self._with_guards = [(p, a) for p, a in self.parts.items() if any(j.trigger is Trigger.STATE for j in a.jumps)]
        self._with_times = [(p, a) for p, a in self.parts.items() if any(j.trigger is Trigger.TIME for j in a.jumps)]
        self._owner = [(part, k) for part, automaton in self.parts.items() for k in range(len(automaton.jumps))]
        self.jumps = tuple(
            JumpInfo(f"{part}.{info.name}", info.trigger, info.internal)
            for part, automaton in self.parts.items()
            for info in automaton.jumps
        )
        numbers = {owner: number for number, owner in enumerate(self._owner)}
        self.clocks = tuple(
            ClockInfo(self._names[part, clock.name], numbers[part, clock.jump], clock.description)
            for part, automaton in self.parts.items()
            for clock in automaton.clocks
        )

    @property
    def has_flow_set(self) -> bool:
        """Whether some part restricts flow."""
        return any(part.has_flow_set for part in self.parts.values())

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`; parts in order, so that later parts see the start values of earlier ones."""
        started: dict[str, Value] = {}
        values = {name: s[name] for name in ("t", *(v.name for v in self.variables if v.kind is not Kind.OUTPUT))}
        for part, automaton in self.parts.items():
            scope = _Scopes(self, Values(self.name, {**values, **started}))
            started.update(self._scoped(part, automaton.start_values(scope.of(part))))
        return started

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`."""
        scopes = _Scopes(self, s)
        rates: dict[str, Value] = {}
        for part, automaton in self._with_states:
            rates.update(self._scoped(part, automaton.derivatives(scopes.of(part))))
        return rates

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`: the intersection of the parts' flow sets."""
        scopes = _Scopes(self, s)
        margin: Value = None
        for part, automaton in self.parts.items():
            if automaton.has_flow_set:
                own = automaton.flow_margin(scopes.of(part))
                margin = own if margin is None else np.minimum(margin, own)
        return margin

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`."""
        scopes = _Scopes(self, s)
        return [m for part, automaton in self._with_guards for m in automaton.jump_margins(scopes.of(part))]

    def event_times(self, s: Values) -> list[Value]:
        """See `Automaton.event_times`."""
        scopes = _Scopes(self, s)
        return [time for part, automaton in self._with_times for time in automaton.event_times(scopes.of(part))]

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`."""
        part, index = self._owner[jump]
        return self._scoped(part, self.parts[part].reset(index, _Scopes(self, s).of(part)))

    def output_values(self, s: Values) -> Assignments:
        """See `Automaton.output_values`."""
        scopes = _Scopes(self, s)
        return {self._names[part, output]: scopes.output(part, output) for part, output in self._computed}

    def output_value(self, name: str, s: Values) -> Value:
        """See `Automaton.output_value`."""
        return _Scopes(self, s).output(*self._computed_by_name[name])

    def part_values(self, part: str, s: Values) -> Values:
        """Return the values of one part, inputs over wires included, out of those of the composition."""
        return _Scopes(self, s).of(part)

    def scoped_name(self, part: str, variable: str) -> str:
        """Return the name in the composition of a part's variable."""
        return self._names[part, variable]

    @property
    def wires(self) -> tuple[ElementWire, ...]:
        """The connections, scalar by scalar, in the order of parts and inputs."""
        return tuple(
            ElementWire(owner, output, part, element)
            for part, automaton in self.parts.items()
            for variable in automaton.of_kind(Kind.INPUT)
            if variable.name in self._wires[part]
            for (owner, output), element in zip(
                _source_elements(self, self._wires[part][variable.name]), element_names(variable), strict=True
            )
        )

    def _scoped(self, part: str, assignments: Assignments) -> dict[str, Value]:
        return {self._names[part, key]: value for key, value in assignments.items()}

    def _refuse_loops(self) -> None:
        layout = Layout(self)
        vectors = [layout.start(kind) for kind in (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)]
        with np.errstate(all="ignore"):
            s = layout.values(0.0, *vectors)
            self.output_values(s)
            self.derivatives(s)


class _Scopes:
    """The values of each part at one instant, made when they are asked for, wires included."""

    def __init__(self, composition: Composition, s: Values) -> None:
        self._composition = composition
        self._s = s
        self._parts: dict[str, _PartValues] = {}
        self._outputs: dict[str, Assignments] = {}
        self._computing: list[str] = []

    def of(self, part: str) -> Values:
        """Return the values of one part."""
        if part not in self._parts:
            self._parts[part] = _PartValues(self._composition, part, self, self._s)
        return self._parts[part]

    def output(self, part: str, variable: str) -> Value:
        """Return one computed output of a part.

        A part that is a composition computes only what the output needs, so that nesting makes no loop of what is none.
        """
        automaton = self._composition.parts[part]
        nested = isinstance(automaton, Composition)
        place = f"{part}.{variable}" if nested else part
        if place not in self._outputs:
            if place in self._computing:
                loop = " -> ".join([*self._computing[self._computing.index(place) :], place])
                raise AlgebraicLoopError(
                    f"{self._composition.name}: the outputs of {loop} need each other at one instant: put a state "
                    "between them, or leave the input out of the outputs."
                )
            self._computing.append(place)
            s = self.of(part)
            self._outputs[place] = (
                {variable: automaton.output_value(variable, s)} if nested else automaton.output_values(s)
            )
            self._computing.pop()
        return self._outputs[place][variable]

    def wired(self, wire: _Wire) -> Value:
        """Return the value that arrives over a wire."""
        values = [self._source(part, variable) for part, variable in wire.sources]
        if not wire.stacked:
            return values[0]
        return np.stack(values) if values else np.zeros(0)

    def _source(self, part: str, variable: str) -> Value:
        if (part, variable) not in self._composition._names:
            whole, place = split_element(variable) or (variable, ())
            return self._source(part, whole)[place]
        if (part, variable) in self._composition._computed:
            return self.output(part, variable)
        return self._s[self._composition._names[part, variable]]


class _PartValues(Values):
    """Values of a part, each fetched when it is asked for, so that only real dependencies count as loops."""

    __slots__ = ("_own", "_s", "_scopes", "_wires")
    _own: dict[str, str]
    _s: Values
    _scopes: _Scopes
    _wires: dict[str, _Wire]

    def __init__(self, composition: Composition, part: str, scopes: _Scopes, s: Values) -> None:
        super().__init__(composition.parts[part].name, {})
        # Past `__setattr__`, as in `Values`.
        _set_own(self, composition._own[part])
        _set_s(self, s)
        _set_scopes(self, scopes)
        _set_wires(self, composition._wires[part])

    def __getitem__(self, name: str) -> Value:
        value = self._values.get(name)
        if value is None:
            if name in self._own:
                value = self._s[self._own[name]]
            elif name in self._wires:
                value = self._scopes.wired(self._wires[name])
            else:
                return self._element(name, {**self._own, **self._wires})
            self._values[name] = value
        return value


_set_own, _set_s, _set_scopes, _set_wires = (vars(_PartValues)[slot].__set__ for slot in _PartValues.__slots__)


def _require_arguments(name: object, parts: object, connections: object, names: object) -> None:
    if not isinstance(name, str):
        raise WiringError(
            f"a composition was given {told(name)} as its name: give a text first, Composition('plant', ...)."
        )
    if not isinstance(parts, Mapping):
        raise WiringError(
            f"{name}: the parts are {told(parts)}: give a mapping, {{'name of the part': automaton}}, or write "
            f"hm.product({name!r}, first, second)."
        )
    for what, given, entry in (
        ("connections", connections, "{'part.input': 'part.output'}"),
        ("names", names, "{'part.variable': 'name'}"),
    ):
        if not isinstance(given, Mapping):
            raise WiringError(f"{name}: the {what} are {told(given)}: give a mapping, {entry}.")
    for part in parts:
        if not isinstance(part, str):
            raise WiringError(
                f"{name}: a part has the name {told(part)}: give texts, {{'name of the part': automaton}}."
            )


def _wires(composition: Composition, connections: Mapping[str, Source]) -> dict[tuple[str, str], _Wire]:
    wires = {}
    for target, source in _whole_targets(composition, connections).items():
        part, variable = _find(composition, target, (Kind.INPUT,), "an input")
        if not isinstance(source, (str, Sequence)):
            raise WiringError(
                f"{composition.name}: {target} is connected to {told(source)}: name an output, 'part.output', or "
                "give a list of names for the elements of a vector."
            )
        given = [source] if isinstance(source, str) else list(source)
        found = [_find(composition, name, (Kind.STATE, Kind.DISCRETE, Kind.OUTPUT), "an output") for name in given]
        stacked = not isinstance(source, str)
        if stacked and variable.shape[:1] != (len(found),):
            raise WiringError(
                f"{composition.name}: {target} has shape {variable.shape}, but {len(found)} signals are connected to "
                "it: connect one for each element."
            )
        for (_, output), name in zip(found, given, strict=True):
            _require_fit(composition.name, target, variable, name, output, element=stacked)
        wires[part, variable.name] = _Wire(tuple((owner, output.name) for owner, output in found), stacked)
    return wires


def _whole_targets(composition: Composition, connections: Mapping[str, Source]) -> dict[str, Source]:
    """Return the connections with those to elements of one input, ``part.input[1]``, in one list."""
    inputs = {f"{p}.{v.name}": v.start for p, part in composition.parts.items() for v in part.of_kind(Kind.INPUT)}

    def joined(start: np.ndarray[Any, Any], sources: Mapping[tuple[int, ...], Source]) -> Source:
        if start.ndim > 1 or len(sources) < start.size:
            raise WiringError(
                f"{composition.name}: {', '.join(map(told, sources.values()))} are connected to some elements of an "
                f"input of shape {start.shape}: connect each element of a vector, or give a list with an output a row."
            )
        return [str(sources[place]) for place in sorted(sources)]

    return gathered(composition.name, inputs, connections, joined)


def _source_elements(composition: Composition, wire: _Wire) -> list[tuple[str, str]]:
    outputs = {(part, v.name): v for part, _ in wire.sources for v in composition.parts[part].variables}
    return [
        (part, name)
        for part, output in wire.sources
        for name in (element_names(outputs[part, output]) if (part, output) in outputs else [output])
    ]


def _find(composition: Composition, scoped: str, kinds: tuple[Kind, ...], what: str) -> tuple[str, Variable]:
    if not isinstance(scoped, str):
        raise WiringError(f"{composition.name}: {told(scoped)} is not {what}: write 'part.variable'.")
    # The longest part that fits: names of parts may contain dots.
    ends = [at for at, letter in enumerate(scoped) if letter == "."]
    part = next((scoped[:at] for at in reversed(ends) if scoped[:at] in composition.parts), None)
    if part is None:
        raise WiringError(unknown_name(f"{composition.name} (parts)", scoped, composition.parts))
    known = {v.name: v for v in composition.parts[part].variables if v.kind in kinds}
    variable = scoped[len(part) + 1 :]
    whole, place = split_element(variable) or (variable, ())
    if variable not in known and place and whole in known:
        require_element(composition.name, scoped, f"{part}.{whole}", place, known[whole].shape)
        return part, replace(known[whole], name=variable, start=np.array(known[whole].start[place]))
    if variable not in known:
        raise WiringError(f"{composition.name}: {scoped} is not {what}; {part} has {', '.join(known) or 'none'}.")
    return part, known[variable]


def _require_fit(owner: str, target: str, into: Variable, name: str, output: Variable, *, element: bool) -> None:
    shape = into.shape[1:] if element else into.shape
    if output.shape != shape:
        raise WiringError(
            f"{owner}: {name} has shape {output.shape}, but {target} takes {shape}: connect equal shapes."
        )
    if into.unit and output.unit and into.unit != output.unit:
        raise WiringError(f"{owner}: {name} is in {output.unit!r}, but {target} is in {into.unit!r}: convert one.")
    if into.discrete and not (output.discrete or output.kind is Kind.DISCRETE):
        raise WiringError(
            f"{owner}: {name} changes along flows, but {target} is a discrete input, which may change only at jumps: "
            "sample it first, or declare the input continuous."
        )


def _scoped_names(composition: Composition, given: Mapping[str, str]) -> dict[tuple[str, str], str]:
    names = {
        (part, item): f"{part}.{item}"
        for part, automaton in composition.parts.items()
        for item in (*(v.name for v in automaton.variables), *(c.name for c in automaton.clocks))
    }
    for scoped, name in given.items():
        key = next((key for key in names if ".".join(key) == scoped), None)
        if key is None:
            raise WiringError(unknown_name(f"{composition.name} (names)", scoped, {".".join(k): k for k in names}))
        names[key] = name
    visible: dict[str, Any] = {}
    for (part, item), name in names.items():
        if item in composition._wires[part]:
            continue
        if name in visible or name == "t":
            raise WiringError(f"{composition.name}: two variables are called {name!r}: name them apart.")
        visible[name] = item
    return names


def _common_priority(composition: Composition) -> Priority:
    jumping = {
        part: automaton.priority
        for part, automaton in composition.parts.items()
        if any(info.trigger is Trigger.STATE for info in automaton.jumps)
    }
    priorities = set(jumping.values())
    if len(priorities) > 1:
        raise WiringError(
            f"{composition.name}: some parts let the jump win where flow set and jump set overlap and some the flow: "
            "give all parts with jumps the same priority."
        )
    if Priority.FLOW in priorities and len(jumping) > 1:
        raise WiringError(
            f"{composition.name}: {' and '.join(jumping)} jump on state, and under flow priority each would jump when "
            "another leaves its flow set: give them jump priority, or let only one part of a composition jump on state."
        )
    return priorities.pop() if priorities else Priority.JUMP


def _common_stiffness(composition: Composition) -> bool | None:
    """Return True if a part is declared stiff, and False if all are declared not to be."""
    declared = {automaton.stiff for automaton in composition.parts.values() if automaton.of_kind(Kind.STATE)}
    if True in declared:
        return True
    return False if declared == {False} else None

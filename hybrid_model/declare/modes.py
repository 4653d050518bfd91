"""Classical hybrid automata: modes with invariants and flows, switches with guards and resets.

A `ModalAutomaton` is lowered to the form (C, f, D, g) that everything else runs: the mode is a discrete state ``mode``,
the flow map is that of the present mode, the flow set its invariant, and each switch is a jump whose set is its guard,
in its source mode only, and whose map also enters the target mode (Goebel, Sanfelice, Teel, Hybrid Dynamical Systems,
section 1.4.1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hybrid_model.declare.class_body import require_sound_body
from hybrid_model.declare.hybrid_automaton import HybridAutomaton
from hybrid_model.declare.map_results import checked_assignments, checked_margin
from hybrid_model.declare.margins import least
from hybrid_model.declare.signatures import ExplainedCall
from hybrid_model.declare.transitions import Assignments, Jump, TimeEvent, require_maps
from hybrid_model.declare.tuning import named_value
from hybrid_model.declare.variables import DiscreteState, Kind, Value, Values, Variable
from hybrid_model.errors import DeclarationError, SimulationError


@dataclass(frozen=True)
class Mode(ExplainedCall):
    """A mode (location) of a classical hybrid automaton.

    Attributes
    ----------
    name : str
        Unique in the automaton.
    flow_map : callable, optional
        ``flow_map(self, s) -> {state: time derivative}`` of every continuous state; default: all rest.
    invariant : callable, optional
        ``invariant(self, s) -> margin``: flow in this mode is allowed where it is zero or above; default: everywhere.
    """

    name: str
    flow_map: Callable[[Any, Values], Assignments] | None = None
    invariant: Callable[[Any, Values], Value] | None = None

    def __post_init__(self) -> None:
        require_maps(self, *(name for name in ("flow_map", "invariant") if getattr(self, name) is not None))


@dataclass(frozen=True)
class Switch(ExplainedCall):
    """A jump from one mode to another, or to the same one.

    Attributes
    ----------
    name : str
        Name of the jump.
    source, target : str
        Names of the modes.
    guard : callable
        ``guard(self, s) -> margin``: the switch is enabled where it is zero or above.
    reset : callable, optional
        ``reset(self, s) -> {state: new value}``; states not named are kept.
    """

    name: str
    source: str
    target: str
    guard: Callable[[Any, Values], Value]
    reset: Callable[[Any, Values], Assignments] | None = None

    def __post_init__(self) -> None:
        require_maps(self, "guard", *(["reset"] if self.reset is not None else []))


@dataclass(frozen=True)
class TimedSwitch(ExplainedCall):
    """A switch at a known time.

    Attributes
    ----------
    name, source, target, reset
        As in `Switch`.
    time : callable
        ``time(self, s) -> absolute time`` in s, from parameters and discrete states.
    """

    name: str
    source: str
    target: str
    time: Callable[[Any, Values], Value]
    reset: Callable[[Any, Values], Assignments] | None = None

    def __post_init__(self) -> None:
        require_maps(self, "time", *(["reset"] if self.reset is not None else []))


class ModalAutomaton(HybridAutomaton):
    """Base class of classical hybrid automata: write ``modes`` and ``switches`` beside the variables.

    Switches come first in the order of simultaneous jumps, as declared; then the ``transitions``, which are jumps in
    every mode. The discrete state ``mode`` is the index of the present mode; an instance may be given its name:
    ``Heating(mode="off")``.

    Parameters
    ----------
    name, **values
        As in `HybridAutomaton`.

    Raises
    ------
    DeclarationError
        For a mode that does not exist, or a name used twice.
    """

    modes: ClassVar[tuple[Mode, ...]]
    switches: ClassVar[tuple[Switch | TimedSwitch, ...]] = ()
    written_by_authors: ClassVar[frozenset[str]] = HybridAutomaton.written_by_authors - {"flow_map", "flow_set"} | {
        "modes",
        "switches",
    }
    listed: ClassVar[Mapping[str, tuple[type, ...]]] = {
        **HybridAutomaton.listed,
        "modes": (Mode,),
        "switches": (Switch, TimedSwitch),
    }
    mode = DiscreteState(0, integer=True, output=True, description="index of the present mode")

    def __init__(self, name: str | None = None, **values: Any) -> None:
        require_sound_body(type(self), self.listed)
        self.name = name or type(self).__name__
        self.mode_names = tuple(mode.name for mode in getattr(type(self), "modes", ()))
        if not self.mode_names or len(set(self.mode_names)) < len(self.mode_names):
            raise DeclarationError(
                f"{self.name} has the modes {list(self.mode_names)}: declare at least one, and each name once."
            )
        mode = Variable("mode", Kind.DISCRETE, np.zeros(()), value_names=self.mode_names)
        if "mode" in values:
            values["mode"] = named_value(self.name, mode, values["mode"])
        super().__init__(name, **values)
        self.variables = tuple(
            replace(v, value_names=self.mode_names) if v.name == "mode" else v for v in self.variables
        )

    @property
    def has_flow_set(self) -> bool:
        """Whether some mode has an invariant."""
        return any(mode.invariant is not None for mode in self.modes)

    def flow_map(self, s: Values) -> Assignments:
        """Return the derivatives of the present mode."""
        if _is_number(s.mode):
            return self._flow_of(self._present(s), s)
        flows = [self._flow_of(mode, s) for mode in self.modes]
        return {name: _choose(s.mode, [flow[name] for flow in flows]) for name in flows[0]}

    def flow_set(self, s: Values) -> Value:
        """Return the margin of the present mode's invariant."""
        if _is_number(s.mode):
            return self._invariant_of(self._present(s), s)
        return _choose(s.mode, [self._invariant_of(mode, s) for mode in self.modes])

    def _flow_of(self, mode: Mode, s: Values) -> Assignments:
        states = [v.name for v in self.variables if v.kind is Kind.STATE]
        if mode.flow_map is None:
            return {name: 0.0 * s[name] for name in states}
        return checked_assignments(
            self.name, f"the flow map of mode {mode.name!r}", mode.flow_map(self, s), states, states
        )

    def _invariant_of(self, mode: Mode, s: Values) -> Value:
        if mode.invariant is None:
            return 1.0
        return checked_margin(self.name, f"the invariant of mode {mode.name!r}", mode.invariant(self, s))

    def _present(self, s: Values) -> Mode:
        index = int(s.mode)
        if not 0 <= index < len(self.modes):
            raise SimulationError(
                f"{self.name}: mode = {index} is not the index of a mode; they are "
                f"{', '.join(f'{k} {name}' for k, name in enumerate(self.mode_names))}."
            )
        return self.modes[index]

    def _index(self, mode: str) -> int:
        if mode not in self.mode_names:
            raise DeclarationError(f"{self.name} has no mode {mode!r}; it has {', '.join(self.mode_names)}.")
        return self.mode_names.index(mode)

    def _collect_transitions(self) -> tuple[Jump | TimeEvent, ...]:
        lowered = tuple(self._lowered(switch) for switch in self.switches)
        return self._named_once((*lowered, *super()._collect_transitions()))

    def _lowered(self, switch: Switch | TimedSwitch) -> Jump | TimeEvent:
        source, target = self._index(switch.source), self._index(switch.target)

        def jump_map(self: ModalAutomaton, s: Values) -> Assignments:
            return {**(switch.reset(self, s) if switch.reset else {}), "mode": target}

        if isinstance(switch, TimedSwitch):

            def time(self: ModalAutomaton, s: Values) -> Value:
                if _is_number(s.mode):
                    return switch.time(self, s) if s.mode == source else np.inf
                return np.where(s.mode == source, switch.time(self, s), np.inf)

            return TimeEvent(switch.name, time, jump_map)

        def jump_set(self: ModalAutomaton, s: Values) -> Value:
            if _is_number(s.mode) and s.mode != source:
                return -0.5
            guard = checked_margin(self.name, f"the guard of {switch.name!r}", switch.guard(self, s))
            return least(guard, 0.5 - np.abs(s.mode - source))

        return Jump(switch.name, jump_set, jump_map)


def _is_number(mode: Value) -> bool:
    # In a run the present mode is known, and the maps of the others, which may not be defined there, are left alone.
    return isinstance(mode, (int, float, np.number))


def _choose(mode: Value, options: list[Value]) -> Value:
    chosen = options[0]
    for index, option in enumerate(options[1:], start=1):
        chosen = np.where(mode == index, option, chosen)
    return chosen

"""Where a run is: the state of an automaton on hybrid time, and what its maps say there.

Jumps, flows and the search for events read a point; only the methods of its class write it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hybrid_model.declare.arguments import require_automaton
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import not_finite
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import INTEGERS, FloatArray, Kind, Values
from hybrid_model.declare.vector_form import vector_form
from hybrid_model.errors import SimulationError
from hybrid_model.record.flow_piece import FlowPiece
from hybrid_model.scales import one_instant
from hybrid_model.solver import Solver


@dataclass
class Looks:
    """Steps of a run since `begin` in s, and how many looks have found that none leads away from a jump of rates."""

    begin: float
    steps: int = 0
    found: int = 0

    def begin_at(self, t: float) -> None:
        """Begin anew at `t` in s."""
        self.begin, self.steps, self.found = t, 0, 0


class Point:
    """The point that a run has come to.

    Parameters
    ----------
    automaton : Automaton
        What runs.
    t_start, t_stop : float
        Start time, and the time that maps and inputs are not asked beyond (rule 13), in s.
    inputs : Inputs, optional
        The input vector as a function of time; default: start values.
    solver : Solver
        Accuracy.

    Attributes
    ----------
    t, j : float, int
        Hybrid time.
    x, z, p : ndarray
        Continuous states, discrete states, and parameters as they are at t.
    t_jump : float
        Time in s of the last jump that is no breakpoint; at first the start time.
    sizes : ndarray
        Usual size of each continuous state: the nominal value, or the largest that the run has shown.
    floor : float
        Size that all states have at least, where they have shown none by themselves.
    next_step : float or None
        The solver's proposal for its next step, in s.
    guards : int
        Number of jumps on state.
    levels : ndarray
        The margin from which on each jump on state is due: zero, or slightly below where the crossing is so near to the
        end of a flow that it counts as reached (rule 6).
    exit_level : float
        The margin of the flow set up to which it counts as left under flow priority: zero, or slightly above likewise.
    looks : Looks
        Whether its flow chatters.
    """

    def __init__(
        self,
        automaton: Automaton,
        *,
        t_start: float = 0.0,
        t_stop: float = math.inf,
        inputs: Inputs | None = None,
        solver: Solver | None = None,
    ) -> None:
        require_automaton(type(self).__name__, automaton)
        if not math.isfinite(t_start):
            raise SimulationError(f"the start time of {automaton.name} is {t_start}: give a finite number.")
        self.automaton = automaton
        self.maps = vector_form(automaton)
        self.layout = self.maps.layout
        self.inputs = inputs or Inputs(self.layout)
        self.solver = solver or Solver()
        self.on_state = np.array([info.trigger is Trigger.STATE for info in automaton.jumps], dtype=bool)
        self.guards = int(np.count_nonzero(self.on_state))
        self.t = self.t_start = self.t_jump = float(t_start)
        self.t_stop = float(t_stop)
        self.j = 0
        self.x, self.z = self.inputs.start(Kind.STATE), self.inputs.start(Kind.DISCRETE)
        self.tune()
        self._whole = np.array(self.layout.whole, dtype=bool)
        self.nominal = np.concatenate(
            [np.full(place.variable.size, place.variable.nominal or np.nan) for place in self.layout.places[Kind.STATE]]
            or [np.zeros(0)]
        )
        self.floor = 0.0
        self.next_step: float | None = None
        self.levels: FloatArray = np.zeros(self.guards)
        self.exit_level = 0.0
        self.looks = Looks(self.t)
        self.compute_start()

    # The writers.

    def compute_start(self) -> None:
        """Give the computed states their start values, from parameters, inputs and the other states."""
        x, z = self.maps.start(self.t, self.x, self.z, self.inputs.at(self.t), self.p)
        self._require_sound(x, z, "at the start")
        self.x, self.z = x, z
        self.sizes = np.where(np.isnan(self.nominal), np.abs(self.x), self.nominal)

    def begin_at(self, x: FloatArray, z: FloatArray) -> None:
        """Take other start values."""
        self.x, self.z = x, z

    def put(self, kind: Kind, index: int, value: float) -> bool:
        """Set a scalar state; return whether that changes it."""
        vector = {Kind.STATE: self.x, Kind.DISCRETE: self.z}[kind]
        changed = bool(vector[index] != value)
        vector[index] = value
        return changed

    def tune(self) -> None:
        """Take the parameters as they are from the present time on."""
        self.p = self.inputs.parameters_at(self.t)

    def arrive(self, t: float, x: FloatArray) -> None:
        """Take another point of the present flow."""
        self.t, self.x = t, x
        self.sizes = np.where(np.isnan(self.nominal), np.maximum(self.sizes, np.abs(x)), self.nominal)

    def follow(self, piece: FlowPiece) -> FlowPiece:
        """Take the end of a piece of the present flow and return the piece; SimulationError if it is not finite."""
        bad = not_finite(self.layout, Kind.STATE, piece.x1)
        if bad:
            raise SimulationError(f"{self.automaton.name}: {bad} at t = {piece.t1:.9g} s: states must stay finite.")
        self.arrive(piece.t1, piece.x1)
        return piece

    def move(self, t: float, x: FloatArray, z: FloatArray, j: int) -> None:
        """Move to a point of a flow that a copy has already flown."""
        self.z, self.j = z, j
        self.arrive(t, x)
        self.tune()
        self.clear_levels()

    def reset(self, index: int) -> None:
        """Take the states that a jump's map gives, at the same t and the next j.

        Raises
        ------
        SimulationError
            If a new value is not finite, or no whole number of 32 bits where it must be one.
        """
        info = self.automaton.jumps[index]
        x, z = self.maps.reset(index, self.t, self.x, self.z, self.inputs.at(self.t), self.p)
        self._require_sound(x, z, f"after jump {info.name!r} at t = {self.t:.9g} s")
        self.z, self.j = z, self.j + 1
        self.arrive(self.t, x)
        if not info.internal:
            self.t_jump = self.t
        if self.on_state[index]:
            self.levels = self.levels.copy()
            self.levels[self.row(index)] = self.exit_level = 0.0

    def clear_levels(self) -> None:
        """Let guards be due from zero on, and the flow set be left there."""
        self.levels, self.exit_level = np.zeros(self.guards), 0.0

    def enable_from(self, levels: FloatArray, exit_level: float = 0.0) -> None:
        """Let guards be due from these margins on, which are zero or below, and the flow set be left at that one."""
        self.levels, self.exit_level = levels, exit_level

    def propose_step(self, length: float | None) -> None:
        """Note how long the solver would have its next step, in s."""
        self.next_step = length

    def raise_floor(self, size: float) -> None:
        """Give all states at least this size."""
        self.floor = size

    # What the maps say; margins and times must be numbers (rule 10).

    @property
    def event_tolerance(self) -> float:
        """In s: the longest time that this run has taken for one instant, see `Solver.event_tolerance`."""
        declared = self.solver.event_tolerance
        return one_instant(self.t, self.t_start, self.t_start) if declared is None else declared

    def row(self, index: int) -> int:
        """Return which of the jumps with its trigger jump `index` is."""
        return int(np.count_nonzero(self.on_state[:index] == self.on_state[index]))

    def values(self) -> Values:
        """Return all values at the present hybrid time, by name."""
        return self.layout.values(self.t, self.x, self.z, self.inputs.at(self.t), self.p)

    def rates_at(self, t: float, x: FloatArray) -> FloatArray:
        """Return dx/dt at a point of the present flow."""
        return self.maps.rates(t, x, self.z, self.inputs.at(t), self.p)

    def margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the margins at a point of the present flow: of the jumps on state, and then of the flow set if any."""
        return self._require_margins(self.maps.margins(t, x, self.z, self.inputs.at(t), self.p), t)

    def margins_along(self, times: FloatArray, x: FloatArray) -> FloatArray:
        """Return the margins at points of the present flow, shape (times, margins); x has shape (times, states)."""
        u = [self.inputs.at(float(t)) for t in times] if self.inputs.vary else [self.inputs.at(self.t)] * len(times)
        table = self.maps.margins_along(times, x, self.z, u, self.p)
        if np.isnan(table).any():
            at = int(np.isnan(table).any(axis=1).argmax())
            self._require_margins(table[at], float(times[at]))
        if (table == 0.0).any():
            self._refuse_indicators(table)
        return table

    def flow_margin(self) -> float:
        """Return the margin of the flow set, which the automaton must have."""
        return float(self.margins(self.t, self.x)[-1])

    def event_times(self) -> FloatArray:
        """Return the absolute times in s of the jumps on time, shape ``(jumps,)``; SimulationError if one is none."""
        times = self.maps.event_times(self.t, self.x, self.z, self.inputs.at(self.t), self.p)
        if np.isnan(times).any():
            raise SimulationError(self._undefined("time of jump", self._name(times, on_state=False), self.t))
        return times

    # Refusals.

    def _require_sound(self, x: FloatArray, z: FloatArray, when: str) -> None:
        bad = not_finite(self.layout, Kind.STATE, x) or not_finite(self.layout, Kind.DISCRETE, z)
        if bad:
            raise SimulationError(f"{self.automaton.name}: {bad} {when}: states must stay finite numbers.")
        least, greatest = INTEGERS
        no_integers = self._whole & ~((z == np.round(z)) & (z >= least) & (z <= greatest))
        if no_integers.any():
            k = int(no_integers.argmax())
            raise SimulationError(
                f"{self.automaton.name}: {self.layout.names(Kind.DISCRETE)[k]} = {z[k]:.17g} {when}: it is declared "
                f"integer and must stay a whole number from {least} to {greatest}."
            )

    def _refuse_indicators(self, table: FloatArray) -> None:
        indicators = ((table == 0.0) | (table == 1.0)).all(axis=0) & (table.min(axis=0) < table.max(axis=0))
        if indicators.any():
            row = int(indicators.argmax())
            names = [info.name for info in self.automaton.jumps if info.trigger is Trigger.STATE]
            whose = f"jump {names[row]!r}" if row < self.guards else "the flow set"
            raise SimulationError(
                f"{self.automaton.name}: the margin of {whose} is 0 or 1 along the flow, as if it said no or yes: "
                "return a number that is zero or above inside the set and negative outside (for h >= 0 return h)."
            )

    def _require_margins(self, margins: FloatArray, t: float) -> FloatArray:
        if np.isnan(margins).any():
            if np.isnan(margins[: self.guards]).any():
                raise SimulationError(self._undefined("margin of jump", self._name(margins, on_state=True), t))
            raise SimulationError(self._undefined("margin of", "the flow set", t))
        return margins

    def _undefined(self, what: str, whose: str, t: float) -> str:
        return (
            f"{self.automaton.name}: the {what} {whose} is not a number at t = {t:.9g} s: it must be defined wherever "
            "a flow or a jump leads."
        )

    def _name(self, numbers: FloatArray, *, on_state: bool) -> str:
        rows = np.flatnonzero(self.on_state == on_state)
        return repr(self.automaton.jumps[rows[np.isnan(numbers[: len(rows)]).argmax()]].name)

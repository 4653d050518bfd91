"""An automaton on the engine in C as a block: predictions, and saving by a copy of memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import Kind
from hybrid_model.errors import SchedulingError, SimulationError
from hybrid_model.native.kept_models import model_of
from hybrid_model.native.run import Advance, Ending, NativeRun, View
from hybrid_model.native.simulation import FOR_STIFF_FLOWS, require_supported, set_options
from hybrid_model.scales import one_instant
from hybrid_model.schedule.blocks import Block, Step, Termination, Update
from hybrid_model.solver import Solver
from hybrid_model.zeno_guard import ZenoGuard

_OF_THE_RUN = (Ending.ZENO, Ending.BLOCKED, Ending.JUMPS)
"""Endings of a run; the others are errors of its maps or of the solver."""


class NativeBlock(Block):
    """An automaton that a scheduler steps from event to event; nothing is recorded.

    Parameters
    ----------
    name : str
        Name among the blocks.
    automaton : Automaton
        What runs.
    span : (float, float)
        Start, and the time up to which it looks ahead, in s.
    inputs : Inputs
        Values that inputs and parameters begin with; none may follow time.
    solver : Solver
        Accuracy.
    zeno : ZenoGuard
        What counts as an accumulation of jumps.
    predictable : bool
        Whether its inputs change at events only: then it names its next event.
    events : bool
        Whether the caller handles events; if not, they are handled inside each step.
    check : callable
        Called before the automaton is traced; what it raises is raised.

    Raises
    ------
    TraceError
        If the native engine cannot run it.
    BuildError
        If there is no compiler, or it fails.
    """

    def __init__(
        self,
        name: str,
        automaton: Automaton,
        span: tuple[float, float],
        inputs: Inputs,
        solver: Solver,
        zeno: ZenoGuard,
        *,
        predictable: bool,
        events: bool,
        check: Callable[[], None],
    ) -> None:
        require_supported(solver)
        self.name, self._automaton, self._check = name, automaton, check
        layout = inputs.layout
        self._solver, self._zeno, self._states = solver, zeno, layout.sizes[Kind.STATE]
        self._run = self._made(stiff=solver.method in FOR_STIFF_FLOWS)
        self._jumps = len(self._run.model.jumps)
        parameters = inputs.parameters_at(span[0])
        self._run.place([layout.start(Kind.STATE), layout.start(Kind.DISCRETE), inputs.held, parameters], *span)
        self._places = {element: (kind, k) for kind in Kind for k, element in enumerate(layout.names(kind))}
        self._clocks = tuple((clock.jump, clock.name) for clock in automaton.clocks)
        self._t, self._t_start, self._t_stop = span[0], *span
        self._predictable, self._events, self._view = predictable, events, View.START

    def begin(self) -> None:
        """Take what is due at the start and not for others to see."""
        self._view = View.LIVE
        if not self._run.begin(inside=not self._events):
            self._require_ending_of_the_run()

    def set(self, name: str, value: float) -> None:
        """See `Block.set`; states and parameters can be set as well."""
        kind, index = self._places[name]
        if kind is not Kind.OUTPUT:
            self._run.set(kind, index, float(value))

    def get(self, name: str) -> float:
        """See `Block.get`."""
        kind, index = self._places[name]
        value = self._run.read(self._view, kind, index)
        if value is None:
            raise SimulationError(f"{self._automaton.name}: {self._run.problem}")
        return value

    def enter_event_mode(self) -> None:
        """See `Block.enter_event_mode`."""

    def enter_step_mode(self) -> None:
        """See `Block.enter_step_mode`."""

    def update(self) -> Update:
        """See `Block.update`."""
        made = self._run.update(self._t_stop, predicts=self._predictable and self._t < self._t_stop)
        ticks = tuple(name for jump, name in self._clocks if jump == made.jump)
        if made.over:
            return Update(False, ticks, terminated=self._termination())
        return Update(
            bool(made.again), ticks, made.next if math.isfinite(made.next) else None, idle=made.jump >= self._jumps
        )

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`."""
        if abs(self._t - t) > one_instant(t, self._t_start, self._t_start) or not t_next > t:
            raise SchedulingError(
                f"{self.name} is at t = {self._t:.12g} s and cannot step from {t:.12g} to {t_next:.12g} s."
            )
        advance = Advance.PAUSED
        while advance is Advance.PAUSED:
            if self._run.shows_stiffness and not self._run.model.stiff:
                self._take_derivatives()
            advance = self._run.step(t_next, inside=not self._events)
        there = advance in (Advance.REACHED, Advance.EVENT_AT_TARGET)
        self._t = t_next if there else min(self._run.time, t_next)
        event = advance in (Advance.EVENT_AT_TARGET, Advance.EVENT_BEFORE)
        return Step(self._t, event, self._termination() if advance is Advance.ENDED else None)

    def save(self) -> Any:
        """See `Block.save`."""
        return self._t, self._run.save()

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self._t, block = state
        self._run.restore(block)

    def release(self, state: Any) -> None:
        """See `Block.release`."""

    def _made(self, *, stiff: bool) -> NativeRun:
        run = NativeRun(model_of(self._automaton, self._check, stiff=stiff))
        set_options(run, self._solver, self._zeno, self._states)
        return run

    def _take_derivatives(self) -> None:
        """Go on from where the run is with what a method for stiff flows needs: all that evolves is laid out alike."""
        block = self._run.save()
        self._run = self._made(stiff=True)
        self._run.restore(block)

    def _termination(self) -> Termination:
        self._require_ending_of_the_run()
        return Termination(f"{self._automaton.name}: {self._run.message}", self._run.ending is Ending.ZENO)

    def _require_ending_of_the_run(self) -> None:
        if self._run.ending not in _OF_THE_RUN:
            raise SimulationError(f"{self._automaton.name}: {self._run.message}")

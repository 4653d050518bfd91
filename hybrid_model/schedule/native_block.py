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

OF_THE_RUN = (Ending.ZENO, Ending.BLOCKED, Ending.JUMPS)
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

    Attributes
    ----------
    automaton : Automaton
        The same.
    run : NativeRun
        It on the engine.
    clocks : tuple of (int, str)
        Output clocks: the number of the jump that each ticks with, and its name.

    Raises
    ------
    TraceError
        If the native engine cannot run it.
    BuildError
        If there is no compiler, or it fails.
    """

    tells_jumps = True

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
        self.name, self.automaton, self._check = name, automaton, check
        layout = inputs.layout
        self._solver, self._zeno, self._states = solver, zeno, layout.sizes[Kind.STATE]
        self.run = self._made(stiff=solver.method in FOR_STIFF_FLOWS)
        self._jumps = len(self.run.model.jumps)
        parameters = inputs.parameters_at(span[0])
        self.run.place([layout.start(Kind.STATE), layout.start(Kind.DISCRETE), inputs.held, parameters], *span)
        self._places = {element: (kind, k) for kind in Kind for k, element in enumerate(layout.names(kind))}
        self.clocks = tuple((clock.jump, clock.name) for clock in automaton.clocks)
        self._t, self._t_start, self._t_stop = span[0], *span
        self._predictable, self._events, self._view = predictable, events, View.START

    def place(self, name: str) -> tuple[Kind, int]:
        """Return where a scalar is: its kind, and its place in the vector of that kind."""
        return self._places[name]

    def begin(self) -> None:
        """Take what is due at the start and not for others to see."""
        self._view = View.LIVE
        if not self.run.begin(inside=not self._events):
            self._require_ending_of_the_run()

    def set(self, name: str, value: float) -> None:
        """See `Block.set`; states and parameters can be set as well."""
        kind, index = self.place(name)
        if kind is not Kind.OUTPUT:
            self.run.set(kind, index, float(value))

    def get(self, name: str) -> float:
        """See `Block.get`."""
        kind, index = self.place(name)
        value = self.run.read(self._view, kind, index)
        if value is None:
            raise SimulationError(f"{self.automaton.name}: {self.run.problem}")
        return value

    def enter_event_mode(self) -> None:
        """See `Block.enter_event_mode`."""

    def enter_step_mode(self) -> None:
        """See `Block.enter_step_mode`."""

    def update(self) -> Update:
        """See `Block.update`."""
        made = self.run.update(self._t_stop, predicts=self._predictable and self._t < self._t_stop)
        ticks = tuple(name for jump, name in self.clocks if jump == made.jump)
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
            if self.run.shows_stiffness and not self.run.model.stiff:
                self._take_derivatives()
            advance = self.run.step(t_next, inside=not self._events)
        there = advance in (Advance.REACHED, Advance.EVENT_AT_TARGET)
        self._t = t_next if there else min(self.run.time, t_next)
        event = advance in (Advance.EVENT_AT_TARGET, Advance.EVENT_BEFORE)
        return Step(self._t, event, self._termination() if advance is Advance.ENDED else None)

    def save(self) -> Any:
        """See `Block.save`."""
        return self._t, self.run.save()

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self._t, block = state
        self.run.restore(block)

    def release(self, state: Any) -> None:
        """See `Block.release`."""

    def _made(self, *, stiff: bool) -> NativeRun:
        run = NativeRun(model_of(self.automaton, self._check, stiff=stiff))
        set_options(run, self._solver, self._zeno, self._states)
        return run

    def _take_derivatives(self) -> None:
        """Go on from where the run is with what a method for stiff flows needs: all that evolves is laid out alike."""
        block = self.run.save()
        self.run = self._made(stiff=True)
        self.run.restore(block)

    def _termination(self) -> Termination:
        self._require_ending_of_the_run()
        return Termination(f"{self.automaton.name}: {self.run.message}", self.run.ending is Ending.ZENO)

    def _require_ending_of_the_run(self) -> None:
        if self.run.ending not in OF_THE_RUN:
            raise SimulationError(f"{self.automaton.name}: {self.run.message}")

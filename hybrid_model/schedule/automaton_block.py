"""A run of an automaton as a block: it predicts its next event, and steps there without integrating again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hybrid_model.declare.variables import Kind
from hybrid_model.errors import SchedulingError
from hybrid_model.record.recording import Recording
from hybrid_model.reference.execution import Execution
from hybrid_model.reference.tolerances import instant
from hybrid_model.schedule.blocks import Block, Step, Termination, Update
from hybrid_model.schedule.predicted_run import PredictedRun, take_internal
from hybrid_model.stop import Stop


class AutomatonBlock(Block):
    """An automaton that a scheduler steps from event to event.

    Parameters
    ----------
    name : str
        Name among the blocks.
    run : Execution
        The automaton at its start.
    t_stop : float
        Time in s up to which it looks ahead.
    predictable : bool
        Whether its inputs change at events only, or are known functions of time: then it names its next event.
    events : bool
        Whether the caller handles events; if not, they are handled inside each step.
    keep : bool
        Whether to record flows and jumps.
    on_jump : callable, optional
        Called with the name after each jump that is no breakpoint.

    Attributes
    ----------
    run : Execution
        The automaton as it is now.
    recording : Recording
        What it has run so far.
    """

    tells_jumps = True

    def __init__(
        self,
        name: str,
        run: Execution,
        t_stop: float,
        *,
        predictable: bool = True,
        events: bool = True,
        keep: bool = True,
        on_jump: Callable[[str], None] | None = None,
    ) -> None:
        self.name = name
        self.run = run
        self.recording = Recording(run.t, run.j, run.x, run.z, run.inputs.held, keep=keep)
        self._t_stop, self._predictable, self._events = t_stop, predictable, events
        self._on_jump = on_jump
        self._ahead: PredictedRun | None = None
        self._places = {element: (kind, k) for kind in Kind for k, element in enumerate(run.layout.names(kind))}

    def begin(self) -> None:
        """Take what is due at the start and not for others to see."""
        self._take_internal()
        if not self._events:
            self._take_all()

    def set(self, name: str, value: float) -> None:
        """See `Block.set`; states and parameters can be set as well."""
        run = self.run
        kind, index = self._places[name]
        if kind is Kind.INPUT:
            changed = run.inputs.hold_element(index, value)
            if changed:
                self.recording.receive(run.t, run.j, run.inputs.held)
        elif kind is Kind.PARAMETER:
            changed = run.inputs.hold_parameter(index, value)
            run.tune()
        else:
            changed = run.put(kind, index, value)
        if changed:
            self._ahead = None

    def get(self, name: str) -> float:
        """See `Block.get`."""
        run = self.run
        kind, index = self._places[name]
        if kind is Kind.OUTPUT:
            outputs = run.automaton.output_values(run.values())
            return float(run.layout.pack(Kind.OUTPUT, outputs)[index])
        vectors = {Kind.STATE: run.x, Kind.DISCRETE: run.z, Kind.PARAMETER: run.p}
        vector = vectors[kind] if kind in vectors else run.inputs.at(run.t)
        return float(vector[index])

    def enter_event_mode(self) -> None:
        """See `Block.enter_event_mode`."""

    def enter_step_mode(self) -> None:
        """See `Block.enter_step_mode`."""

    def update(self) -> Update:
        """See `Block.update`."""
        run = self.run
        self._take_internal()
        ticks: tuple[str, ...] = ()
        index = run.due()
        if index is not None:
            self.recording.jumped(run.jump(index))
            self._ahead = None
            if self._on_jump:
                self._on_jump(self.name)
            ticks = tuple(clock.name for clock in run.automaton.clocks if clock.jump == index)
            self._take_internal()
        if run.stopped is not None:
            return Update(False, ticks, terminated=termination(run))
        again = run.due() is not None
        return Update(again, ticks, None if again else self._predict(), idle=index is None)

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`."""
        run, ahead = self.run, self._ahead
        if abs(run.t - t) > instant(run, t) or not t_next > t:
            raise SchedulingError(
                f"{self.name} is at t = {run.t:.12g} s and cannot step from {t:.12g} to {t_next:.12g} s."
            )
        if ahead is None:
            self._search(t_next)
        elif t_next < ahead.end.t:
            ahead.move(run, t_next, self.recording)
        else:
            self.run = run = ahead.move_to_end(self.recording)
            self._ahead = None
            # The caller may go slightly beyond the event, to where another block's simultaneous event is.
            if t_next <= run.t + instant(run, t_next):
                self.recording.flowed(run.drift(t_next))
        due = self._events and ((ahead is not None and run is ahead.end) or run.due() is not None)
        return Step(run.t, due, termination(run))

    def save(self) -> Any:
        """See `Block.save`; what was recorded stays."""
        return self.run.copy()

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self.run, self._ahead = state.copy(), None

    def release(self, state: Any) -> None:
        """See `Block.release`."""

    def _search(self, t_next: float) -> None:
        """Flow to `t_next`, looking for events on the way, and before it: what was set may have made a jump due."""
        run = self.run
        while run.stopped is None:
            self._take_internal()
            if self._events and run.due() is not None:
                return
            if not self._events:
                self._take_all()
            if run.stopped is not None or run.t >= t_next:
                return
            self.recording.flowed(run.flow(t_next))

    def _take_internal(self) -> None:
        for jump in take_internal(self.run):
            self.recording.jumped(jump)

    def _take_all(self) -> None:
        run = self.run
        while run.stopped is None and (index := run.due()) is not None:
            self.recording.jumped(run.jump(index))

    def _predict(self) -> float | None:
        """Run a copy ahead to its next event, or to the stop time, and keep it: stepping there costs nothing more."""
        if not self._predictable or self.run.t >= self._t_stop:
            return None
        if self._ahead is None:
            self._ahead = PredictedRun.from_run(self.run, self._t_stop)
        # A run that ends where it is has no time to announce; the next step says why it ends.
        return self._ahead.end.t if self._ahead.end.t > self.run.t else None


def termination(run: Execution) -> Termination | None:
    """Return why a run ended, if it did."""
    return None if run.stopped is None else Termination(run.message, run.stopped is Stop.ZENO)

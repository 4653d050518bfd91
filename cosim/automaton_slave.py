"""An automaton in this process behind the slave interface."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.errors import CosimError
from cosim.lookahead import Lookahead, take_internal
from cosim.slave import Port, Slave, Step, Termination, Update
from hybrid_model import Automaton, Execution, Solver, Stop
from hybrid_model.layout import Layout
from hybrid_model.signals import Inputs
from hybrid_model.variables import Kind, element_names


class AutomatonSlave(Slave):
    """An automaton that a master steps, with the same outside as its FMU.

    Parameters
    ----------
    name : str
        Name in the system.
    automaton : Automaton
        What runs.
    solver : Solver, optional
        Accuracy.
    """

    has_event_mode = True
    can_restore = True

    def __init__(self, name: str, automaton: Automaton, solver: Solver | None = None) -> None:
        layout = Layout(automaton)
        ports: dict[Kind, list[Port]] = {kind: [] for kind in Kind}
        for variable in automaton.variables:
            discrete = variable.discrete or variable.kind is Kind.DISCRETE
            ports[variable.kind] += [Port(element, variable.unit, discrete) for element in element_names(variable)]
        outputs = [
            port
            for kind in (Kind.OUTPUT, Kind.STATE, Kind.DISCRETE)
            for port in ports[kind]
            if kind is Kind.OUTPUT or _is_output(automaton, port.name)
        ]
        super().__init__(name, ports[Kind.INPUT], outputs, [clock.name for clock in automaton.clocks])
        self.automaton = automaton
        self._solver = solver
        self._places = {element: (kind, k) for kind in Kind for k, element in enumerate(layout.names(kind))}
        self._predictable = all(port.discrete for port in ports[Kind.INPUT])
        self._starts: dict[str, float] = {}
        self._run: Execution | None = None
        self._ahead: Lookahead | None = None
        self._ticks: list[str] = []

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return list(self._places)

    def set(self, name: str, value: float) -> None:
        """See `Slave.set`."""
        if name not in self._places:
            raise self.unknown(name)
        if not np.isfinite(value):
            raise CosimError(f"{self.name}.{name} is set to {value}: set a finite number.")
        if self._run is None:
            self._starts[name] = value
        elif self._set_in_run(*self._places[name], value):
            self._ahead = None

    def get(self, name: str) -> float:
        """See `Slave.get`."""
        if name not in self._places:
            raise self.unknown(name)
        kind, index = self._places[name]
        run = self._running
        if kind is Kind.OUTPUT:
            outputs = self.automaton.output_values(run.values())
            return float(run.layout.pack(Kind.OUTPUT, outputs)[index])
        vectors = {Kind.STATE: run.x, Kind.DISCRETE: run.z, Kind.PARAMETER: run.p, Kind.INPUT: run.inputs.at(run.t)}
        return float(vectors[kind][index])

    def start(self, t_start: float, t_stop: float, *, events: bool) -> None:
        """See `Slave.start`."""
        self._events, self._t_stop = events, t_stop
        layout = Layout(self.automaton)
        self._run = Execution(self.automaton, t_start=t_start, inputs=Inputs(layout), solver=self._solver)
        for name, value in self._starts.items():
            self._set_in_run(*self._places[name], value)
        self._run.compute_start()

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._running.compute_start()
        take_internal(self._running)
        if not self._events:
            self._take_all()

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""

    def update(self) -> Update:
        """See `Slave.update`."""
        run = self._running
        take_internal(run)
        ticks: tuple[str, ...] = ()
        index = run.due()
        if index is not None:
            run.jump(index)
            self._ahead = None
            ticks = tuple(clock.name for clock in self.automaton.clocks if clock.jump == index)
            take_internal(run)
        if run.stopped is not None:
            return Update(False, ticks, terminated=_termination(run))
        again = run.due() is not None
        return Update(again, ticks, None if again else self._predict())

    def step(self, t: float, t_next: float) -> Step:
        """See `Slave.step`."""
        run, ahead = self._running, self._ahead
        if abs(run.t - t) > 1e-12 * max(1.0, abs(t)) or not t_next > t:
            raise CosimError(f"{self.name} is at t = {run.t:.12g} s and cannot step from {t:.12g} to {t_next:.12g} s.")
        if ahead is None:
            self._search(run, t_next)
        elif t_next < ahead.end.t:
            ahead.move(run, t_next)
        else:
            self._run = run = ahead.end
            self._ahead = None
            # The master may go slightly beyond the event, to where another block's simultaneous event is.
            if t_next <= run.t + run.solver.event_tolerance:
                run.drift(t_next)
        due = self._events and ((ahead is not None and run is ahead.end) or run.due() is not None)
        return Step(run.t, due, _termination(run))

    def _search(self, run: Execution, t_next: float) -> None:
        """Flow to `t_next`, looking for events on the way."""
        while run.t < t_next and run.stopped is None:
            run.flow(t_next)
            take_internal(run)
            if self._events and run.due() is not None:
                return
            if not self._events:
                self._take_all()

    def save(self) -> Any:
        """See `Slave.save`."""
        return self._running.copy()

    def restore(self, state: Any) -> None:
        """See `Slave.restore`."""
        self._run, self._ahead = state.copy(), None

    def release(self, state: Any) -> None:
        """See `Slave.release`."""

    def close(self) -> None:
        """See `Slave.close`."""
        self._run = self._ahead = None

    @property
    def _running(self) -> Execution:
        if self._run is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._run

    def _set_in_run(self, kind: Kind, index: int, value: float) -> bool:
        run = self._running
        if kind is Kind.INPUT:
            return run.inputs.hold_element(index, value)
        vector = {Kind.STATE: run.x, Kind.DISCRETE: run.z, Kind.PARAMETER: run.p}[kind]
        changed = bool(vector[index] != value)
        vector[index] = value
        return changed

    def _take_all(self) -> None:
        run = self._running
        while run.stopped is None and (index := run.due()) is not None:
            run.jump(index)

    def _predict(self) -> float | None:
        """Run a copy ahead to its next event, or to the stop time, and keep it: stepping there costs nothing more."""
        if not self._predictable or self._running.t >= self._t_stop:
            return None
        if self._ahead is None:
            self._ahead = Lookahead.from_run(self._running, self._t_stop)
        # A run that ends where it is has no time to announce; the next step says why it ends.
        return self._ahead.end.t if self._ahead.end.t > self._running.t else None


def _termination(run: Execution) -> Termination | None:
    return None if run.stopped is None else Termination(run.message, run.stopped is Stop.ZENO)


def _is_output(automaton: Automaton, element: str) -> bool:
    return any(element in element_names(variable) and variable.output for variable in automaton.variables)

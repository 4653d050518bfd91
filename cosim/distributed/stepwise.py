"""A system that is advanced from outside, from time to time, and given values in between."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from cosim.errors import CosimError
from cosim.masters.changes import Changes
from cosim.masters.start import start_slaves
from cosim.system import System
from fmu.importer.values import Value
from hybrid_model.errors import SchedulingError
from hybrid_model.schedule.blocks import Termination
from hybrid_model.schedule.scheduler import Scheduler


class StepwiseRun:
    """A run that somebody else leads.

    Where all slaves have event mode and send each other discrete signals alone, events between two times are at their
    exact times, and what is set from outside is an event. Else the slaves step from time to time (Jacobi).

    Parameters
    ----------
    system : System
    t_start, t_stop : float
        Times in s; the run may end before.

    Attributes
    ----------
    t : float
        Time in s.
    """

    def __init__(self, system: System, t_start: float, t_stop: float) -> None:
        self._system, self.t, self._t_stop = system, t_start, t_stop
        slaves = system.slaves.values()
        exact = all(slave.has_event_mode and slave.variable_step for slave in slaves)
        exact = exact and all(system.slaves[c.source].outputs[c.output].discrete for c in system.connections)
        self._scheduler = Scheduler(system.slaves, system.from_slave, t_start) if exact else None
        try:
            start_slaves(system, t_start, t_stop, events=exact, changes=Changes(system, {}, t_start))
            self._handle(system.slaves)
        except BaseException:
            system.close()
            raise

    @property
    def next_event(self) -> float:
        """Time in s of the first event that is foreseen; infinity if none is."""
        return math.inf if self._scheduler is None else self._scheduler.next_event

    def advance_to(self, t: float) -> None:
        """Go on to `t` in s.

        Raises
        ------
        CosimError
            If a slave fails or ends the run before.
        """
        if t <= self.t:
            return
        if t > self._t_stop:
            raise CosimError(f"the run was to end at {self._t_stop:.9g} s, and is to go on to {t:.9g} s.")
        if self._scheduler is not None:
            try:
                self._scheduler.advance_to(t)
            except SchedulingError as error:
                raise CosimError(str(error)) from error
            self._require_going_on(self._scheduler.ended)
        else:
            for name, slave in self._system.slaves.items():
                made = slave.step(self.t, t)
                self._require_going_on((name, made.reached, made.terminated) if made.terminated else None)
            carried = [(c, c.carried(self._system.slaves[c.source].get(c.output))) for c in self._system.connections]
            for connection, value in carried:
                self._system.slaves[connection.target].set(connection.input, value)
        self.t = t

    def set(self, slave: str, values: Mapping[str, Value]) -> None:
        """Set inputs of a slave, or tunable parameters, now."""
        for name in values:
            self._system.settable(f"{slave}.{name}")
        if self._scheduler is not None:
            self._system.slaves[slave].enter_event_mode()
        for name, value in values.items():
            self._system.slaves[slave].set(name, value)
        self._handle({slave})

    def _handle(self, due: Collection[str]) -> None:
        if self._scheduler is not None:
            self._scheduler.handle_events(self.t, due)
            self._require_going_on(self._scheduler.ended)

    @staticmethod
    def _require_going_on(ended: tuple[str, float, Termination] | None) -> None:
        if ended is not None:
            raise CosimError(f"{ended[0]} ended the run at t = {ended[1]:.9g} s: {ended[2].message}")

"""A slave that cannot return to an earlier state, and does: its run is made again from the start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from cosim.errors import CosimError
from cosim.slave import Slave
from fmu.importer.values import Value
from hybrid_model.schedule.blocks import Step, Update

MOST_REPEATED = 10_000_000
"""Calls that are made again in one run, at most: each return makes all calls since the start again."""


class ReplayedSlave(Slave):
    """A slave with `save` and `restore` for one that has none, which must do the same in each run.

    Parameters
    ----------
    slave : Slave
        Not started.
    """

    can_restore = True

    def __init__(self, slave: Slave) -> None:
        super().__init__(
            slave.name, list(slave.inputs.values()), list(slave.outputs.values()), slave.clocks, slave.tunable
        )
        self._slave = slave
        self.has_event_mode, self.stops_after_events = slave.has_event_mode, slave.stops_after_events
        self.foresees, self.variable_step, self.internal_step = slave.foresees, slave.variable_step, slave.internal_step
        self._calls: list[tuple[str, tuple[Any, ...]]] = []
        self._runs = self._repeated = 0
        self._begin_again: Callable[[], None] = lambda: None

    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """See `Slave.start`."""
        self._begin_again = lambda: self._slave.start(t_start, t_stop, events=events, early=early)
        self._calls, self._repeated = [], 0
        self._begin_again()

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._call("begin")

    def set(self, name: str, value: Value) -> None:
        """See `Slave.set`."""
        self._call("set", name, value)

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""
        self._call("enter_event_mode")

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""
        self._call("enter_step_mode")

    def update(self) -> Update:
        """See `Slave.update`."""
        made: Update = self._call("update")
        return made

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`."""
        made: Step = self._call("step", t, t_next)
        return made

    def get(self, name: str) -> Any:
        """See `Slave.get`."""
        return self._slave.get(name)

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """See `Slave.reader`; each run needs one of its own."""
        run, read = self._runs, self._slave.reader(names)

        def read_of_now() -> list[Any]:
            nonlocal run, read
            if run != self._runs:
                run, read = self._runs, self._slave.reader(names)
            return read()

        return read_of_now

    def save(self) -> int:
        """Return how many calls led here."""
        return len(self._calls)

    def restore(self, state: int) -> None:
        """Make the first `state` calls again.

        Raises
        ------
        CosimError
            If that has been too many in this run.
        """
        if state == len(self._calls):
            return
        self._repeated += state
        if self._repeated > MOST_REPEATED:
            raise CosimError(
                f"{self.name} cannot save its state, and the master has made {self._repeated} of its calls again: use "
                "the fixed-step master, or a shorter run."
            )
        del self._calls[state:]
        self._slave.close()
        self._begin_again()
        self._runs += 1
        for name, arguments in self._calls:
            getattr(self._slave, name)(*arguments)

    def release(self, state: int) -> None:
        """See `Block.release`."""

    def close(self) -> None:
        """See `Slave.close`."""
        self._slave.close()

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return self._slave.variable_names

    def _call(self, name: str, *arguments: Any) -> Any:
        self._calls.append((name, arguments))
        return getattr(self._slave, name)(*arguments)

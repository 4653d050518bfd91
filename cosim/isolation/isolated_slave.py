"""An FMU in a process of its own behind the slave interface."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from cosim.errors import CosimError, MisfitError
from cosim.slave import Slave
from fmu.importer.values import Value
from hybrid_model.schedule.blocks import Step, Update

PATIENCE = 60.0
"""Seconds that one call may take."""
GOODBYE = 2.0
"""Seconds that a process has to end by itself."""
SHOWN = 3
"""Most names of variables in a message."""


class IsolatedSlave(Slave):
    """An FMU whose native code runs in another process; calls and values travel over a socket pair.

    Where the FMU ends its process or does not come back, the error names it and the call, and the run's other slaves
    are as they were. Needs a system with socket pairs, as Linux and macOS have them.

    Parameters
    ----------
    name : str
        Name in the system.
    path : str or Path
        The FMU.
    validate : bool
        Whether to hold its description against the schema and fmpy's checks.
    kind : {"CoSimulation", "ModelExchange"}
        The interface that is used.
    patience : float
        Seconds that one call may take.

    Raises
    ------
    CosimError
        As for the slave itself; and if no process can be started.
    """

    def __init__(
        self,
        name: str,
        path: str | Path,
        *,
        validate: bool = True,
        kind: str = "CoSimulation",
        patience: float = PATIENCE,
    ) -> None:
        self.name, self._patience = name, patience
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._make = (kind, name, str(path)), {"validate": validate}
        self._given: list[tuple[str, Value]] = []
        self._readers: dict[int, str] = {}
        self._begin()
        super().__init__(name, list(self.inputs.values()), list(self.outputs.values()), self.clocks, self.tunable)

    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """See `Slave.start`; after `close` in a new process."""
        if self._process is None:
            self._begin()
            for name, value in self._given:
                self._call("set", name, value)
        self._call("start", t_start, t_stop, events=events, early=early)

    def begin(self) -> None:
        """See `Slave.begin`."""
        self._call("begin")

    def set(self, name: str, value: Value) -> None:
        """See `Slave.set`."""
        self._call("set", name, value)
        if not self._started:
            self._given.append((name, value))
            self._learn(self._call("facts"))
            self._tell_of_sizes()

    def get(self, name: str) -> Any:
        """See `Slave.get`."""
        return self._call("get", name)

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """See `Slave.reader`."""
        return self._read_by("reader", names)

    def slopes(self, names: Sequence[str]) -> Callable[[], list[float]]:
        """See `Slave.slopes`."""
        return self._read_by("slopes", names)

    def _read_by(self, kind: str, names: Sequence[str]) -> Callable[[], list[Any]]:
        handle = self._call(kind, list(names))
        some = ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
        self._readers[handle] = f"reading {'slopes of ' * (kind == 'slopes')}{some}"
        return lambda: list(self._call("read", handle))

    def lead(self, lines: Mapping[str, tuple[float, float]]) -> None:
        """See `Slave.lead`."""
        self._call("lead", dict(lines))

    def parse(self, name: str, text: str) -> Value:
        """See `Slave.parse`."""
        value: Value = self._call("parse", name, text)
        return value

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

    def save(self) -> Any:
        """See `Block.save`."""
        return self._call("save")

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self._call("restore", state)

    def release(self, state: Any) -> None:
        """See `Block.release`; nothing if the process is gone, and the state with it."""
        if self._process is not None:
            self._call("release", state)

    def close(self) -> None:
        """See `Slave.close`; the process ends."""
        if self._process is None:
            return
        try:
            self.failed_at_end = self._call("close")
        except CosimError as error:
            self.failed_at_end = str(error)
        self._end()

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return self._variable_names

    def _begin(self) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-m", "cosim.isolation.child", str(theirs.fileno())]
        try:
            # An interrupt from the keyboard is for this process alone.
            self._process = subprocess.Popen(
                command, pass_fds=[theirs.fileno()], stdin=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            raise CosimError(f"{self.name}: no process can be started for it: {error}.") from error
        finally:
            theirs.close()
        self._connection, self._started = Connection(ours.detach()), False
        arguments, named = self._make
        self._learn(self._call("make", *arguments, **named))

    def _learn(self, facts: dict[str, Any]) -> None:
        self._variable_names: list[str] = facts.pop("variable_names")
        for name, value in facts.items():
            setattr(self, name, value)

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        if self._connection is None:
            raise CosimError(f"{self.name}: its process is gone, so {_told(method, arguments)} cannot be called.")
        told = self._readers.get(arguments[0], "") if method == "read" else _told(method, arguments)
        self._started = self._started or method == "start"
        try:
            self._connection.send((method, arguments, named))
            if not self._connection.poll(self._patience):
                if self._process is not None:
                    self._process.kill()
                self._end()
                raise CosimError(
                    f"{self.name} did not come back from {told} within {self._patience:g} s; its process was ended."
                )
            done, answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise CosimError(f"{self.name} {self._how_it_ended()} in {told}.") from error
        if not done:
            misfit, message = answer
            raise (MisfitError if misfit else CosimError)(message)
        return answer

    def _how_it_ended(self) -> str:
        process = self._process
        self._end()
        code = None if process is None else process.returncode
        if code is not None and code < 0:
            return f"crashed ({signal.Signals(-code).name})"
        return f"ended its process (status {code})"

    def _end(self) -> None:
        process, connection = self._process, self._connection
        self._process = self._connection = None
        if connection is not None:
            connection.close()
        if process is not None:
            try:
                process.wait(GOODBYE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdin is not None:
                process.stdin.close()


def _told(method: str, arguments: tuple[Any, ...]) -> str:
    return f"{method}({', '.join(f'{a:.12g}' if isinstance(a, float) else repr(a) for a in arguments)})"

"""What runs in the process of an isolated FMU: a slave, and a loop of calls that come over a pipe."""

from __future__ import annotations

import itertools
import os
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from cosim.errors import CosimError, MisfitError
from cosim.exchange_slave import ExchangeSlave
from cosim.fmu_slave import FmuSlave

FACTS = (
    *("inputs", "outputs", "clocks", "tunable", "has_event_mode", "can_restore", "variable_step", "foresees", "direct"),
    *(
        "default_start_time",
        "default_stop_time",
        "default_step",
        "internal_step",
        "variable_names",
        "stops_after_events",
        "sloped",
        "interpolating",
    ),
)
"""What the other side knows of a slave."""


class Served:
    """A slave with handles in the place of what cannot travel: states and readers."""

    def __init__(self, slave: FmuSlave) -> None:
        self._slave, self._count = slave, itertools.count()
        self._states: dict[int, Any] = {}
        self._readers: dict[int, Callable[[], list[Any]]] = {}

    def facts(self) -> dict[str, Any]:
        """Return what the other side knows."""
        return {name: getattr(self._slave, name) for name in FACTS}

    def save(self) -> int:
        """Save a state; return its handle."""
        handle = next(self._count)
        self._states[handle] = self._slave.save()
        return handle

    def restore(self, handle: int) -> None:
        """Return to a state."""
        self._slave.restore(self._states[handle])

    def release(self, handle: int) -> None:
        """Free a state."""
        self._slave.release(self._states.pop(handle))

    def reader(self, names: list[str]) -> int:
        """Make a reader; return its handle."""
        handle = next(self._count)
        self._readers[handle] = self._slave.reader(names)
        return handle

    def slopes(self, names: list[str]) -> int:
        """Make a reader of slopes; return its handle."""
        handle = next(self._count)
        self._readers[handle] = self._slave.slopes(names)
        return handle

    def read(self, handle: int) -> list[Any]:
        """Return what a reader reads."""
        return list(self._readers[handle]())

    def load(self) -> None:
        """Load the binary."""
        self._slave.load()

    def close(self) -> str:
        """Close the slave; return what failed in that."""
        self._slave.close()
        return self._slave.failed_at_end

    def __getattr__(self, name: str) -> Any:
        return getattr(self._slave, name)


def end_with_parent() -> None:
    """Let this process end when the one that started it is gone, however that ended and whatever an FMU does here.

    Native code may be in a loop for ever; a thread of Python goes on beside it, and sees the end of the input that the
    other process holds open.
    """

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 1):
            pass
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def serve(connection: Connection) -> None:
    """Make the slave that the first message describes, and answer calls until the other side is gone."""
    served: Any = None
    while True:
        try:
            method, arguments, named = connection.recv()
        except (EOFError, OSError, KeyboardInterrupt):
            break
        try:
            if method == "make":
                kind, *rest = arguments
                served = Served((ExchangeSlave if kind == "ModelExchange" else FmuSlave)(*rest, **named))
                answer = True, served.facts()
            else:
                answer = True, getattr(served, method)(*arguments, **named)
                if method == "set":
                    answer = True, None
        except (CosimError, ValueError) as error:
            answer = False, (isinstance(error, MisfitError), str(error))
        try:
            connection.send(answer)
        except (BrokenPipeError, OSError):
            break


if __name__ == "__main__":
    end_with_parent()
    serve(Connection(int(sys.argv[1])))

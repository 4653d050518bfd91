"""What an FMU of FMI 2.0 may call, over fmpy: the logger and the memory functions.

fmpy formats the messages of all FMUs for one logger of the process, the last that it was given. So there is one logger,
and it tells the instances apart by the environment that each gives to its FMU.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
from collections.abc import Callable

from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    printLogMessage,
)

from fmu.importer.memory import memory_functions

Listener = Callable[[int, str], None]
_listeners: dict[int, Listener] = {}
_named: dict[bytes, Listener] = {}
_environments = itertools.count(1)


class Callbacks:
    """The functions for one instance.

    Parameters
    ----------
    listener : callable
        Told the status and the text of each message.
    name : str
        Of the instance: some FMUs name it in their messages, but not the environment.

    Attributes
    ----------
    functions : fmpy.fmi2.fmi2CallbackFunctions
        For fmpy's ``instantiate``.
    """

    def __init__(self, listener: Listener, name: str) -> None:
        self._environment, self._name = next(_environments), name.encode()
        _listeners[self._environment] = listener
        _named[self._name] = listener
        allocate, free = memory_functions()
        self.functions = fmi2CallbackFunctions(
            logger=_logger,
            allocateMemory=ctypes.cast(allocate, fmi2CallbackAllocateMemoryTYPE),
            freeMemory=ctypes.cast(free, fmi2CallbackFreeMemoryTYPE),
            componentEnvironment=self._environment,
        )
        with contextlib.suppress(ImportError, OSError):  # where fmpy has none, texts stay unformatted
            from fmpy.logging import addLoggerProxy

            addLoggerProxy(ctypes.byref(self.functions))

    def release(self) -> None:
        """Forget the listener; the instance is gone."""
        _listeners.pop(self._environment, None)
        _named.pop(self._name, None)


def _log(environment: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    listener = _listeners.get(environment or 0) or _named.get(name or b"")
    if listener is None:  # of somebody else's instance, made by fmpy
        printLogMessage(environment, name, status, category, message)
    else:
        listener(status, (message or b"").decode("utf-8", "replace"))


_logger = fmi2CallbackLoggerTYPE(_log)

"""Calls of an FMU, and what it says in them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import fmi3Fatal, fmi3OK, fmi3Warning

from cosim.errors import CosimError
from fmu.importer.instance import VersionError
from hybrid_model.schedule.blocks import Termination

MESSAGES = 100
"""Most messages of one call that are kept."""


class FmuCalls:
    """Calls the functions of one FMU, and tells in its own words why one failed.

    Parameters
    ----------
    name : str
        Of the slave.

    Attributes
    ----------
    fatal : bool
        Whether a call was fatal; after it no function may be called, the one that frees the instance neither.
    failed : bool
        Whether a call failed; after it the instance may be freed, and not be terminated.
    messages : deque of tuple
        Status and text of what the FMU said in the present call, or in the last.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.messages: deque[tuple[int, str]] = deque(maxlen=MESSAGES)
        self.fatal = self.failed = False

    def hear(self, status: int, text: str) -> None:
        """Take a message of the FMU: its status, and its text."""
        self.messages.append((status, text))

    def __call__(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of fmpy.

        Raises
        ------
        CosimError
            If the FMU answers with an error, with the last message of this call, or does not have the function.
        """
        return self.bound(function)(*arguments)

    def bound(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return what calls a function as `__call__` does, for one who calls it often."""
        messages = self.messages

        def call(*arguments: Any) -> Any:
            if messages:
                messages.clear()
            try:
                return function(*arguments)
            except (FMICallException, VersionError) as error:
                raise self._failure(error) from error

        return call

    def answer(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Do the same with what reads the answer to a call that was made: the messages are those of that call."""
        try:
            return function(*arguments)
        except (FMICallException, VersionError) as error:
            raise self._failure(error) from error

    def _failure(self, error: FMICallException | VersionError) -> CosimError:
        if isinstance(error, VersionError):
            return CosimError(str(error))
        self.failed = True
        self.fatal = self.fatal or error.status == fmi3Fatal
        return CosimError(f"{self._name}: {error.function} failed: {self.said}")

    @property
    def said(self) -> str:
        """The last message."""
        return self.messages[-1][1] if self.messages else "the FMU logged no message"

    def termination(self) -> Termination:
        """Return why the FMU ended the run in its last call.

        FMI has no reason for terminateSimulation, which is no failure by itself; the message that goes with it tells.
        """
        status, text = self.messages[-1] if self.messages else (fmi3OK, "")
        return Termination(text, "Zeno" in text, failed=status > fmi3Warning)

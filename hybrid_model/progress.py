"""How far long work is, on stderr: once a second, and only where it takes more than two."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

__all__ = ["Counted", "Wanted", "duration"]

QUIET, EACH = 2.0, 1.0
"""In s: what takes less tells nothing; time between two lines."""

Wanted = bool | Callable[[int, int], object] | None
"""Whether to tell: by default on a terminal; or who is told, ``told(done, total)``, in place of stderr."""


class Counted:
    """Work of so many pieces of about equal size; in a ``with`` block, at whose end a terminal's line is cleared.

    Parameters
    ----------
    what : str
        What is done, for people.
    total : int
        Number of pieces.
    wanted : bool or callable, optional
        See `Wanted`.
    """

    def __init__(self, what: str, total: int, wanted: Wanted = None) -> None:
        self._what, self._total, self._done = what, total, 0
        self._terminal = sys.stderr.isatty()
        self._wanted = self._terminal if wanted is None else wanted
        self._began = time.monotonic()
        self._next, self._width = self._began + QUIET, 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._width:
            print(f"\r{'':<{self._width}}", end="\r", file=sys.stderr, flush=True)

    def note(self) -> None:
        """One more piece is done."""
        self._done += 1
        if not self._wanted or (now := time.monotonic()) < self._next:
            return
        self._next = now + EACH
        if callable(self._wanted):
            self._wanted(self._done, self._total)
            return
        left = (now - self._began) * (self._total - self._done) / self._done
        line = f"{self._what}: {self._done / self._total:.0%}, about {duration(left)} left"
        if self._terminal:
            print(f"\r{line:<{self._width}}", end="", file=sys.stderr, flush=True)
            self._width = len(line)
        else:
            print(line, file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    """A time in `seconds` as people say it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"

"""How far something is that takes long, and when it will be done: on stderr."""

from __future__ import annotations

import sys
import time
from typing import TextIO

_EACH = 0.2
"""Time in s between two changes of a line on a terminal."""
_EACH_IN_A_FILE = 30.0
"""Time in s between two lines of a log."""


class Eta:
    """A line on stderr that is kept up to date on a terminal; elsewhere a line now and then.

    Parameters
    ----------
    what : str
        What is counted, such as ``"runs"``.
    stream : text stream, optional
        Default: stderr.
    """

    def __init__(self, what: str, stream: TextIO | None = None) -> None:
        self._what = what
        self._stream = stream if stream is not None else sys.stderr
        self._begin: tuple[float, int] | None = None
        self._last = -_EACH_IN_A_FILE
        self._width = 0

    def __call__(self, done: int, total: int) -> None:
        """Tell how many of how many are done."""
        now = time.monotonic()
        if self._begin is None:
            self._begin = now, done
        is_terminal = self._stream.isatty()
        if done < total and now - self._last < (_EACH if is_terminal else _EACH_IN_A_FILE):
            return
        self._last = now
        text = f"  {done}/{total} {self._what}{self._rest(now, done, total)}"
        if is_terminal:
            # What is left of a longer text before is overwritten.
            print(f"\r{text:<{self._width}}", end="\n" if done >= total else "", file=self._stream, flush=True)
            self._width = len(text)
        else:
            print(text, file=self._stream, flush=True)

    def _rest(self, now: float, done: int, total: int) -> str:
        assert self._begin is not None
        begin, known = self._begin
        if done <= known or done >= total:
            return ""
        return f", about {told_duration((total - done) * (now - begin) / (done - known))} left"


def told_duration(seconds: float) -> str:
    """A time in words, to two digits or so."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"

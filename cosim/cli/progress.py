"""How far a command is, and when it will be done: one line on stderr, of a terminal only, that is kept up to date."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType
from typing import Self, TextIO

EACH = 0.2
"""Time in s between two changes of the line."""
QUIET = 2.0
"""What takes less time in s than this has no time left that is worth telling."""


class Work:
    """The work of a command, stage by stage; in a ``with`` block, at whose end the line is cleared.

    Parameters
    ----------
    total : float
        Sum of the weights of its stages; weights are about proportional to the time that stages take.
    stream : text stream, optional
        Default: stderr.
    """

    def __init__(self, total: float = 1.0, stream: TextIO | None = None) -> None:
        self._total = total
        self._stream = stream if stream is not None else sys.stderr
        self._shows = self._stream.isatty()
        self._began = self._stage_began = time.monotonic()
        self._last = -EACH
        # Weights of stages that are done, and of the present one; which part of that is done, if that is known.
        self._done, self._weight, self._part = 0.0, 0.0, 0.0
        self._what, self._detail, self._width = "", "", 0
        self._pace: tuple[float, float] | None = None
        self._lock, self._over = threading.Lock(), threading.Event()
        self._ticker: threading.Thread | None = None

    def __enter__(self) -> Self:
        if self._shows:
            # A stage that says nothing of itself is seen to go on.
            self._ticker = threading.Thread(target=self._tick, daemon=True)
            self._ticker.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        if self._ticker is not None:
            self._ticker.join()
        with self._lock:
            if self._width:
                print(f"\r{'':<{self._width}}", end="\r", file=self._stream, flush=True)
                self._width = 0

    def begin(self, what: str, weight: float = 1.0) -> None:
        """Begin a stage; the one before is done."""
        with self._lock:
            self._done += self._weight
            self._what, self._detail, self._weight, self._part, self._pace = what, "", weight, 0.0, None
            self._stage_began = time.monotonic()
            self._show(at_once=True)

    def say(self, what: str) -> None:
        """Say what is done within a stage."""
        with self._lock:
            self._what = what
            self._show(at_once=True)

    def part(self, part: float, detail: str = "") -> None:
        """Tell which part of the stage is done, from 0 to 1."""
        if not self._shows:  # of a run's every row, which may be a million
            return
        with self._lock:
            if self._pace is None:
                # What was done already when somebody goes on with a sweep is no pace.
                self._pace = time.monotonic(), part
            self._part, self._detail = min(max(part, 0.0), 1.0), detail
            self._show()

    def __call__(self, done: int, total: int) -> None:
        """Tell how many of how many of what the stage counts are done."""
        self.part(done / total if total else 1.0, f"{done}/{total}")

    def _tick(self) -> None:
        while not self._over.wait(1.0):
            with self._lock:
                self._show()

    def _show(self, *, at_once: bool = False) -> None:
        now = time.monotonic()
        if not self._shows or not self._what or (now - self._last < EACH and not at_once):
            return
        self._last = now
        spent = now - self._began
        told = ", ".join(filter(None, [self._what, self._detail, self._time(now) if spent > QUIET else ""]))
        text = f"  {told} ..."
        # What is left of a longer text before is overwritten.
        print(f"\r{text:<{self._width}}", end="", file=self._stream, flush=True)
        self._width = len(text)

    def _time(self, now: float) -> str:
        if self._pace is not None and self._total <= self._weight:
            begin, known = self._pace
            if known < self._part < 1.0:
                return f"about {told_duration((1.0 - self._part) * (now - begin) / (self._part - known))} left"
        done = self._done + self._weight * self._part
        if 0.0 < done < self._total:
            return f"about {told_duration((self._total - done) * (now - self._began) / done)} left"
        return told_duration(now - self._stage_began)


def told_duration(seconds: float) -> str:
    """A time in words, to two digits or so."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"

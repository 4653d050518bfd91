"""How far a long run is, on stderr: at most once a second."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from hybrid_model.progress import duration

Told = bool | Callable[[float, int], None]


class Progress:
    """Tells the time of a run, its events, and when it will end at the present pace.

    Parameters
    ----------
    span : (float, float)
        Of the run, in s.
    wanted : bool or callable
        Whether to tell anything; or who is told, ``told(t, events)``, in place of stderr.
    every : float
        In s of the clock.
    """

    def __init__(self, span: tuple[float, float], *, wanted: Told, every: float = 1.0) -> None:
        self._span, self._wanted, self._every = span, wanted, every
        self._began = self._told = time.monotonic()
        self._events = 0

    def note(self, t: float, events: int) -> None:
        """So many more events have happened, up to `t` in s."""
        self._events += events
        if callable(self._wanted):
            self._wanted(t, self._events)
            return
        now = time.monotonic()
        if not self._wanted or now - self._told < self._every:
            return
        self._told, spent = now, now - self._began
        start, end = self._span
        done = (t - start) / (end - start) if end > start else 1.0
        left = f", about {duration(spent * (1.0 - done) / done)} left" if done > 0.0 else ""
        print(
            f"t = {t:.6g} of {end:.6g} s: {self._events} events, {self._events / spent:.3g} a second{left}",
            file=sys.stderr,
            flush=True,
        )

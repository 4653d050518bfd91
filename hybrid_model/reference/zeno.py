"""Zeno guard: recognise jumps that accumulate, and say when and why."""

from __future__ import annotations

import itertools
import math
import numbers
from collections import deque
from dataclasses import dataclass
from typing import Any

from hybrid_model.errors import SimulationError
from hybrid_model.scales import ACCUMULATION, CHATTER, CROWD, PAUSE, RESOLVED, ulp

HISTORY = 12
GAPS = 8
"""Ratios of successive gaps are compared over this many gaps: enough to tell geometric shrinking from chance."""


@dataclass(frozen=True)
class ZenoGuard:
    """What counts as an accumulation of jumps (semantics: rules 7 and 8).

    Each jump is counted by itself: many agents that broadcast together are no Zeno. Jumps at known times are bounded
    at one instant only: their times are the author's own, and move on.

    Attributes
    ----------
    jumps_at_once : int
        More jumps of one name than this at one instant end the run.
    window : float, optional
        In s; `jumps_in_window` jumps of one name within it end the run. Default: a millionth of the longest gap since
        the last pause, or gaps that floats at that time do not resolve.
    jumps_in_window : int
        See `window`.
    remainder : float, optional
        In s; jumps whose gaps shrink geometrically end the run when the time left to the accumulation point, by the
        sum of the geometric series, is below this (or below what floats at that time resolve well enough). Default:
        a millionth of the longest of the gaps that shrink.
    spread : float
        Relative spread up to which successive ratios of gaps count as one.
    max_jumps : int
        More jumps than this, of all names together, end the run with `Stop.JUMPS`: events that grow ever denser
        without accumulating (a threshold that decays faster than the states converge) have no other end.

    Raises
    ------
    SimulationError
        If a count is not a whole number from 1 on, or another limit is negative or not finite.
    """

    jumps_at_once: int = 1000
    window: float | None = None
    jumps_in_window: int = 100
    remainder: float | None = None
    spread: float = 0.05
    max_jumps: int = 100_000

    def __post_init__(self) -> None:
        for name in ("jumps_at_once", "jumps_in_window", "max_jumps"):
            count = getattr(self, name)
            if not (_finite(count) and count >= 1 and count == int(count)):
                raise SimulationError(f"ZenoGuard option {name} = {count!r}: give a whole number of jumps, 1 or more.")
            # A whole number may come as a float, as in 1e6.
            object.__setattr__(self, name, int(count))
        for name in ("window", "remainder", "spread"):
            limit = getattr(self, name)
            if limit is None and name != "spread":
                continue
            if not (_finite(limit) and limit >= 0.0):
                raise SimulationError(f"ZenoGuard option {name} = {limit!r}: give a finite number, 0 or more.")


def _finite(value: Any) -> bool:
    return isinstance(value, numbers.Real) and math.isfinite(value)


class ZenoMonitor:
    """Watches the jumps of one run.

    Parameters
    ----------
    guard : ZenoGuard
        The limits.
    """

    def __init__(self, guard: ZenoGuard) -> None:
        self.guard = guard
        self._recent: dict[str, deque[float]] = {}
        self._total: dict[str, int] = {}
        self._at_once: dict[str, tuple[float, int]] = {}
        self._longest: dict[str, float] = {}
        self._shrinking_from: dict[str, float] = {}

    def record(self, automaton: str, jump: str, t: float, *, on_state: bool = True) -> str | None:
        """Count a jump at time `t`.

        Parameters
        ----------
        automaton, jump : str
            Names, for the message.
        t : float
            Time in s.
        on_state : bool
            Whether a state margin triggered it; jumps at known times are counted at one instant only.

        Returns
        -------
        str or None
            The message, if the run must end.
        """
        self._total[jump] = self._total.get(jump, 0) + 1
        last, count = self._at_once.get(jump, (t, 0))
        count = count + 1 if t == last else 1
        self._at_once[jump] = (t, count)
        if count > self.guard.jumps_at_once and not on_state:
            return (
                f"{automaton}: {count} jumps of {jump!r} at one instant, t = {t:.9g} s: its time is still not after "
                "the present. Let the jump map move the time on past it; where a run starts later than its clock, "
                "declare the clock's state with computed=True and let start_map give the next time to come."
            )
        if count > self.guard.jumps_at_once:
            return (
                f"{automaton}: {count} jumps of {jump!r} at one instant, t = {t:.9g} s: after the jump the state is "
                "still in the jump set. Make the jump map leave the jump set, or let the margin be negative there "
                "(a threshold that is zero together with its error fires for ever; so does a set given as 0 outside "
                "and 1 inside, because zero is inside)."
            )
        if not on_state:
            return None
        recent = self._recent.setdefault(jump, deque(maxlen=max(HISTORY, self.guard.jumps_in_window)))
        self._measure(jump, recent, t)
        recent.append(t)
        return self._crowded(automaton, jump, recent) or self._geometric(automaton, jump, recent)

    def _measure(self, jump: str, recent: deque[float], t: float) -> None:
        """Keep the longest gap between jumps of a name, and the first one of those that shrink."""
        if not recent or t == recent[-1]:
            return
        gap = t - recent[-1]
        before = recent[-1] - recent[-2] if len(recent) > 1 else math.inf
        after_pause = gap < PAUSE * before
        self._longest[jump] = gap if after_pause else max(self._longest.get(jump, 0.0), gap)
        if after_pause or not gap < before:
            self._shrinking_from[jump] = gap
        self._shrinking_from.setdefault(jump, gap)

    def _crowded(self, automaton: str, jump: str, recent: deque[float]) -> str | None:
        n = self.guard.jumps_in_window
        if len(recent) < n or recent[-1] == recent[-n]:
            return None  # a cascade at one instant has its own, larger budget
        span = recent[-1] - recent[-n]
        if self.guard.window is not None:
            crowded = span <= self.guard.window
        else:
            crowded = span <= max(CROWD * self._longest[jump], n * CHATTER * ulp(recent[-1]))
        if not crowded:
            return None
        return (
            f"{automaton}: {n} jumps of {jump!r} in {recent[-1] - recent[-n]:.2g} s around t = {recent[-1]:.12g} s: "
            "jumps accumulate there. End the run before, or give the jump set a minimum dwell time."
        )

    def _geometric(self, automaton: str, jump: str, recent: deque[float]) -> str | None:
        if len(recent) < GAPS + 1:
            return None
        times = list(recent)[-(GAPS + 1) :]
        gaps = [b - a for a, b in itertools.pairwise(times)]
        if min(gaps) <= 0.0:
            return None
        ratios = [b / a for a, b in itertools.pairwise(gaps)]
        ratio = ratios[-1]
        if max(ratios) >= 1.0 or max(ratios) - min(ratios) > self.guard.spread * ratio:
            return None
        left = gaps[-1] * ratio / (1.0 - ratio)
        remainder = self.guard.remainder
        if remainder is None:
            remainder = ACCUMULATION * self._shrinking_from[jump]
        if left > max(remainder, RESOLVED * ulp(times[-1])):
            return None
        return (
            f"{automaton}: {self._total[jump]} jumps of {jump!r} accumulate at t = {times[-1] + left:.12g} s (the last "
            f"gap was {gaps[-1]:.2g} s, each {ratio:.3f} times the one before). End the run before that time, or give "
            "the jump set a minimum dwell time."
        )

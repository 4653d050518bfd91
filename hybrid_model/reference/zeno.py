"""Zeno guard: recognise jumps that accumulate, and say when and why.

The C engine of exported FMUs (hybrid_model/engine/zeno.c) decides in the same way.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass, field

from hybrid_model import scales
from hybrid_model.scales import ulp
from hybrid_model.zeno_guard import ZenoGuard

RECENT = 32
"""So many of the last jumps at one instant are kept, to name those that enable each other."""
GAPS = 8
"""Ratios of successive gaps are compared over this many gaps: enough to tell geometric shrinking from chance."""


@dataclass
class _History:
    """What is kept of the jumps of one name: their last times that differ, and what follows from all of them."""

    times: deque[float] = field(default_factory=lambda: deque(maxlen=GAPS + 1))
    total: int = 0
    at_once: int = 0
    longest: float = 0.0
    shrinking_from: float = math.inf
    burst: int = 0
    burst_start: float = 0.0

    def add(self, t: float, burst_size: int) -> None:
        """Count a jump at time `t`; those at one instant count once among the gaps and bursts."""
        self.total += 1
        self.at_once += 1
        if self.times and t == self.times[-1]:
            return
        self.at_once = 1
        if self.times:
            self._measure(t - self.times[-1])
        self.times.append(t)
        if self.burst == 0 or self.burst >= burst_size:
            self.burst, self.burst_start = 0, t
        self.burst += 1

    def _measure(self, gap: float) -> None:
        """Keep the longest gap since the last pause, and the first one of those that shrink."""
        before = self.times[-1] - self.times[-2] if len(self.times) > 1 else 0.0
        after_pause = gap < scales.PAUSE * before
        self.longest = gap if after_pause else max(self.longest, gap)
        if after_pause or not gap < before:
            self.shrinking_from = gap

    def shrinking(self, spread: float) -> tuple[float, float] | None:
        """Return the last gap and the ratio of those before it, if the last ones shrink like a geometric sequence."""
        if len(self.times) <= GAPS:
            return None
        gaps = [b - a for a, b in itertools.pairwise(self.times)]
        ratios = [b / a for a, b in itertools.pairwise(gaps)]
        if max(ratios) >= 1.0 or max(ratios) - min(ratios) > spread * ratios[-1]:
            return None
        return gaps[-1], ratios[-1]


class ZenoMonitor:
    """Watches the jumps of one run.

    Parameters
    ----------
    guard : ZenoGuard
        The limits.
    """

    def __init__(self, guard: ZenoGuard) -> None:
        self.guard = guard
        self._histories: dict[str, _History] = {}
        self._recent: deque[str] = deque(maxlen=min(RECENT, guard.jumps_at_once + 1))
        self._instant = math.nan

    def record(self, jump: str, t: float, *, on_state: bool = True) -> str | None:
        """Count a jump at time `t`.

        Parameters
        ----------
        jump : str
            Its name.
        t : float
            Time in s.
        on_state : bool
            Whether a state margin triggered it; jumps at known times are counted at one instant only.

        Returns
        -------
        str or None
            The message, if the run must end.
        """
        history = self._histories.setdefault(jump, _History())
        history.add(t, self.guard.jumps_in_window)
        if t != self._instant:
            self._recent.clear()
        self._instant = t
        self._recent.append(jump)
        if history.at_once > self.guard.jumps_at_once:
            others = self._in_turn_with(jump)
            remedy = _IN_TURN if others else _STILL_ENABLED if on_state else _STILL_DUE
            return f"Zeno: {history.at_once} jumps of {jump!r} at one instant, t = {t:.9g} s{others}: {remedy}"
        if not on_state:
            return None
        return self._geometric(jump, history, t) or self._crowded(jump, history, t)

    def _in_turn_with(self, jump: str) -> str:
        """Name the other jumps that were taken last at this instant, in the order in which they follow `jump`."""
        others = list(dict.fromkeys(name for name in reversed(self._recent) if name != jump))[::-1]
        return ", in turn with " + ", ".join(map(repr, others)) if others else ""

    def _geometric(self, jump: str, history: _History, t: float) -> str | None:
        shrinking = history.shrinking(self.guard.spread)
        if shrinking is None:
            return None
        gap, ratio = shrinking
        left, remainder = gap * ratio / (1.0 - ratio), self.guard.remainder
        if remainder is None:
            remainder = scales.ACCUMULATION * history.shrinking_from
        if left > max(remainder, scales.RESOLVED * ulp(t)):
            return None
        return (
            f"Zeno: {history.total} jumps of {jump!r} accumulate at t = {t + left:.12g} s (the last gap was {gap:.2g} "
            f"s, each {ratio:.3f} times the one before). End the run before that time, or give the jump set a minimum "
            "dwell time."
        )

    def _crowded(self, jump: str, history: _History, t: float) -> str | None:
        n, span, window = self.guard.jumps_in_window, t - history.burst_start, self.guard.window
        if window is None:
            window = max(scales.CROWD * history.longest, n * scales.CHATTER * ulp(t))
        if history.burst < n or span > window:
            return None
        return (
            f"Zeno: {n} jumps of {jump!r} in {span:.2g} s around t = {t:.12g} s: jumps accumulate there. End the run "
            "before, or give the jump set a minimum dwell time."
        )


_IN_TURN = (
    "they enable each other. Make the jump map of one of them leave the jump sets of the others (a margin of zero is "
    "inside), or move its time on past the present."
)
_STILL_DUE = (
    "its time is still not after the present. Let the jump map move the time on past it; where a run starts later than "
    "its clock, declare the clock's state with computed=True and let start_map give the next time to come."
)
_STILL_ENABLED = (
    "after the jump the state is still in the jump set, or what other parts send at that instant brings it back. Make "
    "the jump map leave the jump set, or let the margin be negative there (a threshold that is zero together with its "
    "error fires for ever; so does a set given as 0 outside and 1 inside, because zero is inside)."
)

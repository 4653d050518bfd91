"""Where steps are to end while an event is enclosed: at the time that a slave has told, or in the middle."""

from __future__ import annotations

import math

NEAR = 1e-3
"""Part of a step by which an event may be off that a slave has told in it, having had inputs that stood still."""
WIDER = 30.0
"""So many times as far off it is looked for if it was not there."""
INSIDE = 0.05
"""What is told in this part of a step, the first, says nothing: it is the inputs of that step that brought it about."""
CALM = 3
"""After so many steps in a row to a middle, with nothing in them, it is looked whether there is anything at all."""


class Enclosure:
    """The time before which some slave has its event, and what is known of where.

    A slave whose inputs change continuously has its event elsewhere than in a step in which they stand still. The
    shorter that step, the less: where the slave has told of a time, steps end just before it and just after, which
    takes some four of them; else they are halved, which takes some forty.

    Parameters
    ----------
    resolution : float
        In s: shorter steps tell nothing.
    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.forget()

    def forget(self) -> None:
        """There is nothing to enclose."""
        self._end, self._near, self._margin, self._calm = math.inf, math.nan, 0.0, 0

    @property
    def active(self) -> bool:
        """Whether there is something to enclose."""
        return self._end < math.inf

    def aim(self, t: float, end: float) -> float:
        """Return where a step from `t` on is to end that would go to `end`, in s."""
        if not self.active:
            return end
        target = self._end
        if target - t > 2.0 * self._resolution:
            if not math.isnan(self._near):
                before = self._near - self._margin
                target = before if before > t + self._resolution else min(self._near + self._margin, target)
            elif self._calm < CALM:
                target = 0.5 * (t + target)
        return min(target, end)

    def missed(self, t: float, end: float, told: float | None) -> None:
        """Note that an event is in a step from `t` to `end`, and where a slave has told of it, if one has, in s."""
        margin = max(NEAR * (end - t), 2.0 * self._resolution)
        if not math.isnan(self._near) and end <= self._near:
            margin = max(margin, WIDER * self._margin)
        self._end, self._calm, self._near = end, 0, math.nan
        if told is not None and t + INSIDE * (end - t) < told <= end and margin < 0.25 * (end - t):
            self._near, self._margin = told, margin

    def passed(self, t: float) -> None:
        """Note that nothing was in a step to `t` in s."""
        if t >= self._end:
            self.forget()
        elif math.isnan(self._near):
            self._calm = 0 if self._calm >= CALM else self._calm + 1
        elif t >= self._near + self._margin:
            self._near, self._margin = t, WIDER * self._margin

"""What counts as an accumulation of jumps: the options of the Zeno guard, for both engines."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

from hybrid_model import scales
from hybrid_model.errors import SimulationError


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

    jumps_at_once: int = scales.JUMPS_AT_ONCE
    window: float | None = None
    jumps_in_window: int = scales.JUMPS_IN_WINDOW
    remainder: float | None = None
    spread: float = scales.SPREAD
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

"""The channel between agents as checked data: delay, and loss with its seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hybrid_model.consensus.messages import ScenarioError, shown

__all__ = ["IDEAL", "Channel"]

SEED_LIMIT = 2**31 - 1
MOST_SLOTS = 1000


@dataclass(frozen=True)
class Channel:
    """What happens to a broadcast on its way to each neighbour.

    Parameters
    ----------
    delay : float
        Time from a broadcast to its reception, the same on all links [s].
    loss : float
        Probability that a broadcast is lost on a link, on each link on its own; below 1.
    seed : int
        Fixes which broadcasts are lost; the same in every execution.
    slots : int
        Broadcasts that may be under way on a link at once; a delay below the shortest time between two broadcasts of
        an agent needs one; at most 1000.

    Raises
    ------
    ScenarioError
        If a number is out of range.
    """

    delay: float = 0.0
    loss: float = 0.0
    seed: int = 0
    slots: int = 4

    def __post_init__(self) -> None:
        """Check the values."""
        if not (math.isfinite(self.delay) and self.delay >= 0):
            raise ScenarioError(f"[channel] delay is {self.delay}; it must be a finite time that is not negative.")
        if not 0 <= self.loss < 1:
            raise ScenarioError(f"[channel] loss is {self.loss}; it must be a probability from 0 to below 1.")
        if not 0 <= self.seed < SEED_LIMIT:
            raise ScenarioError(
                f"[channel] seed is {shown(self.seed)}; it must be a whole number from 0 to {SEED_LIMIT - 1}."
            )
        if not 1 <= self.slots <= MOST_SLOTS:
            raise ScenarioError(
                f"[channel] slots is {shown(self.slots)}; it must be at least 1 and at most {MOST_SLOTS}."
            )

    @property
    def ideal(self) -> bool:
        """Whether every broadcast arrives at its own instant."""
        return self.delay == 0 and self.loss == 0


IDEAL = Channel()

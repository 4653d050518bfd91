"""What a run sends: broadcasts, messages, and the gaps between two broadcasts of one agent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.laws.closed_loop import edges_of
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["Communication", "GapStatistics", "communication", "gap_statistics"]

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class GapStatistics:
    """Times between two successive broadcasts of one agent, all agents together.

    Attributes
    ----------
    gaps : ndarray
        All of them [s], ascending.
    """

    gaps: NDArray[np.float64]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.gaps)

    @property
    def min(self) -> float | None:
        """Shortest [s]; None if there is none."""
        return float(self.gaps[0]) if self.count else None

    @property
    def mean(self) -> float | None:
        """Mean [s]; None if there is none."""
        return float(np.mean(self.gaps)) if self.count else None

    def quantiles(self, shares: Sequence[float] = _QUANTILES) -> dict[float, float]:
        """Share -> gap [s] that this share of the gaps does not exceed, by linear interpolation; empty without gaps."""
        return {share: float(np.quantile(self.gaps, share)) for share in shares} if self.count else {}

    def histogram(self, bins: int = 20) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Counts, shape (bins,), and their limits [s], shape (bins + 1,), a constant factor apart.

        Raises
        ------
        ValueError
            If there is no gap, or one is zero.
        """
        if not self.count or self.gaps[0] <= 0:
            what = "there is none" if not self.count else "one is zero"
            raise ValueError(f"a histogram with logarithmic classes needs positive gaps between broadcasts; {what}.")
        low, high = self.gaps[0], self.gaps[-1]
        limits = np.geomspace(low, high, bins + 1) if high > low else np.geomspace(low / 2, high * 2, bins + 1)
        # Rounding must not put the extreme gaps outside.
        limits[[0, -1]] = min(limits[0], low), max(limits[-1], high)
        return np.histogram(self.gaps, limits)[0], limits


def gap_statistics(event_times: Sequence[ArrayLike]) -> GapStatistics:
    """Gaps of several agents; `event_times` are the times [s] of each one's broadcasts, without that at the start."""
    rows = [np.diff(np.asarray(times, dtype=float)) for times in event_times]
    return GapStatistics(np.sort(np.concatenate([np.empty(0), *rows])))


@dataclass(frozen=True, eq=False)
class Communication:
    """What a run sends.

    Attributes
    ----------
    broadcasts : list of int
        Of each agent, without the one at the start.
    link_messages : list of int
        Of each agent: one message for each neighbour at each broadcast, over all edges that can carry weight.
    active_messages : list of int
        The same over the edges that are switched on at the time. A neighbour that is not reached then still needs the
        value when the edge comes back, so this is what must be sent later at the least.
    duration : float
        Of the run [s].
    """

    broadcasts: list[int]
    link_messages: list[int]
    active_messages: list[int]
    duration: float

    @property
    def rate(self) -> float:
        """Mean number of broadcasts of an agent per second."""
        return sum(self.broadcasts) / len(self.broadcasts) / self.duration


def communication(scenario: Scenario, event_times: Sequence[ArrayLike], duration: float | None = None) -> Communication:
    """Count broadcasts and messages.

    Parameters
    ----------
    scenario : Scenario
        Network and switching.
    event_times : sequence of array_like, each of shape (events,)
        Times [s] of each agent's broadcasts, as in `RunReport.event_times`.
    duration : float, optional
        Of the run [s]; the stop time by default.

    Raises
    ------
    ValueError
        If there is not one row of times for each agent.
    """
    n = scenario.network.agents
    if len(event_times) != n:
        raise ValueError(f"{len(event_times)} rows of broadcast times for {n} agents; give one row an agent.")
    broadcasts, links, active = [], [], []
    masks: dict[int, NDArray[np.bool_]] = {}

    def present(t: float) -> NDArray[np.bool_]:
        phase = scenario.switching.phase(t)
        if phase not in masks:
            masks[phase] = scenario.switching.active_at(t)
        return masks[phase]

    for agent, row in enumerate(event_times, start=1):
        times, edges = np.asarray(row, dtype=float), edges_of(scenario, agent)
        broadcasts.append(len(times))
        links.append(len(times) * len(edges))
        active.append(sum(int(np.count_nonzero(present(t)[edges])) for t in times.tolist()))
    return Communication(broadcasts, links, active, scenario.stop_time if duration is None else duration)

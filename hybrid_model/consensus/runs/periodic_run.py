"""Exact runs with periodic broadcasts: what event-triggered runs are measured against.

All agents broadcast at the times ``m h``, so between two of them ``x(t) = x(m h) - k L(m h, t) x(m h)`` with the
Laplacian of the integrated weights: no integration, no search for events. The trigger ``periodic`` runs the same law as
an automaton; this form is for the many runs that a comparison needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["PeriodicRun", "periodic_run", "slow_gain"]


@dataclass(frozen=True, eq=False)
class PeriodicRun:
    """States at the broadcasts; between them, `at`.

    Attributes
    ----------
    scenario : Scenario
        Network, weights and switching; its trigger plays no part.
    times : ndarray, shape (m + 1,)
        Times of the broadcasts [s], the first at 0.
    states : ndarray, shape (m + 1, n)
        States there.
    """

    scenario: Scenario
    times: NDArray[np.float64]
    states: NDArray[np.float64]

    @property
    def broadcasts(self) -> int:
        """Broadcasts of each agent up to the stop time, without the one at the start."""
        return len(self.times) - 1

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """States, shape (n, times), at times [s] between 0 and the stop time."""
        when = np.asarray(t, dtype=float)
        place = np.clip(np.searchsorted(self.times, when, side="right") - 1, 0, len(self.times) - 1)
        return _moved(self.scenario, self.states[place], self.times[place], when).T


def slow_gain(scenario: Scenario, period: float) -> float:
    """The gain that suits a period of broadcasts, at most the scenario's own.

    With a constant Laplacian, ``2/((l_2 + l_n) h)`` lets disagreement fall fastest per broadcast; here the eigenvalues
    are those of the Laplacian's mean over the run. The gain of a law with continuous or frequent broadcasts overshoots
    when the same law is sampled slowly, which says nothing about periodic broadcasting.
    """
    network = scenario.network
    mean = scenario.edge_weights.integral(0.0, scenario.stop_time) / scenario.stop_time
    D = incidence(network.agents, network.edges)
    spectrum = np.linalg.eigvalsh((D * mean) @ D.T)
    total = float(spectrum[1] + spectrum[-1])
    return network.gain if total <= 0 else min(network.gain, 2 / (total * period))


def periodic_run(scenario: Scenario, period: float) -> PeriodicRun:
    """Run a scenario with a broadcast of every agent each `period` [s].

    Raises
    ------
    ValueError
        If the period is not positive.
    """
    if not (np.isfinite(period) and period > 0):
        raise ValueError(f"the period of the broadcasts is {period} s; it must be a positive number.")
    # A broadcast at the stop time counts, also where rounding puts it just behind.
    count = int(np.floor(scenario.stop_time / period * (1 + 1e-12)))
    times = np.minimum(np.arange(count + 1) * period, scenario.stop_time)
    network = scenario.network
    doses = scenario.edge_weights.integral(times[:-1], times[1:]) if count else np.empty((0, len(network.edges)))
    D = incidence(network.agents, network.edges)
    states = [np.asarray(network.initial, dtype=float)]
    for dose in doses:
        states.append(states[-1] - network.gain * (D @ (dose * (D.T @ states[-1]))))
    return PeriodicRun(scenario, times, np.array(states))


def _moved(
    scenario: Scenario, states: NDArray[np.float64], begin: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    network = scenario.network
    D = incidence(network.agents, network.edges)
    dose = scenario.edge_weights.integral(begin, end)
    return np.asarray(states - network.gain * ((dose * (states @ D)) @ D.T))

"""The exact worst case: how large disagreement can get under all errors that the trigger admits (audit, section 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.flow_cells import dose_between
from hybrid_model.consensus.graphs import disagreement_basis
from hybrid_model.consensus.reachable_sets import ReachableSets
from hybrid_model.consensus.scenario_data import Scenario

__all__ = ["WorstCase", "starting_directions", "worst_case"]

_STARTS, _MOST_STARTS = 6, 1024
"""Random directions: the first, doubled for each agent, but no more than the second."""

_PATIENCE = 3
_KEPT = 12
_MOST_SECOND = 50
_FEW = 8
_COARSE = 0.05
_FEW_CELLS = 1500
_ROUGH = 1e-3
_MOST_ROUGH = 200
_PROMISING = 10
_FINALISTS = 3
_MOST_STEPS = 200


@dataclass(frozen=True)
class WorstCase:
    """Suprema over all admissible errors with threshold ``c exp(-beta t)``; all scale with c.

    Attributes
    ----------
    radius : float
        ``sup limsup exp(beta t) ||x_e(t)||`` over the underlying graph, in the unit of the states.
    pairs : dict
        ``(i, j)`` of each listed edge -> ``sup limsup exp(beta t) |x_i - x_j|``.
    time : float
        Where in the period [s] the radius is attained.
    resolution : float
        ``k int ||N||`` over a cell of the grid in use. The numbers are reached from below; what they lack is a share
        of the order of the square of this (measured: a hundredth of it, for weights that oscillate fast up to once).
    """

    radius: float
    pairs: dict[tuple[int, int], float]
    time: float
    resolution: float

    @property
    def cover(self) -> float:
        """A factor, just above 1, by which the numbers are raised where a bound is made of them."""
        return 1 + 4 * self.resolution**2


def worst_case(
    scenario: Scenario,
    period: float,
    decay: float,
    resolution: float = 0.01,
    *,
    periodic: bool = True,
    threshold: float | None = None,
) -> WorstCase:
    """Suprema over all admissible errors; parameters as `ReachableSets`, c by default that of the scenario.

    Notes
    -----
    The time in the period and the starting directions are searched on a coarse grid; the best ones are followed on the
    fine grid. A maximum is reached from below, so a narrower one that the search misses would make the number small.
    """
    network = scenario.network
    if periodic and scenario.edge_weights.period == 0.0:
        # Any period will do for constant weights: one in which the fastest mode is seen, however slow the others are.
        period = min(period, 1 / dose_between(scenario, 0.0, 1.0))
    coarse = ReachableSets(scenario, period, decay, max(resolution, _COARSE), periodic=periodic, most=_FEW_CELLS)
    fine = coarse
    if resolution < coarse.resolution:
        fine = ReachableSets(scenario, period, decay, resolution, periodic=periodic)
    starts = starting_directions(network.agents)
    indices = coarse.candidates(scenario)
    basis = disagreement_basis(network.agents)
    pairs = np.stack([basis[i - 1] - basis[j - 1] for i, j in network.edges], axis=1)

    # A first look at every time; then from the farthest points found there; then from everywhere at the best times.
    look = np.hstack((pairs, starts[:, :_FEW]))
    looks = [coarse.support(int(index), look, _ROUGH) for index in indices]
    widths = np.stack([values[: pairs.shape[1]] for values, _ in looks])
    norms = np.stack([coarse.norms(points) for _, points in looks])
    rough = {}
    for place in np.argsort(-norms.max(axis=1))[:_MOST_ROUGH].tolist():
        farthest = looks[place][1][:, np.argsort(-norms[place])[:_FEW]]
        rough[place] = coarse.radius(int(indices[place]), farthest, _ROUGH)
    times = np.append(coarse.times[indices], period)
    promising = sorted(rough, key=lambda place: -rough[place][0])[:_PROMISING]
    peaks = {k: _refine(coarse, times, k, _length(coarse, rough[k][1]))[0] for k in promising}
    finalists = sorted(promising, key=lambda place: -peaks[place])[:_FINALISTS]
    pool = np.hstack([starts, *(rough[place][1] for place in finalists)])
    trials = [coarse.radius(int(indices[place]), pool, _ROUGH, _PATIENCE)[1][:, :_KEPT] for place in finalists]
    # What is found from everywhere at the best times is tried at the others.
    pool = np.hstack(trials)
    second = sorted(rough, key=lambda place: -rough[place][0])[:_MOST_SECOND]
    again = {place: coarse.radius(int(indices[place]), pool, _ROUGH) for place in second}
    finalists = sorted(second, key=lambda place: -again[place][0])[:_FINALISTS]
    tried = {place: _refine(fine, times, place, _length(fine, again[place][1])) for place in finalists}
    radius, time = max(tried.values())
    threshold = scenario.trigger.threshold if threshold is None else threshold
    found = {}
    for column, pair in enumerate(network.edges):
        along = pairs[:, column : column + 1]
        places = np.argsort(-widths[:, column])[:_FINALISTS].tolist()
        found[pair] = threshold * max(_refine(fine, times, place, _width(fine, along))[0] for place in places)
    return WorstCase(threshold * radius, found, time, fine.resolution)


def _length(sets: ReachableSets, direction: NDArray[np.float64]) -> Callable[[int], float]:
    return lambda index: sets.radius(index, direction[:, :1])[0]


def _width(sets: ReachableSets, along: NDArray[np.float64]) -> Callable[[int], float]:
    return lambda index: float(sets.support(index, along)[0][0])


def _refine(
    sets: ReachableSets, times: NDArray[np.float64], best: int, value: Callable[[int], float]
) -> tuple[float, float]:
    """Largest `value` over the grid between the candidates before and after `best`, and its time [s]."""
    count = len(sets.times)
    around = times[[max(best - 1, 0), best, best + 1]]
    low, middle, high = (int(np.searchsorted(sets.times, t * (1 - 1e-12))) for t in around)
    known = {index: value(index % count) for index in {low, middle, high}}
    while high - low > 2:
        inner = {(low + middle) // 2, middle, (middle + high) // 2}
        known |= {index: value(index % count) for index in inner - known.keys()}
        top = max(sorted(inner | {low, high}), key=lambda index: known[index])
        ordered = sorted(inner | {low, high})
        place = ordered.index(top)
        low, middle, high = ordered[max(place - 1, 0)], top, ordered[min(place + 1, len(ordered) - 1)]
        if (middle - low <= 1 and high - middle <= 1) or len(known) > _MOST_STEPS:
            break
    index = max(known, key=lambda at: known[at])
    return known[index], float(sets.times[index % count])


def starting_directions(agents: int) -> NDArray[np.float64]:
    """Directions, shape (n - 1, count), from which extreme points are searched: pairs of agents, and random ones."""
    basis = disagreement_basis(agents)
    pairs = [basis[i] - basis[j] for i in range(agents) for j in range(i)]
    # The number of local maxima grows about so with the number of agents.
    count = min(_MOST_STARTS, _STARTS * 2 ** min(agents, 10))
    random = np.random.default_rng(2018).standard_normal((count, agents - 1))
    ordered = [*random[:_FEW], *pairs, *random[_FEW:]]
    return np.stack(ordered, axis=1)

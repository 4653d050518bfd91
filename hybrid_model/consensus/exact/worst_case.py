"""The exact worst case: how large disagreement can get under all errors that the trigger admits (audit, section 7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.exact.reachable_sets import ReachableSets
from hybrid_model.consensus.exact.transition_grid import dose_between
from hybrid_model.consensus.graphs.undirected import disagreement_basis
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["WorstCase", "starting_directions", "worst_case"]

_LEAST_STARTS, _STARTS, _START_WORK = 48, 6, 65536
"""Random directions: the second, doubled for each agent, but not so many that all of them cost more than the third by
the square of the number of agents; the first at the least."""

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

_Found: TypeAlias = tuple[float, NDArray[np.float64]]
"""A norm, and directions, the farthest first."""


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
    basis = disagreement_basis(network.agents)
    pairs = np.stack([basis[i - 1] - basis[j - 1] for i, j in network.edges], axis=1)
    search = _Search(coarse, fine, coarse.candidates(scenario), period, pairs, starting_directions(network.agents))
    threshold = scenario.trigger.threshold if threshold is None else threshold
    radius, time = search.radius()
    widths = {pair: threshold * search.width(column) for column, pair in enumerate(network.edges)}
    return WorstCase(threshold * radius, widths, time, fine.resolution)


class _Search:
    """Suprema over times and directions: many of both on the coarse grid, the best of them on the fine one.

    Candidate times are known by their places among `indices`. Norms are looked at from a few directions at every time;
    then from the farthest points found there; then from everywhere at the best times; and what is found there is tried
    at the other times.
    """

    def __init__(
        self,
        coarse: ReachableSets,
        fine: ReachableSets,
        indices: NDArray[np.intp],
        period: float,
        pairs: NDArray[np.float64],
        starts: NDArray[np.float64],
    ) -> None:
        self._coarse, self._fine, self._pairs, self._starts = coarse, fine, pairs, starts
        self._indices = [int(index) for index in indices]
        self._times = np.append(coarse.times[indices], period)
        look = np.hstack((pairs, starts[:, :_FEW]))
        looks = [coarse.support(index, look, _ROUGH) for index in self._indices]
        self._widths = np.stack([values[: pairs.shape[1]] for values, _ in looks])
        self._points = [points for _, points in looks]

    def radius(self) -> tuple[float, float]:
        """Largest norm and its time [s]."""
        rough = self._rough()
        ranked = _best(rough, len(rough))
        peaks = {
            place: (self._peak(self._coarse, place, rough[place][1]), rough[place][1]) for place in ranked[:_PROMISING]
        }
        pool = self._everywhere(_best(peaks, _FINALISTS), rough)
        again = {place: self._from(place, pool) for place in ranked[:_MOST_SECOND]}
        return max(self._peak(self._fine, place, again[place][1]) for place in _best(again, _FINALISTS))

    def width(self, column: int) -> float:
        """Largest distance of a pair; along its one direction only the time is searched."""
        along = self._pairs[:, column : column + 1]
        places = np.argsort(-self._widths[:, column])[:_FINALISTS].tolist()
        return max(_refine(self._fine, self._times, place, _width(self._fine, along))[0] for place in places)

    def _rough(self) -> dict[int, _Found]:
        """The times with the largest norms at the first look -> norms and directions from the farthest points there."""
        norms = np.stack([self._coarse.norms(points) for points in self._points])
        return {
            place: self._from(place, self._points[place][:, np.argsort(-norms[place])[:_FEW]])
            for place in np.argsort(-norms.max(axis=1))[:_MOST_ROUGH].tolist()
        }

    def _from(self, place: int, directions: NDArray[np.float64]) -> _Found:
        return self._coarse.radius(self._indices[place], directions, _ROUGH)

    def _everywhere(self, places: list[int], rough: dict[int, _Found]) -> NDArray[np.float64]:
        """The best directions at some times, searched from all starts."""
        pool = np.hstack([self._starts, *(rough[place][1] for place in places)])
        found = [self._coarse.radius(self._indices[place], pool, _ROUGH, _PATIENCE) for place in places]
        return np.hstack([directions[:, :_KEPT] for _, directions in found])

    def _peak(self, sets: ReachableSets, place: int, directions: NDArray[np.float64]) -> tuple[float, float]:
        return _refine(sets, self._times, place, _length(sets, directions))


def _best(found: Mapping[int, tuple[Any, Any]], count: int) -> list[int]:
    """The places with the largest values."""
    return sorted(found, key=lambda place: found[place][0], reverse=True)[:count]


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
    count = max(_LEAST_STARTS, min(_STARTS * 2 ** min(agents, 20), _START_WORK // agents**2))
    random = np.random.default_rng(2018).standard_normal((count, agents - 1))
    ordered = [*random[:_FEW], *pairs, *random[_FEW:]]
    return np.stack(ordered, axis=1)

"""Excitation of switching networks: jointly connected intervals, and the constants that follow from them.

The paper's corollary asks for contiguous intervals of bounded length over each of which the union of the graphs has a
spanning tree. That does not suffice: the weights may fade from interval to interval. What suffices is a lower bound on
the integrated weights of a spanning tree of each interval; every window of twice the longest interval then holds a
whole interval, and no tree has to come back (audit, section 8).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.excitation.persistence import (
    Signal,
    WindowExtremes,
    excitation_horizon,
    signal_factor,
    window_extremes,
)
from hybrid_model.consensus.graphs.connectivity import is_connected
from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["JointExcitation", "JointInterval", "joint_excitation"]

_ZERO = 1e-12


@dataclass(frozen=True)
class JointInterval:
    """One of the paper's intervals tau(j, 1): from one switching instant to another.

    Parameters
    ----------
    start, end : float
        The interval [s].
    tree : tuple of int
        Numbers, from 1, of the edges of the spanning tree whose smallest integrated weight is largest.
    weight : float
        That smallest integrated weight; 0.0 if the union of the graphs has a spanning tree but its weights vanish.
    connectivity : float
        Second smallest eigenvalue of the tree's Laplacian.
    mu1 : float
        Second smallest eigenvalue of ``int D W D^T`` over the interval, at least ``weight*connectivity``.
    """

    start: float
    end: float
    tree: tuple[int, ...]
    weight: float
    connectivity: float
    mu1: float

    @property
    def length(self) -> float:
        """Length [s]."""
        return self.end - self.start


@dataclass(frozen=True)
class JointExcitation:
    """Constants for the repaired corollary.

    Parameters
    ----------
    intervals : tuple of JointInterval
        Contiguous intervals from t = 0; for periodic networks those of one round, after which they repeat.
    exact : WindowExtremes
        Constants of N over windows of twice the longest interval.
    trace : float
        Supremum of ``tr int N = 2 sum_e int w_e`` over these windows.
    agents : int
        Number of agents n.
    """

    intervals: tuple[JointInterval, ...]
    exact: WindowExtremes
    trace: float
    agents: int

    @property
    def longest(self) -> float:
        """Length h [s] of the longest interval."""
        return max(interval.length for interval in self.intervals)

    @property
    def window(self) -> float:
        """T = 2 h [s]."""
        return self.exact.window

    @property
    def weakest(self) -> JointInterval:
        """The interval whose tree has the smallest integrated weight w_min."""
        return min(self.intervals, key=lambda interval: interval.weight)

    @property
    def mu1_of_paths(self) -> float:
        """``2 w_min (1 - cos(pi/n))`` <= mu1(N): no tree on n agents is less connected than the path."""
        return 2 * self.weakest.weight * (1 - math.cos(math.pi / self.agents))

    @property
    def mu1_of_trees(self) -> float:
        """Least product of a tree's integrated weight and its connectivity, <= mu1(N)."""
        return min(interval.weight * interval.connectivity for interval in self.intervals)

    @property
    def mu1_of_intervals(self) -> float:
        """Least mu1 of an interval, <= mu1(N)."""
        return min(interval.mu1 for interval in self.intervals)


def joint_excitation(scenario: Scenario) -> JointExcitation:
    """Cut the time into the shortest jointly connected intervals, each ending at a switching instant.

    Parameters
    ----------
    scenario : Scenario
        A switching network, or one with periodic weights that does not switch; then the intervals are the periods.

    Raises
    ------
    ValueError
        If nothing changes in time, or the union of all graphs is not connected.

    Notes
    -----
    Without a common period of weights and switching, the intervals are those that end within the run, and `exact` holds
    for the windows inside it. If so much of the run is left over that a window could lie in it without a whole
    interval, the last interval lasts until the end of the run.
    """
    weights, network = scenario.edge_weights, scenario.network
    instants, period = _instants(scenario)
    intervals: list[JointInterval] = []
    begin, seen = 0, set[int]()
    while begin % len(instants) not in seen if period else begin < len(instants) - 1:
        seen.add(begin % len(instants))
        end = _end(scenario, instants, period, begin)
        if end is None:
            break
        intervals.append(_interval(scenario, _time(instants, period, begin), _time(instants, period, end)))
        begin = end
    if not intervals:
        raise ValueError(
            "the union of the graphs over the whole run is not connected, so there are no jointly connected intervals; "
            "let each agent be reached within the run."
        )
    if period is None:
        intervals[-1] = _to_the_end(scenario, intervals)
    window = 2 * max(interval.length for interval in intervals)
    horizon = excitation_horizon(scenario)
    if horizon is not None:
        window = min(window, horizon)
    total = np.full((1, len(network.edges)), math.sqrt(2.0))
    return JointExcitation(
        intervals=tuple(intervals),
        exact=window_extremes(signal_factor(scenario, Signal.DISAGREEMENT), weights, window, horizon),
        trace=window_extremes(total, weights, window, horizon).mu2,
        agents=network.agents,
    )


def _to_the_end(scenario: Scenario, intervals: list[JointInterval]) -> JointInterval:
    """The last interval, made longer if windows behind its start would hold no whole interval."""
    last, longest, end = intervals[-1], max(interval.length for interval in intervals), scenario.stop_time
    return _interval(scenario, last.start, end) if end - last.start > 2 * longest else last


def _instants(scenario: Scenario) -> tuple[list[float], float | None]:
    """Switching instants of one period, beginning with 0, and the period; without one those of the run and its end."""
    switching, period = scenario.switching, scenario.edge_weights.period
    if period == 0.0:
        raise ValueError("nothing changes in time, so there are no intervals; use the constants of any window.")
    if period is None:
        end = scenario.stop_time
        return [0.0, *switching.breakpoints(0.0, end).tolist(), end], None
    # An instant that is the end of the period up to rounding is the first of the next one.
    inner = [t for t in switching.breakpoints(0.0, period).tolist() if period - t > _ZERO * period]
    return [0.0, *inner], period


def _time(instants: list[float], period: float | None, number: int) -> float:
    if period is None:
        return instants[number]
    return (number // len(instants)) * period + instants[number % len(instants)]


def _end(scenario: Scenario, instants: list[float], period: float | None, begin: int) -> int | None:
    """Number of the first instant at which the union of the graphs since `begin` is connected."""
    network = scenario.network
    last = begin + len(instants) if period is not None else len(instants) - 1
    union: NDArray[np.bool_] = np.zeros(len(network.edges), dtype=bool)
    for number in range(begin, last):
        middle = (_time(instants, period, number) + _time(instants, period, number + 1)) / 2
        union |= scenario.switching.active_at(middle)
        chosen = [edge for edge, active in zip(network.edges, union, strict=True) if active]
        if chosen and is_connected(network.agents, chosen):
            return number + 1
    return None


def _interval(scenario: Scenario, start: float, end: float) -> JointInterval:
    network = scenario.network
    doses = scenario.edge_weights.integral(start, end)
    active = np.zeros(len(doses), dtype=bool)
    for piece_start, piece_end in _between(scenario, start, end):
        active |= scenario.switching.active_at((piece_start + piece_end) / 2)
    graph: nx.Graph[int] = nx.Graph()
    for number in np.flatnonzero(active).tolist():
        graph.add_edge(*network.edges[number], number=number + 1, weight=float(doses[number]))
    tree = tuple(
        sorted(data["number"] for _, _, data in nx.maximum_spanning_edges(graph, algorithm="kruskal", data=True))
    )
    D = incidence(network.agents, tuple(network.edges[number - 1] for number in tree))
    factor = signal_factor(scenario, Signal.DISAGREEMENT)
    return JointInterval(
        start=start,
        end=end,
        tree=tree,
        weight=float(min(doses[number - 1] for number in tree)),
        connectivity=float(np.linalg.eigvalsh(D @ D.T)[1]),
        mu1=max(0.0, float(np.linalg.eigvalsh((factor * doses) @ factor.T)[0])),
    )


def _between(scenario: Scenario, start: float, end: float) -> Iterator[tuple[float, float]]:
    times = [start, *scenario.switching.breakpoints(start, end).tolist(), end]
    return pairwise(times)

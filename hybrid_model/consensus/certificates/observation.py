"""What a run shows of the quantities that certificates bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_model import HybridArc, NetworkRun
from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.graphs.undirected import disagreement_basis
from hybrid_model.consensus.runs.metrics import run_states
from hybrid_model.consensus.runs.report import edge_norm, report_of
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["Observation", "observe"]

_STATE_TOLERANCE = 1e-10
"""States of a run are trusted to this, measured by the disagreement at the start (audit, section 10)."""


@dataclass(frozen=True)
class Observation:
    """A run in numbers that can be compared with bounds.

    Attributes
    ----------
    min_gap : float or None
        Shortest time [s] between two broadcasts of one agent; None if no agent broadcast twice. Sampled checks and
        periodic broadcasts are at known times, so there it is the whole number of periods that it stands for.
    radius : float or None
        Largest ``exp(beta t) (||x_e(t)|| - ||x_e(t) without errors||)`` over the last cycle: what is left once the
        share of the initial state, that of thresholds which decay faster (of the mixed law) and the numerical
        tolerance of states are taken off. Never above the exact worst case. None without a network that reaches
        consensus, or a bound on the errors.
    initial_share : float or None
        Largest ``exp(beta t) ||x_e(t) without errors||`` over the last cycle.
    end : float
        Where the run ends [s].
    events_per_agent : tuple of int
        Broadcasts of each agent, without the one at the start.
    x_end : tuple of float
        Final states.
    """

    min_gap: float | None
    radius: float | None
    initial_share: float | None
    end: float
    events_per_agent: tuple[int, ...]
    x_end: tuple[float, ...]


def observe(
    analysis: Analysis, arc: HybridArc | NetworkRun, decay: float | None, faster: Sequence[tuple[float, float]] = ()
) -> Observation:
    """Take the figures from the run of a scenario's closed loop.

    Parameters
    ----------
    analysis : Analysis
        The scenario; its cycle decides which part of the run counts as late.
    arc : HybridArc or NetworkRun
        The run of ``closed_loop(scenario)`` or of ``agent_network(scenario)``.
    decay : float or None
        beta [1/s] of the slowest part of the bound on the errors; None if there is no bound, and then no radius.
    faster : sequence of (radius, decay)
        Of the parts that decay faster: what they add to ``||x_e(t)||`` is at most ``radius exp(-decay t)``.
    """
    scenario = analysis.scenario
    report, end = report_of(scenario, arc), float(arc.t if isinstance(arc, NetworkRun) else arc.t[-1])
    gap, shown = report.min_gap, (end, tuple(report.events_per_agent), tuple(report.x_end.tolist()))
    times, free = undisturbed(analysis, end)
    shortest = None if gap is None else _shortest(scenario, gap)
    if decay is None:
        return Observation(shortest, None, None, *shown)
    states = run_states(scenario, arc)(times)
    growth = np.exp(decay * times)
    share = edge_norm(scenario, free) * growth
    rounding = _STATE_TOLERANCE * edge_norm(scenario, np.asarray(scenario.network.initial)) * growth
    passing = sum((radius * np.exp((decay - rate) * times) for radius, rate in faster), np.zeros_like(times))
    forced = max(0.0, float(np.max(edge_norm(scenario, states) * growth - share - passing - rounding)))
    return Observation(shortest, forced, float(np.max(share)), *shown)


def _shortest(scenario: Scenario, gap: float) -> float:
    if scenario.trigger.kind in (TriggerKind.SAMPLED, TriggerKind.PERIODIC):
        return round(gap / scenario.trigger.period) * scenario.trigger.period
    return gap


def undisturbed(analysis: Analysis, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s] of the last cycle before `end` and the states there without trigger errors, shape (n, times)."""
    if analysis.is_large:
        return _undisturbed_large(analysis, end)
    cells = analysis.cells
    length = float(cells.times[-1])
    count = max(0, int(np.floor(end / length)) - 1) if analysis.is_periodic else 0
    state = np.linalg.matrix_power(cells.product(), count) @ analysis.initial_disagreement
    path = [state]
    for flow in [*cells.flows, *cells.flows] if analysis.is_periodic else cells.flows:
        path.append(flow @ path[-1])
    times = np.append(count * length + cells.times[:-1], (count + 1) * length + cells.times)
    times = times if analysis.is_periodic else cells.times
    late = (times <= end) & (times >= end - length)
    network = analysis.scenario.network
    mean = float(np.mean(network.initial))
    states = disagreement_basis(network.agents) @ np.array(path).T + mean
    return times[late], states[:, late]


_TIMES = 400
"""At which a cycle of constant weights is looked at."""


def _undisturbed_large(analysis: Analysis, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`undisturbed` of large networks."""
    if analysis.is_constant:
        times = np.linspace(max(0.0, end - analysis.cycle), end, _TIMES)
        return times, analysis.constant_motion.states(times)
    motion, state = analysis.motion, np.asarray(analysis.scenario.network.initial)
    length = float(motion.times[-1])
    count = max(0, int(np.floor(end / length)) - 1) if analysis.is_periodic else 0
    state = motion.over_a_cycle(state, count)
    path = motion.path(state)
    times = count * length + motion.times
    if analysis.is_periodic:
        path = np.vstack([path[:-1], motion.path(path[-1])])
        times = np.append(times[:-1], (count + 1) * length + motion.times)
    late = (times <= end) & (times >= end - length)
    return times[late], path[late].T

"""How well a run agrees: disagreement, its integral, settling; and all that a run costs and gives as one object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.runs.communication import communication, gap_statistics
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.record.arc import HybridArc
from hybrid_model.schedule.network_run import NetworkRun

__all__ = [
    "Performance",
    "States",
    "disagreement",
    "performance",
    "run_metrics",
    "run_states",
    "settling_time",
]

_POINTS_PER_PIECE = 16
_LATE = 0.75
"""Share of the run after which disagreement counts as ultimate."""

States = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""States of all agents, shape (n, times), at ascending times [s]."""


def run_states(scenario: Scenario, arc: HybridArc | NetworkRun) -> States:
    """The states of a run of ``closed_loop(scenario)`` or ``agent_network(scenario)`` as a function of time."""
    if isinstance(arc, NetworkRun):
        return lambda times: arc.at("x", times)
    names = [f"{agent_name(i)}.x" for i in range(1, scenario.network.agents + 1)]

    def states(times: NDArray[np.float64]) -> NDArray[np.float64]:
        values = arc.resample(times, names).values
        return np.array([values[name] for name in names])

    return states


def disagreement(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """``||x - mean(x) 1||``, shape (times,), of states of shape (n, times); it does not depend on the graph."""
    return np.asarray(np.linalg.norm(states - states.mean(axis=0), axis=0))


@dataclass(frozen=True)
class Performance:
    """How well a run agrees; all from ``d(t) = ||x(t) - mean(x(t)) 1||``.

    Attributes
    ----------
    integral : float
        ``int d^2 dt`` over the run, in the squared unit of the states times s.
    ultimate : float
        Largest d over the last quarter of the run.
    settling : float or None
        Time [s] from which on ``d <= level``; None if it is larger at the end.
    level : float
        The level of the settling time.
    """

    integral: float
    ultimate: float
    settling: float | None
    level: float


def performance(
    scenario: Scenario, states: States, event_times: Sequence[ArrayLike] = (), level: float | None = None
) -> Performance:
    """Judge a run.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    states : callable
        Its states, from `run_states` or `PeriodicRun.at`.
    event_times : sequence of array_like, each of shape (events,), optional
        Times [s] of broadcasts, where the states have kinks.
    level : float, optional
        Of the settling time; by default a twentieth of the disagreement at the start.

    Notes
    -----
    Between kinks d is smooth; d^2 is integrated by Simpson's rule on 16 parts of each stretch between breakpoints of
    the weights, broadcasts and hundredths of the run.
    """
    times = _grid(scenario, event_times)
    values = disagreement(states(times))
    wanted = float(values[0]) / 20 if level is None else level
    late = times >= _LATE * scenario.stop_time
    return Performance(
        integral=_simpson(times, values**2),
        ultimate=float(np.max(values[late])),
        settling=settling_time(lambda t: disagreement(states(t)), times, wanted, values),
        level=wanted,
    )


def settling_time(
    value: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    times: NDArray[np.float64],
    level: float,
    known: NDArray[np.float64] | None = None,
) -> float | None:
    """The time [s] from which on a value stays at or below a level.

    Parameters
    ----------
    value : callable
        Continuous, of times [s].
    times : ndarray
        Ascending grid from the start to the end of the run; an excursion between two of its points is not seen.
    level : float
        Where to settle.
    known : ndarray, optional
        The values at `times`, if they have been computed.

    Returns
    -------
    float or None
        The last crossing, located to rounding; the start if the value never exceeds the level, None if it does so at
        the end.
    """
    above = np.flatnonzero((value(times) if known is None else known) > level)
    if not above.size:
        return float(times[0])
    last = int(above[-1])
    if last == len(times) - 1:
        return None

    def excess(t: float) -> float:
        return float(value(np.array([t]))[0]) - level

    end = float(times[last + 1])
    return float(brentq(excess, times[last], end, xtol=1e-13)) if excess(end) < 0 else end


def run_metrics(scenario: Scenario, arc: HybridArc, level: float | None = None) -> dict[str, Any]:
    """All metrics of a run `arc` of ``closed_loop(scenario)`` as one object for JSON; `level` as in `performance`.

    Of a run that ended early those of its part.
    """
    scenario = replace(scenario, stop_time=float(arc.t[-1]))
    times = run_report(scenario, arc).event_times
    sent, gaps = communication(scenario, times), gap_statistics(times)
    judged = performance(scenario, run_states(scenario, arc), times, level)
    return {
        "broadcasts": sent.broadcasts,
        "link_messages": sent.link_messages,
        "active_messages": sent.active_messages,
        "duration": sent.duration,
        "rate": sent.rate,
        "gaps": {
            "count": gaps.count,
            "min": gaps.min,
            "mean": gaps.mean,
            "quantiles": {str(share): gap for share, gap in gaps.quantiles().items()},
        },
        "integral": judged.integral,
        "ultimate": judged.ultimate,
        "settling": {"time": judged.settling, "level": judged.level},
    }


def _grid(scenario: Scenario, event_times: Sequence[ArrayLike]) -> NDArray[np.float64]:
    end = scenario.stop_time
    rows = [np.asarray(times, dtype=float) for times in event_times]
    cuts = np.concatenate([np.linspace(0.0, end, 101), scenario.edge_weights.breakpoints(0.0, end), *rows])
    cuts = np.unique(cuts[(cuts >= 0) & (cuts <= end)])
    steps = np.arange(_POINTS_PER_PIECE) / _POINTS_PER_PIECE
    return np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * steps).ravel(), end)


def _simpson(times: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    left, middle, right = values[:-2:2], values[1:-1:2], values[2::2]
    return float(np.sum((times[2::2] - times[:-2:2]) / 6 * (left + 4 * middle + right)))

"""What a run of a scenario shows: events, gaps, final states, disagreement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_model import HybridArc, NetworkRun
from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario, require_scenario
from hybrid_model.declare.calls import explained
from hybrid_model.declare.variables import FloatArray


@dataclass(frozen=True, eq=False)
class RunReport:
    """The figures of one run.

    Attributes
    ----------
    event_times : list of ndarray, each of shape (events,)
        Times in s of each agent's broadcasts, without the one at the start.
    x_end : ndarray, shape (agents,)
        Final states.
    edge_norm_end : float
        Norm of the final edge states over the underlying graph.
    mean_drift : float
        Largest distance of the mean state from its start; the protocol conserves it.
    stop : str
        Name of the reason why the run ended.
    message : str
        The particulars.
    """

    event_times: list[FloatArray]
    x_end: FloatArray
    edge_norm_end: float
    mean_drift: float
    stop: str
    message: str

    @property
    def events_per_agent(self) -> list[int]:
        """Number of broadcasts of each agent."""
        return [len(times) for times in self.event_times]

    @property
    def min_gap(self) -> float | None:
        """Shortest time in s between two successive broadcasts of one agent; None if there are none."""
        gaps = [float(np.min(np.diff(times))) for times in self.event_times if len(times) > 1]
        return min(gaps) if gaps else None

    def as_dict(self) -> dict[str, Any]:
        """Return the run object of the command line's JSON."""
        return {
            "events_per_agent": self.events_per_agent,
            "events_total": sum(self.events_per_agent),
            "event_times": [times.tolist() for times in self.event_times],
            "min_gap": self.min_gap,
            "x_end": self.x_end.tolist(),
            "edge_norm_end": self.edge_norm_end,
            "mean_drift": self.mean_drift,
            "stop": self.stop,
        }


@explained(ScenarioError)
def run_report(scenario: Scenario, arc: HybridArc) -> RunReport:
    """Take the figures of a run of a scenario's closed loop.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        The run of `closed_loop(scenario)`.

    Raises
    ------
    ScenarioError
        If the scenario is none.
    """
    require_scenario("run_report", scenario)
    names = [agent_name(i) for i in range(1, scenario.network.agents + 1)]
    samples = arc.samples([f"{name}.x" for name in names])
    states = np.array([samples[f"{name}.x"] for name in names])
    mean = states.mean(axis=0)
    return RunReport(
        event_times=[broadcast_times(arc, name) for name in names],
        x_end=states[:, -1],
        edge_norm_end=edge_norm(scenario, states[:, -1]),
        mean_drift=float(np.max(np.abs(mean - mean[0]))),
        stop=arc.stop.name,
        message=arc.message,
    )


def report_of_network(scenario: Scenario, run: NetworkRun) -> RunReport:
    """Take the figures of a run of a scenario's agents, part by part; the mean is that of the end.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    run : NetworkRun
        Of `agent_network(scenario)`.
    """
    x_end, sent = run.final("x"), run.events.named("trigger.broadcast")
    part, times = run.events.part[sent], run.events.t[sent]
    order = np.argsort(part, kind="stable")
    ends = np.searchsorted(part[order], np.arange(1, scenario.network.agents))
    return RunReport(
        event_times=np.split(times[order], ends),
        x_end=x_end,
        edge_norm_end=edge_norm(scenario, x_end),
        mean_drift=float(abs(np.mean(x_end) - np.mean(scenario.network.initial))),
        stop=run.stop.name,
        message=run.message,
    )


def report_of(scenario: Scenario, run: HybridArc | NetworkRun) -> RunReport:
    """Take the figures of a run of either kind."""
    return report_of_network(scenario, run) if isinstance(run, NetworkRun) else run_report(scenario, run)


def broadcast_times(arc: HybridArc, name: str) -> FloatArray:
    """Return the times in s of an agent's broadcasts; none for an agent that broadcasts continuously."""
    jump = f"{name}.trigger.broadcast"
    sends = any(info.name == jump for info in arc.automaton.jumps)
    return arc.event_times(jump) if sends else np.empty(0)


def edge_norm(scenario: Scenario, x: FloatArray) -> Any:
    """Return the norm of the edge states ``D' x`` over the underlying graph (paper, equation of the edge states).

    Parameters
    ----------
    scenario : Scenario
        Whose underlying graph counts.
    x : ndarray, shape (n,) or (n, times)
        States.

    Returns
    -------
    float or ndarray, shape (times,)
    """
    tails, heads = (np.array(scenario.network.underlying_edges) - 1).T
    norms = np.linalg.norm(x[heads] - x[tails], axis=0)
    return float(norms) if np.ndim(x) == 1 else norms

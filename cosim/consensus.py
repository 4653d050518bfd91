"""Agents of a consensus scenario as systems of slaves, in this process or as FMUs, and the report of their runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.result import CosimResult
from cosim.system import System
from hybrid_model.consensus.laws.closed_loop import agent_name, broadcast_wires, scenario_agents
from hybrid_model.consensus.runs.report import RunReport, edge_norm
from hybrid_model.consensus.scenario.definition import Scenario

CLOCK = "broadcast_clock"


def in_process_system(scenario: Scenario) -> System:
    """Wire the agents of a scenario as automata in this process."""
    slaves = [AutomatonSlave(name, automaton) for name, automaton in scenario_agents(scenario).items()]
    return System(slaves, broadcast_wires(scenario))


def fmu_system(scenario: Scenario, fmus: Mapping[str, Path]) -> System:
    """Wire the agents of a scenario as FMUs, one file an agent."""
    return System([FmuSlave(name, path) for name, path in fmus.items()], broadcast_wires(scenario))


def network_report(scenario: Scenario, result: CosimResult) -> RunReport:
    """Take the figures of an event-exact co-simulation of a scenario's agents."""
    names = [agent_name(i) for i in range(1, scenario.network.agents + 1)]
    x_end = np.array([result.final[f"{name}.x"] for name in names])
    states = np.array([result.signals.get(f"{name}.x", [x_end[k]]) for k, name in enumerate(names)])
    mean = np.append(states.mean(axis=0), x_end.mean())
    return RunReport(
        event_times=[result.tick_times(name, CLOCK) for name in names],
        x_end=x_end,
        edge_norm_end=edge_norm(scenario, x_end),
        mean_drift=float(np.max(np.abs(mean - np.mean(scenario.network.initial)))),
        stop=result.ended.name,
        message=result.message or f"{scenario.name}: reached t = {result.t:.9g} s.",
    )

"""Which agents hang together: the connected components of the union of the graphs, each as a scenario of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import networkx as nx
import numpy as np

from hybrid_model.consensus.messages import enumerated
from hybrid_model.consensus.scenario.definition import Network, Scenario, Weights
from hybrid_model.consensus.switching.base import NoSwitching

__all__ = ["active_edges", "component_scenarios", "connected_components", "joined_agents", "listed", "union_time"]

_SPREAD = 1e-12
"""Share of the largest integral below which an edge's integral counts as zero (rounding)."""


def union_time(scenario: Scenario) -> float:
    """Length [s] of the time from t = 0 over which the union of the graphs is taken: the period, or the run."""
    period = scenario.edge_weights.period
    return scenario.stop_time if period is None else period or 1.0


def active_edges(scenario: Scenario, cycle: float) -> list[int]:
    """Indices, from 0, of the listed edges whose weight has a positive integral over ``[0, cycle]`` [s]."""
    doses = scenario.edge_weights.integral(0.0, cycle)
    return [int(edge) for edge in np.flatnonzero(doses > _SPREAD * float(np.max(doses, initial=0.0)))]


def connected_components(scenario: Scenario, cycle: float) -> list[list[int]]:
    """Agents, from 1, of each connected part of the union of the graphs over ``[0, cycle]`` [s]."""
    return joined_agents(scenario, active_edges(scenario, cycle))


def joined_agents(scenario: Scenario, edges: Iterable[int]) -> list[list[int]]:
    """Agents, from 1, that some of the listed edges, from 0, join: the connected components."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, scenario.network.agents + 1))
    graph.add_edges_from(scenario.network.edges[edge] for edge in edges)
    return sorted(sorted(agents) for agents in nx.connected_components(graph))


def listed(components: list[list[int]]) -> str:
    """Components as the text of a sentence."""
    return " and ".join("{" + enumerated(agents) + "}" for agents in components)


def component_scenarios(scenario: Scenario, cycle: float) -> list[tuple[list[int], Scenario | None]]:
    """The connected components over ``[0, cycle]`` [s]: agents, and the scenario of them alone.

    A component of one agent has no scenario: its agent never moves.
    """
    return [
        (agents, _restricted(scenario, agents) if len(agents) > 1 else None)
        for agents in connected_components(scenario, cycle)
    ]


def _restricted(scenario: Scenario, agents: list[int]) -> Scenario:
    network = scenario.network
    place = {agent: number for number, agent in enumerate(agents, start=1)}
    edges = [k for k, (i, j) in enumerate(network.edges) if i in place and j in place]
    renumbered = {edge + 1: number for number, edge in enumerate(edges, start=1)}
    switching: Any = scenario.switching
    if isinstance(switching, NoSwitching):
        switching = NoSwitching(len(edges))
    else:
        active = tuple(tuple(renumbered[edge] for edge in row if edge in renumbered) for row in switching.active)
        switching = replace(switching, active=active, edge_count=len(edges))
    return replace(
        scenario,
        name=f"{scenario.name}, agents {', '.join(map(str, agents))}",
        network=Network(
            len(agents),
            tuple((place[i], place[j]) for i, j in (network.edges[k] for k in edges)),
            tuple(network.initial[agent - 1] for agent in agents),
            network.gain,
        ),
        weights=Weights(tuple(scenario.weights.waveforms[k] for k in edges)),
        switching=switching,
    )

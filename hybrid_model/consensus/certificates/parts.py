"""Networks that fall apart: each connected part of the union of the graphs as a scenario of its own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hybrid_model.consensus.certificates.analysis import connected_parts
from hybrid_model.consensus.scenario.definition import Network, Scenario, Weights
from hybrid_model.consensus.weights.switching import NoSwitching

__all__ = ["part_scenarios"]


def part_scenarios(scenario: Scenario, cycle: float) -> list[tuple[list[int], Scenario | None]]:
    """The connected parts of the union of the graphs over ``[0, cycle]``: agents, and the scenario of them alone.

    A part of one agent has no scenario: its agent never moves.
    """
    found: list[tuple[list[int], Scenario | None]] = []
    for part in connected_parts(scenario, cycle):
        edges = [k for k, edge in enumerate(scenario.network.edges) if edge[0] in part and edge[1] in part]
        found.append((part, _restricted(scenario, part, edges) if len(part) > 1 else None))
    return found


def _restricted(scenario: Scenario, part: list[int], edges: list[int]) -> Scenario:
    place = {agent: number for number, agent in enumerate(part, start=1)}
    renumbered = {edge + 1: number for number, edge in enumerate(edges, start=1)}
    network = Network(
        len(part),
        tuple((place[i], place[j]) for i, j in (scenario.network.edges[k] for k in edges)),
        tuple(scenario.network.initial[agent - 1] for agent in part),
        scenario.network.gain,
    )
    switching: Any = scenario.switching
    if isinstance(switching, NoSwitching):
        switching = NoSwitching(len(edges))
    else:
        active = tuple(tuple(renumbered[edge] for edge in row if edge in renumbered) for row in switching.active)
        switching = replace(switching, active=active, edge_count=len(edges))
    weights = Weights(tuple(scenario.weights.waveforms[k] for k in edges))
    name = f"{scenario.name}, agents {', '.join(map(str, part))}"
    return replace(scenario, name=name, network=network, weights=weights, switching=switching)

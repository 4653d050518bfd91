"""The hypotheses of the convergence results, checked on a scenario, with a sentence about where each fails."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.components import active_edges, connected_components
from hybrid_model.consensus.certificates.envelopes import envelope
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["PAPER_LAWS", "Hypothesis", "bound_hypotheses", "network_hypotheses"]

PAPER_LAWS = (TriggerKind.STATIC, TriggerKind.DYNAMIC, TriggerKind.SELF_TRIGGERED)
"""Laws whose runs are those of the paper's static or dynamic trigger."""

_ZERO = 1e-12
_BETWEEN = 8
"""Starts of windows that are tried between two corners of the weights."""


@dataclass(frozen=True)
class Hypothesis:
    """One hypothesis on one scenario.

    Parameters
    ----------
    name : str
        Short name, by which bounds refer to it.
    holds : bool
        Whether it holds.
    detail : str
        The numbers that decide; where it fails if it does.
    source : str
        Where it is stated.
    """

    name: str
    holds: bool
    detail: str
    source: str


def network_hypotheses(scenario: Scenario, cycle: float) -> list[Hypothesis]:
    """Hypotheses on graph, weights, channel and trigger that need no constants.

    Parameters
    ----------
    scenario : Scenario
        What is checked.
    cycle : float
        Length [s] of the interval from t = 0 over which the union of the graphs is taken.
    """
    parts = connected_components(scenario, cycle)
    period, kind = scenario.edge_weights.period, scenario.trigger.kind
    is_bounded = envelope(scenario) is not None or (kind is TriggerKind.SAMPLED and scenario.channel.ideal)
    joined = "joins all agents" if len(parts) == 1 else f"falls into the parts {_listing(parts)} of the agents"
    return [
        Hypothesis(
            "connected union",
            len(parts) == 1,
            f"The union of the graphs over {cycle:.6g} s {joined}.{_weak_edges(scenario, cycle)}",
            "paper, theorem 2 and corollary 1",
        ),
        Hypothesis(
            "periodic weights",
            period is not None,
            "The weights are constant."
            if period == 0
            else f"The weights have the period {period:.6g} s."
            if period is not None
            else f"The weights have no period; constants hold for the run up to {scenario.stop_time:.6g} s only.",
            "audit, section 7",
        ),
        Hypothesis(
            "trigger of the paper",
            kind in PAPER_LAWS,
            f"The trigger is '{kind.value}'."
            if kind in PAPER_LAWS
            else f"The trigger is '{kind.value}'; the paper's theorems are about the static and the dynamic one.",
            "paper, section 4",
        ),
        Hypothesis(
            "ideal channel",
            scenario.channel.ideal,
            "Broadcasts arrive at once."
            if scenario.channel.ideal
            else "Broadcasts are delayed or lost, so neighbours hold different copies and the average can drift.",
            "paper, section 4",
        ),
        Hypothesis(
            "bounded errors",
            is_bounded,
            "The trigger keeps every error below a function of time that is known in advance."
            if is_bounded
            else "No bound on the errors is known in advance.",
            "paper, section 4, bound on the errors",
        ),
    ]


def bound_hypotheses(bounds: Bounds) -> list[Hypothesis]:
    """Excitation of the tree and of the whole network, bounded errors, and how beta compares with each rate.

    Parameters
    ----------
    bounds : Bounds
        Of a scenario whose union of graphs is connected.
    """
    analysis = bounds.analysis
    constants, decay = analysis.tree_weights, analysis.scenario.trigger.decay
    rates = {"printed": bounds.printed.rate, "valid": bounds.valid.rate, "improved": bounds.improved_rate}
    if bounds.floquet_rate is not None:
        rates["Floquet"] = bounds.floquet_rate
    excited, all_excited = bounds.printed.rate > 0, bounds.improved_rate > 0
    found = [
        Hypothesis(
            "exciting tree",
            excited,
            f"The weights of the tree with the edges {list(analysis.tree.tree)} have mu1 = {constants.mu1:.6g}, "
            f"mu2 = {constants.mu2:.6g} over every window of T = {constants.window:.6g} s"
            + ("." if excited else f": {_idle_tree_edges(analysis)}"),
            "paper, theorem 2",
        ),
        Hypothesis(
            "persistent excitation",
            all_excited,
            f"The matrix N has mu1 = {analysis.disagreement.mu1:.6g} over every window of T = {analysis.window:.6g} s"
            + ("." if all_excited else f": {_idle_window(analysis)}"),
            "audit, section 3 (ii)",
        ),
    ]
    reason = _unbounded(bounds)
    if reason is not None:
        found.append(Hypothesis("bounded errors", False, reason, "audit, section 11.7"))
    for form, rate in rates.items():
        found.append(
            Hypothesis(
                f"beta below the {form} rate",
                decay < rate,
                f"beta is {decay:.6g}/s, the {form} rate {rate:.6g}/s.",
                "paper, theorem 2" if form == "printed" else "audit, sections 5 and 6",
            )
        )
    return found


def _weak_edges(scenario: Scenario, cycle: float) -> str:
    """A sentence on edges whose weight is positive and yet too small to be told from rounding; or nothing."""
    ever = np.zeros(len(scenario.network.edges), dtype=bool)
    for piece in scenario.edge_weights.pieces(0.0, cycle):
        ever |= piece.amplitudes > 0
    ever &= scenario.edge_weights.integral(0.0, cycle) > 0
    weak = sorted(set(np.flatnonzero(ever).tolist()) - set(active_edges(scenario, cycle)))
    if not weak:
        return ""
    names = ", ".join(str(edge + 1) for edge in weak)
    carries = f"Edge {names} carries" if len(weak) == 1 else f"Edges {names} carry"
    return f" {carries} less than a share of 1e-12 of the largest integrated weight, which counts as none."


def _unbounded(bounds: Bounds) -> str | None:
    """Why sampled checks keep the errors below no known bound; None if they do, or if the trigger is another."""
    scenario = bounds.analysis.scenario
    trigger = scenario.trigger
    if trigger.kind is not TriggerKind.SAMPLED or not scenario.channel.ideal or bounds.parts is not None:
        return None
    slope = bounds.sampled_slope
    if slope is None:
        return (
            f"Sampled checks: without a radius for beta = {trigger.decay:.6g}/s, which is not below the rate, the "
            "growth of errors between two checks is not bounded."
        )
    return (
        f"With checks every {trigger.period:.6g} s an error can outgrow what the checks allow: the fixed point c' of "
        f"the largest error grows with the factor {slope:.6g}, which must be below 1; check more often."
    )


def _idle_tree_edges(analysis: Analysis) -> str:
    """Which edge of the tree carries no weight in which window."""
    failing, listed = "in some window an edge of the tree carries no weight:", len(analysis.scenario.network.edges)
    unlisted = [number for number in analysis.tree.tree if number > listed]
    if unlisted:
        return f"{failing} edge {unlisted[0]} never does, it is one of the underlying graph alone."
    starts, doses = _window_doses(analysis)
    tree = np.array(analysis.tree.tree) - 1
    place = int(np.argmin(doses[:, tree].min(axis=1)))
    least = doses[place, tree]
    idle = tree[least <= max(float(least.min()), _ZERO * float(doses.max()))]
    names = ", ".join(str(edge + 1) for edge in idle.tolist())
    return f"{failing} edge {names} {_span(starts[place], analysis.window)}."


def _idle_window(analysis: Analysis) -> str:
    """A window in which the edges that carry weight do not join all agents."""
    network = analysis.scenario.network
    starts, doses = _window_doses(analysis)
    factor = disagreement_basis(network.agents).T @ incidence(network.agents, network.edges)
    least = np.linalg.eigvalsh((factor * doses[:, None, :]) @ factor.T)[:, 0]
    place = int(np.argmin(least))
    active = np.flatnonzero(doses[place] > _ZERO * float(doses.max()))
    span = f"in the window {_span(starts[place], analysis.window)}"
    if not active.size:
        return f"{span} no edge carries weight."
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, network.agents + 1))
    graph.add_edges_from(network.edges[edge] for edge in active)
    parts = sorted(sorted(part) for part in nx.connected_components(graph))
    edges = ", ".join(str(edge + 1) for edge in active)
    return f"{span} only the edges {edges} carry weight, and they join the agents to {_listing(parts)}."


def _window_doses(analysis: Analysis) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Starts of windows [s], and the integral of each listed edge's weight over them, shape (starts, m)."""
    weights, length = analysis.scenario.edge_weights, analysis.window
    last = analysis.cycle if analysis.is_periodic else max(analysis.cycle - length, 0.0)
    corners = np.concatenate(
        ([0.0, last], weights.breakpoints(0.0, last), weights.breakpoints(length, last + length) - length)
    )
    corners = np.unique(np.clip(corners, 0.0, last))
    share = np.arange(_BETWEEN) / _BETWEEN
    starts = np.append((corners[:-1, None] + np.diff(corners)[:, None] * share).ravel(), last)
    return starts, weights.integral(starts, starts + length)


def _span(start: float, length: float) -> str:
    return f"from t = {start:.6g} s to {start + length:.6g} s"


def _listing(parts: list[list[int]]) -> str:
    return " and ".join("{" + ", ".join(map(str, part)) + "}" for part in parts)

"""Where excitation fails: the window in which an edge of the tree, or the whole network, carries too little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.components import joined_agents, listed
from hybrid_model.consensus.excitation.persistence import window_corners
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.messages import enumerated

__all__ = ["idle_tree_edges", "idle_window"]

_ZERO = 1e-12
_BETWEEN = 8
"""Starts of windows that are tried between two corners of the weights."""


def idle_tree_edges(analysis: Analysis) -> str:
    """Which edge of the tree carries no weight in which window."""
    failing, known = "in some window an edge of the tree carries no weight:", len(analysis.scenario.network.edges)
    unlisted = [number for number in analysis.tree.tree if number > known]
    if unlisted:
        return f"{failing} edge {unlisted[0]} never does, it is one of the underlying graph alone."
    starts, doses = _window_doses(analysis)
    tree = np.array(analysis.tree.tree) - 1
    place = int(np.argmin(doses[:, tree].min(axis=1)))
    least = doses[place, tree]
    idle = tree[least <= max(float(least.min()), _ZERO * float(doses.max()))]
    names = enumerated(edge + 1 for edge in idle.tolist())
    return f"{failing} edge {names} {_span(starts[place], analysis.window)}."


def idle_window(analysis: Analysis) -> str:
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
    edges = enumerated(edge + 1 for edge in active)
    parts = listed(joined_agents(analysis.scenario, active))
    return f"{span} only the edges {edges} carry weight, and they join the agents to {parts}."


def _window_doses(analysis: Analysis) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Starts of windows [s], and the integral of each listed edge's weight over them, shape (starts, m)."""
    weights, length = analysis.scenario.edge_weights, analysis.window
    last = analysis.cycle if analysis.is_periodic else max(analysis.cycle - length, 0.0)
    corners = window_corners(weights, last, length)
    share = np.arange(_BETWEEN) / _BETWEEN
    starts = np.append((corners[:-1, None] + np.diff(corners)[:, None] * share).ravel(), last)
    return starts, weights.integral(starts, starts + length)


def _span(start: float, length: float) -> str:
    return f"from t = {start:.6g} s to {start + length:.6g} s"

"""What the certificates of one scenario are computed from; each quantity is computed once, when it is asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from hybrid_model.consensus.certificates.components import active_edges, connected_components, union_time
from hybrid_model.consensus.certificates.rates import tree_free_contraction
from hybrid_model.consensus.certificates.sizes import (
    LARGE,
    Cost,
    contraction_cost,
    mean_speed,
    memory_limit,
    overshoot_cost,
    worst_case_cost,
)
from hybrid_model.consensus.certificates.tree_bound import default_window
from hybrid_model.consensus.certificates.windows import RateForm, best_window
from hybrid_model.consensus.exact.floquet import FloquetSpectrum, floquet_spectrum
from hybrid_model.consensus.exact.free_motion import CellMotion, ConstantMotion, SparseMotion, leading_multipliers
from hybrid_model.consensus.exact.reachable_sets import ReachableSets
from hybrid_model.consensus.exact.transition_grid import TransitionGrid, affordable_resolution, transition_grid
from hybrid_model.consensus.exact.worst_case import WorstCase, worst_case
from hybrid_model.consensus.excitation.persistence import ExcitationConstants, Signal, scenario_excitation
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["PATIENCE", "Analysis", "analyse"]

PATIENCE = 5.0
"""In s of CPU time, see `Analysis`."""

_CELLS_MEMORY = 2**28
"""In bytes."""
_LEAST_MULTIPLIER = 1e-5
"""Below, digits are lost."""


@dataclass(frozen=True, eq=False)
class Analysis:
    """Quantities of a scenario whose edges join all agents over a window.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching and trigger.
    tree : TreePartition
        Spanning tree of the underlying graph for the tree-wise forms.
    window : float
        T [s] of the tree-wise and tree-free excitation constants.
    resolution : float
        Of the exact worst case, see `ReachableSets`.
    patience : float
        CPU time [s] that each quantity may take which grows faster than the cube of the number of agents, in networks
        of `hybrid_model.consensus.certificates.sizes.LARGE` agents or more.
    """

    scenario: Scenario
    tree: TreePartition
    window: float
    resolution: float = 0.01
    patience: float = PATIENCE

    def alike(self, scenario: Scenario) -> Analysis:
        """The analysis of the same network with other initial states or another trigger; what is known is kept."""
        # Filled by whichever of the two is asked first.
        _ = self._worst_cases, self._contractions
        other = replace(self, scenario=scenario)
        own = {field.name for field in fields(self)} | {"initial_disagreement", "constant_motion"}
        other.__dict__.update({name: value for name, value in self.__dict__.items() if name not in own})
        return other

    @property
    def is_large(self) -> bool:
        """Whether time counts."""
        return self.scenario.network.agents >= LARGE

    def affords(self, cost: Cost) -> bool:
        """Whether something is computed."""
        return cost.memory <= memory_limit() and (not self.is_large or cost.seconds <= self.patience)

    def worst_case_cost(self, decay: float) -> Cost:
        """Of `worst`."""
        return worst_case_cost(self.scenario, self.cycle, decay, self.resolution, self._mean_speed)

    @cached_property
    def has_exact_contraction(self) -> bool:
        """Whether `contraction` is exact and not left out."""
        if not self.is_periodic or self.is_constant:
            return self.is_periodic
        return self.affords(contraction_cost(self.scenario, self.cycle, self.resolution, self._mean_speed))

    @cached_property
    def has_overshoot(self) -> bool:
        """Whether `overshoot` exists and is not left out."""
        if not self.is_periodic or self.is_constant:
            return self.is_periodic
        return self.affords(overshoot_cost(self.scenario, self.cycle, self._mean_speed))

    @cached_property
    def _mean_speed(self) -> float:
        return mean_speed(self.scenario, self.cycle)

    @cached_property
    def constant_motion(self) -> ConstantMotion:
        """The motion without errors with constant weights."""
        return ConstantMotion(self.scenario)

    @cached_property
    def motion(self) -> SparseMotion | CellMotion:
        """The motion without errors over a cycle, by matrices as long as they are few and small."""
        size = self.scenario.network.agents
        cells = self.cycle * self._mean_speed / 0.02 + len(self.scenario.edge_weights.pieces(0.0, self.cycle))
        if 8 * cells * size**2 <= _CELLS_MEMORY:
            return CellMotion(self.scenario, self.cells)
        return SparseMotion(self.scenario, self.cycle)

    @cached_property
    def tree_weights(self) -> ExcitationConstants:
        """Constants of W_tau."""
        return scenario_excitation(self.scenario, Signal.TREE_WEIGHTS, self.tree, self.window)

    @cached_property
    def tree_coordinates(self) -> ExcitationConstants:
        """Constants of M."""
        return scenario_excitation(self.scenario, Signal.TREE_COORDINATES, self.tree, self.window)

    @cached_property
    def disagreement(self) -> ExcitationConstants:
        """Constants of N."""
        return scenario_excitation(self.scenario, Signal.DISAGREEMENT, window=self.window)

    @property
    def is_constant(self) -> bool:
        """Whether the weights never change."""
        return self.scenario.edge_weights.period == 0.0

    @property
    def is_periodic(self) -> bool:
        """Whether the weights have a period, or are constant."""
        return self.scenario.edge_weights.period is not None

    @cached_property
    def spectrum(self) -> FloquetSpectrum | None:
        """Floquet multipliers; None without a period.

        Of large networks whose edges carry weights of different shape at one time, only the largest ones: the monodromy
        matrix would take too long.
        """
        if not self.is_periodic:
            return None
        if self.is_large and not self.is_constant and not self._has_shared_carriers:
            multipliers = leading_multipliers(self.motion, self.scenario.network.agents)
            largest = float(np.abs(multipliers[0]))
            if largest > _LEAST_MULTIPLIER:
                return FloquetSpectrum(self.cycle, multipliers, -math.log(largest) / self.cycle)
        return floquet_spectrum(self.scenario)

    @property
    def _has_shared_carriers(self) -> bool:
        pieces = self.scenario.edge_weights.pieces(0.0, self.cycle)
        return all(piece.is_idle or piece.shared_carrier is not None for piece in pieces)

    @cached_property
    def cycle(self) -> float:
        """Length [s] of the cycle that exact quantities are taken over: the period; for constant weights a time in
        which disagreement falls by the factor e; without a period the stop time."""
        period = self.scenario.edge_weights.period
        if period is None:
            return self.scenario.stop_time
        if period > 0:
            return period
        return 1 / self.spectrum.rate if self.spectrum is not None and self.spectrum.rate > 0 else 1.0

    @cached_property
    def edge_gain(self) -> float:
        """``sqrt(lambda_max(D D^T))`` of the underlying graph: ``||x_e|| <= edge_gain ||xi||``."""
        network = self.scenario.network
        return float(np.linalg.norm(incidence(network.agents, network.underlying_edges), 2))

    @property
    def box_gain(self) -> float:
        """c_n: the largest ``||U^T e||`` over ``|e_i| <= 1`` (audit, section 4)."""
        n = self.scenario.network.agents
        return math.sqrt(4 * (n // 2) * ((n + 1) // 2) / n)

    @cached_property
    def reachable(self) -> ReachableSets:
        """Reachable sets on the fine grid for the threshold that does not decay."""
        return ReachableSets(self.scenario, self.cycle, 0.0, self.resolution, periodic=self.is_periodic)

    @cached_property
    def overshoot(self) -> float:
        """``sup ||phi(t, s)|| e^{r (t - s)}`` over starts s in the cycle and two cycles after, r the Floquet rate."""
        if self.is_constant or self.spectrum is None:
            return 1.0
        coarse = ReachableSets(self.scenario, self.cycle, 0.0, max(self.resolution, 0.05))
        return coarse.overshoot(self.spectrum.rate)

    def contraction(self, cycles: int = 1) -> float:
        """``sup_t ||phi(t + m C, t)||`` over m cycles C: the square root of the exact q (audit, section 5.3)."""
        if self.is_constant and self.spectrum is not None:
            return math.exp(-self.spectrum.rate * self.cycle * cycles)
        known: dict[int, float] = self._contractions
        if cycles not in known:
            known[cycles] = self.reachable.contraction(cycles)
        return known[cycles]

    @cached_property
    def _contractions(self) -> dict[int, float]:
        return {}

    @property
    def improved_contraction(self) -> float:
        """gamma* over the window: the share of ``||xi||^2`` that is lost at the least (audit, section 3 (ii))."""
        return tree_free_contraction(self.disagreement, self.scenario.network.gain)

    @cached_property
    def initial_disagreement(self) -> NDArray[np.float64]:
        """``xi(0)``, shape (n - 1,)."""
        network = self.scenario.network
        return np.asarray(disagreement_basis(network.agents).T @ np.asarray(network.initial))

    def worst(self, decay: float) -> WorstCase:
        """The exact worst case for the threshold ``exp(-decay t)`` times the scenario's c; kept for further calls."""
        known = self._worst_cases
        if decay not in known:
            known[decay] = worst_case(
                self.scenario, self.cycle, decay, self.resolution, periodic=self.is_periodic, threshold=1.0
            )
        return known[decay]

    @cached_property
    def _worst_cases(self) -> dict[float, WorstCase]:
        return {}

    @cached_property
    def largest_weights(self) -> NDArray[np.float64]:
        """Supremum of each listed edge's weight over time, shape (m,)."""
        largest = np.zeros(len(self.scenario.network.edges))
        for piece in self.scenario.edge_weights.pieces(0.0, self.cycle):
            for edge in np.flatnonzero(piece.amplitudes):
                height = _largest(piece.carriers[edge].value, piece.start, piece.end)
                largest[edge] = max(largest[edge], piece.amplitudes[edge] * height)
        return largest

    @cached_property
    def cells(self) -> TransitionGrid:
        """The flow over one cycle from t = 0, on a coarse grid."""
        resolution = affordable_resolution(self.scenario, 0.0, self.cycle, max(self.resolution, 0.02), 6000)
        return transition_grid(self.scenario, 0.0, self.cycle, resolution)

    def moved_degrees(self) -> NDArray[np.intp]:
        """Number of edges of each agent that ever carry weight, shape (n,)."""
        network = self.scenario.network
        active = np.asarray(active_edges(self.scenario, self.cycle))
        D = incidence(network.agents, network.edges)
        return np.asarray(np.abs(D[:, active]).sum(axis=1), dtype=np.intp)


def _largest(value: Callable[[Any], Any], start: float, end: float) -> float:
    """Maximum of a carrier that is smooth on an interval: a grid of 65 points, the best one refined."""
    times = np.linspace(start, end, 65)
    heights = value(times)
    best = int(np.argmax(heights))
    bounds = (times[max(best - 1, 0)], times[min(best + 1, 64)])
    refined = minimize_scalar(lambda t: -float(value(t)), bounds=bounds, method="bounded", options={"xatol": 1e-12})
    return max(float(heights[best]), -float(refined.fun))


def analyse(
    scenario: Scenario,
    tree: TreePartition | None = None,
    window: float | None = None,
    resolution: float = 0.01,
    patience: float = PATIENCE,
) -> Analysis:
    """Choose the tree and the window that are not given.

    The tree is the first one, in the order of the edges, whose edges all carry weight; the window is the period, a
    short time for constant weights, or for weights without a period the one with the best printed rate (if there is
    none, with the best valid rate).

    Raises
    ------
    ValueError
        If the edges that carry weight do not join all agents.
    """
    network = scenario.network
    period = scenario.edge_weights.period
    if tree is None:
        cycle = union_time(scenario)
        parts = connected_components(scenario, cycle)
        if len(parts) > 1:
            raise ValueError(f"the edges that carry weight join only the agents {parts} among each other, not all.")
        active = active_edges(scenario, cycle)
        numbers = TreePartition(network.agents, tuple(network.edges[edge] for edge in active)).tree
        tree = TreePartition(
            network.agents, network.underlying_edges, tuple(active[number - 1] + 1 for number in numbers)
        )
    if window is None and period is None:
        found = best_window(scenario, RateForm.PRINTED, tree)
        window = (found if found.rate > 0 else best_window(scenario, RateForm.VALID, tree)).window
    length = window if window is not None else default_window(scenario, tree)
    return Analysis(scenario, tree, length, resolution, patience)

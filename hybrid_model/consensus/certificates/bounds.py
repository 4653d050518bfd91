"""Rate and radius of one scenario in every form, from one analysis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.energy import energy_radius, initial_peaks
from hybrid_model.consensus.certificates.envelopes import Envelope, error_envelope, sampled_threshold
from hybrid_model.consensus.certificates.rates import tree_free_rate
from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.exact.worst_case import WorstCase
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

__all__ = ["Bounds", "with_threshold"]

_LEAST_FORGOTTEN = 1e-7
"""``(r - beta) C`` below which more cycles C count than `ReachableSets` adds up."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """All bounds of a scenario whose union of graphs is connected; None where a bound does not exist.

    A radius is ``sup limsup exp(beta t) ||x_e(t)||`` with the beta of the trigger, so with the static trigger it is the
    radius of the ball that the paper speaks of.
    """

    analysis: Analysis

    # --- rates -------------------------------------------------------------------------------------------------------

    @cached_property
    def printed(self) -> ConvergenceBound:
        """Theorem 2 along the tree of the analysis, as printed."""
        analysis = self.analysis
        return convergence_bound(
            analysis.scenario, BoundForm.PRINTED, analysis.tree, analysis.window, analysis.tree_weights
        )

    @cached_property
    def valid(self) -> ConvergenceBound:
        """The same as valid."""
        return self._valid(self.analysis.scenario)

    def theorem(self, c: float, decay: float) -> ConvergenceBound:
        """Theorem 2 in the valid form for another threshold, ``c exp(-decay t)``."""
        return self._valid(with_threshold(self.analysis.scenario, c, decay))

    def _valid(self, scenario: Scenario) -> ConvergenceBound:
        analysis = self.analysis
        return convergence_bound(scenario, BoundForm.VALID, analysis.tree, analysis.window, analysis.tree_coordinates)

    @cached_property
    def improved_rate(self) -> float:
        """Rate [1/s] of the tree-free gamma* (audit, section 3 (ii)); 0.0 without persistent excitation."""
        return tree_free_rate(self.analysis.disagreement, self.analysis.scenario.network.gain)

    @cached_property
    def floquet_rate(self) -> float | None:
        """Exact rate [1/s]; None without a period."""
        spectrum = self.analysis.spectrum
        return None if spectrum is None else spectrum.rate

    @property
    def floquet_overshoot(self) -> float | None:
        """``sup ||phi(t, s)|| e^{r (t - s)}`` with the exact rate r; None without a period."""
        return self.analysis.overshoot if self.analysis.has_overshoot else None

    # --- errors ------------------------------------------------------------------------------------------------------

    @cached_property
    def envelope(self) -> Envelope | None:
        """Pairs (c, beta) that bound the errors, see `envelope`; None if there are none."""
        scenario = self.analysis.scenario
        if scenario.trigger.kind is not TriggerKind.SAMPLED or not scenario.channel.ideal:
            return error_envelope(scenario)
        reach = self._sampled_reach
        if reach is None:
            return None
        decay = scenario.trigger.decay
        degrees = self.analysis.moved_degrees().tolist()
        omega = float(np.max(self.analysis.largest_weights))
        c = sampled_threshold(scenario, reach, self.initial_peaks(decay)[0], degrees, omega)
        return None if c is None else ((c, decay),)

    @property
    def _sampled_reach(self) -> float | None:
        """R for the threshold ``exp(-beta t)``: the lesser of the exact radius and the energy bound."""
        decay = self.analysis.scenario.trigger.decay
        worst, energy = self.worst(decay), energy_radius(self.analysis, decay)
        if energy is None or (worst is None and not self.is_left_out(decay)):
            return None
        return energy if worst is None else min(worst.radius * worst.cover, energy)

    @property
    def sampled_slope(self) -> float | None:
        """``e^{beta h} h k omega (sqrt(d) R + 2 d)``: bounded errors need it below 1 (audit, section 11.7).

        None without a radius R.
        """
        scenario, reach = self.analysis.scenario, self._sampled_reach
        if reach is None:
            return None
        trigger, degree = scenario.trigger, int(np.max(self.analysis.moved_degrees()))
        speed = trigger.period * scenario.network.gain * float(np.max(self.analysis.largest_weights))
        return math.exp(trigger.decay * trigger.period) * speed * (math.sqrt(degree) * reach + 2 * degree)

    def worst(self, decay: float) -> WorstCase | None:
        """The exact worst case for the threshold ``exp(-decay t)``; None if it does not exist or is out of reach."""
        rate = self.floquet_rate
        if rate is not None and (decay >= rate or self.is_beyond_reach(decay)):
            return None
        return self.analysis.worst(decay) if self._affords_worst(decay) else None

    def is_left_out(self, decay: float) -> bool:
        """Whether the exact worst case exists and is not computed because it would take too long."""
        rate = self.floquet_rate
        exists = rate is None or (decay < rate and not self.is_beyond_reach(decay))
        return exists and not self._affords_worst(decay)

    def _affords_worst(self, decay: float) -> bool:
        known: dict[float, bool] = self.__dict__.setdefault("_known_to_be_affordable", {})
        if decay not in known:
            known[decay] = self.analysis.affords(self.analysis.worst_case_cost(decay))
        return known[decay]

    def is_beyond_reach(self, decay: float) -> bool:
        """Whether errors of so many earlier cycles count that the exact worst case is not computed."""
        rate = self.floquet_rate
        return rate is not None and 0 < (rate - decay) * self.analysis.cycle < _LEAST_FORGOTTEN

    def initial_peaks(self, decay: float) -> tuple[float, NDArray[np.float64]]:
        """How large the share of the initial state gets, see `energy.initial_peaks`; kept for further calls."""
        known: dict[float, tuple[float, NDArray[np.float64]]] = self.__dict__.setdefault("_known_peaks", {})
        if decay not in known:
            known[decay] = initial_peaks(self.analysis, decay)
        return known[decay]

    @property
    def slowest(self) -> Envelope:
        """The parts of the errors that decay most slowly: they decide about the radius."""
        terms = self.envelope or ()
        return tuple((c, decay) for c, decay in terms if decay == min(b for _, b in terms))

    @property
    def passing_radii(self) -> tuple[tuple[float, float], ...]:
        """Pairs (R, b): the parts of the errors that decay faster than the slowest add at most ``R exp(-b t)``."""
        found = []
        for c, decay in self.envelope or ():
            if (c, decay) in self.slowest:
                continue
            # Beyond the rate no radius exists; the same part is also below one that decays half as fast as the rate.
            worst = self.worst(decay)
            carrier = decay if worst is not None or self.is_left_out(decay) else 0.5 * (self.floquet_rate or 0.0)
            worst = worst or self.worst(carrier)
            energy = energy_radius(self.analysis, carrier) if worst is None else None
            if worst is not None:
                found.append((c * worst.radius * worst.cover, carrier))
            elif energy is not None:
                found.append((c * energy, carrier))
        return tuple(found)

    # --- radius ------------------------------------------------------------------------------------------------------

    @property
    def printed_radius(self) -> float | None:
        """``rho kappa_2`` as printed; None unless beta is below the printed rate."""
        return self.printed.rho_kappa2

    @property
    def valid_radius(self) -> float | None:
        """``rho kappa_2*`` (audit, section 5.2); None unless beta is below the valid rate."""
        return self._sum(self._unit_valid_radius)

    def _unit_valid_radius(self, decay: float) -> float | None:
        bound = self.theorem(1.0, decay)
        return bound.rho_kappa2 if decay < bound.rate else None

    @property
    def improved_radius(self) -> float | None:
        """``c c_n k nubar e^{beta T}/(1 - e^{beta T} sqrt q)`` with ``q = 1 - gamma*`` (audit, end of section 5.2)."""
        analysis, root = self.analysis, math.sqrt(1 - self.analysis.improved_contraction)
        strength = analysis.edge_gain * analysis.box_gain * analysis.scenario.network.gain

        def unit_radius(decay: float) -> float | None:
            growth = math.exp(min(decay * analysis.window, 700.0))
            return (
                strength * analysis.disagreement.mu2_bar * growth / (1 - growth * root) if growth * root < 1 else None
            )

        return self._sum(unit_radius)

    @property
    def energy_radius(self) -> float | None:
        """See `hybrid_model.consensus.certificates.energy.energy_radius`."""
        return self._sum(lambda decay: energy_radius(self.analysis, decay))

    @property
    def exact_radius(self) -> float | None:
        """See `hybrid_model.consensus.exact.worst_case`."""
        return self._sum(self.unit_exact_radius)

    def unit_exact_radius(self, decay: float) -> float | None:
        """The exact radius for the threshold ``exp(-decay t)``; None if it does not exist."""
        worst = self.worst(decay)
        return None if worst is None else worst.radius

    @property
    def exact_worst(self) -> WorstCase | None:
        """The worst case behind the exact radius, for the slowest part of the errors; None without one."""
        return self.worst(self.slowest[0][1]) if self.slowest else None

    def _sum(self, unit_radius: Callable[[float], float | None]) -> float | None:
        if self.envelope is None:
            return None
        total = 0.0
        for c, decay in self.slowest:
            radius = unit_radius(decay)
            if radius is None:
                return None
            total += c * radius
        return total


def with_threshold(scenario: Scenario, c: float, decay: float) -> Scenario:
    """The same network with the threshold ``c exp(-decay t)``."""
    kind = TriggerKind.STATIC if decay == 0 else TriggerKind.DYNAMIC
    return replace(scenario, trigger=Trigger(kind, c, decay))

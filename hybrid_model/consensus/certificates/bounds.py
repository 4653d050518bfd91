"""Radius and minimum gap of one scenario in every form, from one analysis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.energy import energy_radius, initial_peaks
from hybrid_model.consensus.certificates.envelopes import Envelope, envelope, sampled_threshold
from hybrid_model.consensus.certificates.gaps import excited_gap, frozen_gap, growing_gap, printed_gap
from hybrid_model.consensus.certificates.rates import rate_of_contraction
from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.exact.worst_case import WorstCase
from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

__all__ = ["Bounds", "with_threshold"]

_LEAST_FORGOTTEN = 1e-7
"""``(r - beta) C`` below which more cycles C count than `ReachableSets` adds up."""


class _PartGap(Protocol):
    def __call__(
        self, c: float, decay: float, *, with_initial: bool, threshold: float | None = None
    ) -> float | None: ...


@dataclass(frozen=True, eq=False)
class Bounds:
    """All bounds of a scenario whose union of graphs is connected; None where a bound does not exist.

    A radius is ``sup limsup exp(beta t) ||x_e(t)||`` with the beta of the trigger, so with the static trigger it is the
    radius of the ball that the paper speaks of.
    """

    analysis: Analysis

    # --- rates -------------------------------------------------------------------------------------------------------

    def tree_bound(self, form: BoundForm) -> ConvergenceBound:
        """Theorem 2 along the tree of the analysis, for the trigger's own threshold and decay."""
        return self._bound(self.analysis.scenario, form)

    def _bound(self, scenario: Scenario, form: BoundForm) -> ConvergenceBound:
        analysis = self.analysis
        constants = analysis.tree_weights if form is BoundForm.PRINTED else analysis.tree_coordinates
        return convergence_bound(scenario, form, analysis.tree, analysis.window, constants)

    @cached_property
    def printed(self) -> ConvergenceBound:
        """As printed."""
        return self.tree_bound(BoundForm.PRINTED)

    @cached_property
    def valid(self) -> ConvergenceBound:
        """As valid."""
        return self.tree_bound(BoundForm.VALID)

    @cached_property
    def improved_rate(self) -> float:
        """Rate [1/s] of the tree-free gamma* (audit, section 3 (ii)); 0.0 without persistent excitation."""
        return rate_of_contraction(self.analysis.improved_contraction, self.analysis.window)

    @cached_property
    def floquet_rate(self) -> float | None:
        """Exact rate [1/s]; None without a period."""
        spectrum = self.analysis.spectrum
        return None if spectrum is None else spectrum.rate

    @property
    def floquet_overshoot(self) -> float | None:
        """``sup ||phi(t, s)|| e^{r (t - s)}`` with the exact rate r; None without a period."""
        return self.analysis.overshoot if self.analysis.is_periodic else None

    # --- errors ------------------------------------------------------------------------------------------------------

    @cached_property
    def parts(self) -> Envelope | None:
        """Pairs (c, beta) that bound the errors, see `envelope`; None if there are none."""
        scenario = self.analysis.scenario
        if scenario.trigger.kind is not TriggerKind.SAMPLED or not scenario.channel.ideal:
            return envelope(scenario)
        reach = self._sampled_reach
        if reach is None:
            return None
        decay = scenario.trigger.decay
        degrees = self.analysis.moved_degrees().tolist()
        omega = float(np.max(self.analysis.largest_weights))
        c = sampled_threshold(scenario, reach, self._peaks(decay)[0], degrees, omega)
        return None if c is None else ((c, decay),)

    @property
    def _sampled_reach(self) -> float | None:
        """R for the threshold ``exp(-beta t)``: the lesser of the exact radius and the energy bound."""
        decay = self.analysis.scenario.trigger.decay
        worst, energy = self._worst(decay), energy_radius(self.analysis, decay)
        return None if worst is None or energy is None else min(worst.radius * worst.cover, energy)

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

    def _worst(self, decay: float) -> WorstCase | None:
        rate = self.floquet_rate
        if rate is not None and (decay >= rate or self.is_beyond_reach(decay)):
            return None
        return self.analysis.worst(decay)

    def is_beyond_reach(self, decay: float) -> bool:
        """Whether errors of so many earlier cycles count that the exact worst case is not computed."""
        rate = self.floquet_rate
        return rate is not None and 0 < (rate - decay) * self.analysis.cycle < _LEAST_FORGOTTEN

    def _peaks(self, decay: float) -> tuple[float, NDArray[np.float64]]:
        known: dict[float, tuple[float, NDArray[np.float64]]] = self.__dict__.setdefault("_known_peaks", {})
        if decay not in known:
            known[decay] = initial_peaks(self.analysis, decay)
        return known[decay]

    @property
    def slowest(self) -> Envelope:
        """The parts of the errors that decay most slowly: they decide about the radius."""
        parts = self.parts or ()
        return tuple((c, decay) for c, decay in parts if decay == min(b for _, b in parts))

    @property
    def passing_radii(self) -> tuple[tuple[float, float], ...]:
        """Pairs (R, b): the parts of the errors that decay faster than the slowest add at most ``R exp(-b t)``."""
        found = []
        for c, decay in self.parts or ():
            if (c, decay) in self.slowest:
                continue
            # Beyond the rate no radius exists; the same part is also below one that decays half as fast as the rate.
            worst = self._worst(decay)
            carrier = decay if worst is not None else 0.5 * (self.floquet_rate or 0.0)
            worst = worst or self._worst(carrier)
            if worst is not None:
                found.append((c * worst.radius * worst.cover, carrier))
        return tuple(found)

    # --- radius ------------------------------------------------------------------------------------------------------

    @property
    def printed_radius(self) -> float | None:
        """``rho kappa_2`` as printed; None unless beta is below the printed rate."""
        bound = self.printed
        return None if bound.kappa2 is None else bound.rho * bound.kappa2

    @property
    def valid_radius(self) -> float | None:
        """``rho kappa_2*`` (audit, section 5.2); None unless beta is below the valid rate."""
        return self._sum(self._valid_part)

    def _valid_part(self, decay: float) -> float | None:
        bound = self._part_bound(1.0, decay)
        if bound.kappa2 is None or decay >= bound.rate:
            return None
        return bound.rho * bound.kappa2

    @property
    def improved_radius(self) -> float | None:
        """``c c_n k nubar e^{beta T}/(1 - e^{beta T} sqrt q)`` with ``q = 1 - gamma*`` (audit, end of section 5.2)."""
        analysis, root = self.analysis, math.sqrt(1 - self.analysis.improved_contraction)
        strength = analysis.edge_gain * analysis.box_gain * analysis.scenario.network.gain

        def part(decay: float) -> float | None:
            growth = math.exp(min(decay * analysis.window, 700.0))
            return (
                strength * analysis.disagreement.mu2_bar * growth / (1 - growth * root) if growth * root < 1 else None
            )

        return self._sum(part)

    @property
    def energy_radius(self) -> float | None:
        """See `hybrid_model.consensus.certificates.energy.energy_radius`."""
        return self._sum(lambda decay: energy_radius(self.analysis, decay))

    @property
    def exact_radius(self) -> float | None:
        """See `hybrid_model.consensus.exact.worst_case`."""
        return self._sum(self.exact_part)

    def exact_part(self, decay: float) -> float | None:
        """The exact radius for the threshold ``exp(-decay t)``; None if it does not exist."""
        worst = self._worst(decay)
        return None if worst is None else worst.radius

    @property
    def exact_worst(self) -> WorstCase | None:
        """The worst case behind the exact radius, for the slowest part of the errors; None without one."""
        return self._worst(self.slowest[0][1]) if self.slowest else None

    def _sum(self, part: Callable[[float], float | None]) -> float | None:
        if self.parts is None:
            return None
        total = 0.0
        for c, decay in self.slowest:
            radius = part(decay)
            if radius is None:
                return None
            total += c * radius
        return total

    # --- minimum gap -------------------------------------------------------------------------------------------------

    @property
    def printed_gap(self) -> float | None:
        """The paper's closing formula; None unless beta is below the printed rate."""
        bound, trigger = self.printed, self.analysis.scenario.trigger
        if bound.kappa1 is None or bound.kappa2 is None or bound.kappa1 + bound.kappa2 <= 0:
            return None
        return printed_gap(trigger.threshold, trigger.decay, self.printed_speed, bound.kappa1, bound.kappa2)

    @property
    def printed_speed(self) -> float:
        """``k rho omega ||D||`` [1/s] of the printed gap."""
        network = self.analysis.scenario.network
        norm = float(np.linalg.norm(incidence(network.agents, network.underlying_edges), 2))
        return network.gain * self.printed.rho * float(np.max(self.analysis.largest_weights)) * norm

    @property
    def valid_gap(self) -> float | None:
        """Lambert form with the valid radius and the degrees (audit, section 6)."""
        return self._least_gap(self._valid_part_gap)

    @property
    def improved_gap(self) -> float | None:
        """Logarithmic form with the best bound per edge, or the excitation-aware form if it is larger."""
        return self._least_gap(self._improved_part_gap)

    def gap_until(self, end: float) -> float | None:
        """A gap [s] that no two broadcasts up to `end` [s] fall short of, for every beta >= 0 (audit, section 6)."""
        parts = self.parts
        if not parts or self._worst(0.0) is None:
            return None
        last = sum(c * math.exp(-decay * end) for c, decay in parts)
        return self._improved_part_gap(sum(c for c, _ in parts), 0.0, with_initial=True, threshold=last)

    def _least_gap(self, part: _PartGap) -> float | None:
        trigger, gap = self.analysis.scenario.trigger, self._threshold_gap(part)
        if trigger.kind in (TriggerKind.SAMPLED, TriggerKind.PERIODIC):
            # Whatever the errors do, broadcasts are at multiples of the period.
            return max(gap or 0.0, trigger.period)
        return gap

    def _threshold_gap(self, part: _PartGap) -> float | None:
        parts = self.parts
        if not parts:
            return None
        carrier = min(decay for _, decay in parts)
        trigger = self.analysis.scenario.trigger
        # Sampled checks let errors grow beyond the threshold, and still a broadcast needs an error of the threshold.
        level = trigger.threshold if trigger.kind is TriggerKind.SAMPLED else None
        gaps = [part(c, decay, with_initial=decay == carrier, threshold=level) for c, decay in parts]
        known = [gap for gap in gaps if gap is not None]
        found = [min(known)] if len(known) == len(parts) else []
        # Errors also stay below the sum of all c, and thresholds above those that do not decay.
        lasting = sum(c for c, decay in parts if decay == 0)
        if lasting and len(parts) > 1:
            whole = part(sum(c for c, _ in parts), 0.0, with_initial=True, threshold=lasting)
            found += [] if whole is None else [whole]
        gap = max(found, default=math.inf)
        return gap if math.isfinite(gap) else None

    def _valid_part_gap(
        self, c: float, decay: float, *, with_initial: bool, threshold: float | None = None
    ) -> float | None:
        bound = self._part_bound(c, decay)
        if bound.kappa1 is None or bound.kappa2 is None or decay >= bound.rate:
            return None
        start = max(bound.kappa1, 0.0) if with_initial else 0.0
        speeds = self._speeds_by_degree(bound.rho * (start + bound.kappa2), c)
        return frozen_gap(c if threshold is None else threshold, decay, float(np.max(speeds)))

    def _improved_part_gap(
        self, c: float, decay: float, *, with_initial: bool, threshold: float | None = None
    ) -> float | None:
        worst = self._worst(decay)
        if worst is None:
            return None
        analysis, network = self.analysis, self.analysis.scenario.network
        norm, pairs = self._peaks(decay) if with_initial else (0.0, np.zeros(len(network.edges)))
        energy = energy_radius(analysis, decay)
        radius = min(worst.radius * worst.cover, math.inf if energy is None else energy) * c + norm
        bound = self._part_bound(c, decay)
        if bound.kappa1 is not None and bound.kappa2 is not None and decay < bound.rate:
            start = max(bound.kappa1, 0.0) if with_initial else 0.0
            radius = min(radius, bound.rho * (start + bound.kappa2))
        reached = worst.cover * np.array([worst.pairs[edge] for edge in network.edges])
        widths = np.minimum(c * reached + pairs, radius)
        by_degree = self._speeds_by_degree(radius, c)
        per_edge = network.gain * (widths + 2 * c)
        level = c if threshold is None else threshold
        speeds = np.array(
            [
                min(
                    float(by_degree[i - 1]),
                    float(per_edge @ (analysis.largest_weights * [i in e for e in network.edges])),
                )
                for i in range(1, network.agents + 1)
            ]
        )
        gap = math.inf
        for place in np.argsort(-speeds).tolist():
            safe = growing_gap(level, decay, float(speeds[place]))
            if safe >= gap or analysis.is_constant:
                gap = min(gap, safe)
                continue
            # A gap of a hundred cycles is as good as none: the search ends there.
            most = min(gap, safe + 100 * analysis.cycle)
            gap = excited_gap(analysis, level, decay, per_edge, place + 1, safe, most)
        return gap

    def _speeds_by_degree(self, radius: float, c: float) -> NDArray[np.float64]:
        """``K_i = k omega (sqrt(d_i) R + 2 c d_i)`` of each agent."""
        degrees = self.analysis.moved_degrees()
        omega = float(np.max(self.analysis.largest_weights))
        return np.asarray(self.analysis.scenario.network.gain * omega * (np.sqrt(degrees) * radius + 2 * c * degrees))

    def _part_bound(self, c: float, decay: float) -> ConvergenceBound:
        return self._bound(with_threshold(self.analysis.scenario, c, decay), BoundForm.VALID)


def with_threshold(scenario: Scenario, c: float, decay: float) -> Scenario:
    """The same network with the threshold ``c exp(-decay t)``."""
    kind = TriggerKind.STATIC if decay == 0 else TriggerKind.DYNAMIC
    return replace(scenario, trigger=Trigger(kind, c, decay))

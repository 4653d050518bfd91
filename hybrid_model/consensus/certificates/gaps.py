"""Lower bounds on the time between two broadcasts of one agent: printed, valid, improved (audit, section 6)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.energy import energy_radius
from hybrid_model.consensus.certificates.envelopes import Envelope
from hybrid_model.consensus.certificates.excited_gap import excited_gap
from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.scenario.own_trigger import OwnTrigger
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["Gaps", "frozen_gap", "growing_gap", "printed_gap"]


def printed_gap(threshold: float, decay: float, speed: float, kappa1: float, kappa2: float) -> float:
    """Solution of ``gamma e^{beta gamma} = c/(k rho omega ||D|| (kappa1 + kappa2))``, as the paper's section 5 ends.

    Parameters
    ----------
    threshold, decay : float
        c and beta [1/s] of the trigger.
    speed : float
        ``k rho omega ||D||`` [1/s].
    kappa1, kappa2 : float
        Of the printed bound. kappa1 is negative as a rule, and then this number is not a lower bound.
    """
    return frozen_gap(threshold, decay, speed * (kappa1 + kappa2))


def frozen_gap(threshold: float, decay: float, speed: float) -> float:
    """Solution g [s] of ``g e^{beta g} = c/K``: the state moves with K e^{-beta t1} throughout the gap.

    Parameters
    ----------
    threshold, decay : float
        c and beta [1/s].
    speed : float
        K, a bound on ``|x_i'(t)| e^{beta t}``.
    """
    if speed <= 0:
        return math.inf
    if decay == 0:
        return threshold / speed
    return float(lambertw(decay * threshold / speed).real) / decay


def growing_gap(threshold: float, decay: float, speed: float) -> float:
    """``ln(1 + beta c/K)/beta`` [s], or ``c/K``: the state moves with ``K e^{-beta t}``; never below `frozen_gap`."""
    if speed <= 0:
        return math.inf
    if decay == 0:
        return threshold / speed
    return math.log1p(decay * threshold / speed) / decay


@dataclass(frozen=True)
class _Term:
    """An exponential ``c exp(-decay t)`` of the bound on the errors, and what a gap has to know of it.

    Parameters
    ----------
    c, decay : float
        The term.
    level : float
        A broadcast needs an error of ``level exp(-decay t)``.
    has_start : bool
        Whether the share of the initial state counts with this term.
    """

    c: float
    decay: float
    level: float
    has_start: bool


@dataclass(frozen=True, eq=False)
class Gaps:
    """Minimum gaps [s] in every form, from the bounds on the states; None where one does not exist."""

    bounds: Bounds

    @property
    def printed(self) -> float | None:
        """The paper's closing formula; None unless beta is below the printed rate."""
        bound, trigger = self.bounds.printed, self.bounds.analysis.scenario.trigger
        if bound.kappa1 is None or bound.kappa2 is None or bound.kappa1 + bound.kappa2 <= 0:
            return None
        return printed_gap(trigger.threshold, trigger.decay, self.printed_speed, bound.kappa1, bound.kappa2)

    @property
    def printed_speed(self) -> float:
        """``k rho omega ||D||`` [1/s] of the printed gap."""
        analysis = self.bounds.analysis
        network = analysis.scenario.network
        norm = float(np.linalg.norm(incidence(network.agents, network.underlying_edges), 2))
        return network.gain * self.bounds.printed.rho * float(np.max(analysis.largest_weights)) * norm

    @property
    def valid(self) -> float | None:
        """Lambert form with the valid radius and the degrees (audit, section 6)."""
        return self._least(self._valid)

    @property
    def improved(self) -> float | None:
        """Logarithmic form with the best bound per edge, or the excitation-aware form if it is larger."""
        return self._least(self._improved)

    def until(self, end: float) -> float | None:
        """A gap [s] that no two broadcasts up to `end` [s] fall short of, for every beta >= 0 (audit, section 6)."""
        envelope = self.bounds.envelope
        if not envelope or (self.bounds.worst(0.0) is None and not self.bounds.is_left_out(0.0)):
            return None
        needed = self._needed
        if not needed:
            return None
        last = sum(c * math.exp(-decay * end) for c, decay in needed)
        return self._improved(_Term(sum(c for c, _ in envelope), 0.0, last, has_start=True))

    def _least(self, gap_of: Callable[[_Term], float | None]) -> float | None:
        trigger, gap = self.bounds.analysis.scenario.trigger, self._of_thresholds(gap_of)
        if trigger.kind in (TriggerKind.SAMPLED, TriggerKind.PERIODIC):
            # Whatever the errors do, broadcasts are at multiples of the period.
            return max(gap or 0.0, trigger.period)
        return gap

    @property
    def _needed(self) -> Envelope:
        """Pairs (c, beta): a broadcast needs an error of their sum ``c exp(-beta t)``; empty if that is not known."""
        trigger = self.bounds.analysis.scenario.trigger
        if isinstance(trigger, OwnTrigger):
            return () if trigger.least_error is None else trigger.least_error.exponentials
        if trigger.kind is TriggerKind.SAMPLED:
            # Checks let errors grow beyond the threshold, and still a broadcast needs an error of the threshold.
            return trigger.threshold_in_time.exponentials
        return self.bounds.envelope or ()

    def _of_thresholds(self, gap_of: Callable[[_Term], float | None]) -> float | None:
        envelope, needed = self.bounds.envelope, self._needed
        if not envelope or not needed:
            return None
        slowest, levels = min(decay for _, decay in envelope), {decay: c for c, decay in needed}
        found = []
        # Error and threshold are compared term by term, which takes the same terms in both.
        if list(levels) == [decay for _, decay in envelope]:
            gaps = [gap_of(_Term(c, decay, levels[decay], has_start=decay == slowest)) for c, decay in envelope]
            known = [gap for gap in gaps if gap is not None]
            found += [min(known)] if len(known) == len(gaps) else []
        # Errors also stay below the sum of all c, and thresholds above those that do not decay.
        lasting = sum(c for c, decay in needed if decay == 0)
        if lasting and (len(envelope) > 1 or not found):
            whole = gap_of(_Term(sum(c for c, _ in envelope), 0.0, lasting, has_start=True))
            found += [] if whole is None else [whole]
        gap = max(found, default=math.inf)
        return gap if math.isfinite(gap) else None

    def _valid(self, term: _Term) -> float | None:
        radius = self._theorem_radius(term)
        if radius is None:
            return None
        return frozen_gap(term.level, term.decay, float(np.max(self._speeds_by_degree(radius, term.c))))

    def _improved(self, term: _Term) -> float | None:
        worst = self.bounds.worst(term.decay)
        if worst is None and not self.bounds.is_left_out(term.decay):
            return None
        analysis, c, decay = self.bounds.analysis, term.c, term.decay
        network = analysis.scenario.network
        norm, pairs = self.bounds.initial_peaks(decay) if term.has_start else (0.0, np.zeros(len(network.edges)))
        energy, theorem = energy_radius(analysis, decay), self._theorem_radius(term)
        exact = math.inf if worst is None else worst.radius * worst.cover
        radius = min(exact, math.inf if energy is None else energy) * c + norm
        radius = radius if theorem is None else min(radius, theorem)
        if not math.isfinite(radius):
            return None
        reached = np.full(len(network.edges), math.inf)
        if worst is not None:
            reached = worst.cover * np.array([worst.pairs[edge] for edge in network.edges])
        per_edge = network.gain * (np.minimum(c * reached + pairs, radius) + 2 * c)
        touches = incidence(network.agents, network.edges) != 0
        speeds = np.minimum(self._speeds_by_degree(radius, c), (touches * analysis.largest_weights) @ per_edge)
        gap = math.inf
        for place in np.argsort(-speeds).tolist():
            safe = growing_gap(term.level, decay, float(speeds[place]))
            if safe >= gap or analysis.is_constant:
                gap = min(gap, safe)
                continue
            # A gap of a hundred cycles is as good as none: the search ends there.
            most = min(gap, safe + 100 * analysis.cycle)
            gap = excited_gap(analysis, term.level, decay, per_edge, place + 1, safe, most)
        return gap

    def _theorem_radius(self, term: _Term) -> float | None:
        """``rho (kappa_1 + kappa_2)`` of the valid form, kappa_1 where the initial state counts; None without it."""
        bound = self.bounds.theorem(term.c, term.decay)
        if bound.kappa1 is None or bound.kappa2 is None or term.decay >= bound.rate:
            return None
        return bound.rho * ((max(bound.kappa1, 0.0) if term.has_start else 0.0) + bound.kappa2)

    def _speeds_by_degree(self, radius: float, c: float) -> NDArray[np.float64]:
        """``K_i = k omega (sqrt(d_i) R + 2 c d_i)`` of each agent."""
        analysis = self.bounds.analysis
        degrees, omega = analysis.moved_degrees(), float(np.max(analysis.largest_weights))
        return np.asarray(analysis.scenario.network.gain * omega * (np.sqrt(degrees) * radius + 2 * c * degrees))

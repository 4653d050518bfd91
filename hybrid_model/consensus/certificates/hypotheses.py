"""The hypotheses of the convergence results, checked on a scenario, with a sentence about where each fails."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.components import active_edges, connected_components, listed
from hybrid_model.consensus.certificates.envelopes import error_envelope, slowest_decay
from hybrid_model.consensus.certificates.idle_windows import idle_tree_edges, idle_window
from hybrid_model.consensus.messages import enumerated
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["CheckedHypothesis", "Hypothesis", "bound_hypotheses", "follows_paper", "network_hypotheses"]

_PAPER_LAWS = (TriggerKind.STATIC, TriggerKind.DYNAMIC, TriggerKind.SELF_TRIGGERED)
"""Laws whose runs are those of the paper's static or dynamic trigger."""


class Hypothesis(enum.StrEnum):
    """A hypothesis of the convergence results: the words that tell the user, and where it is stated."""

    source: str

    CONNECTED_UNION = "connected union", "paper, theorem 2 and corollary 1"
    PERIODIC_WEIGHTS = "periodic weights", "audit, section 7"
    PAPER_TRIGGER = "trigger of the paper", "paper, section 4"
    IDEAL_CHANNEL = "ideal channel", "paper, section 4"
    BOUNDED_ERRORS = "bounded errors", "paper, section 4, bound on the errors"
    EXCITING_TREE = "exciting tree", "paper, theorem 2"
    PERSISTENT_EXCITATION = "persistent excitation", "audit, section 3 (ii)"
    BETA_BELOW_PRINTED = "beta below the printed rate", "paper, theorem 2"
    BETA_BELOW_VALID = "beta below the valid rate", "audit, sections 5 and 6"
    BETA_BELOW_IMPROVED = "beta below the improved rate", "audit, sections 5 and 6"
    BETA_BELOW_FLOQUET = "beta below the Floquet rate", "audit, sections 5 and 6"

    def __new__(cls, words: str, source: str) -> Hypothesis:
        """A member whose value is its words."""
        member = str.__new__(cls, words)
        member._value_ = words
        member.source = source
        return member


@dataclass(frozen=True)
class CheckedHypothesis:
    """One hypothesis on one scenario.

    Parameters
    ----------
    name : Hypothesis
        Which one.
    holds : bool
        Whether it holds.
    detail : str
        The numbers that decide; where it fails if it does.
    source : str
        Where it is stated.
    """

    name: Hypothesis
    holds: bool
    detail: str
    source: str

    @property
    def failure(self) -> str:
        """The sentence on a hypothesis that does not hold."""
        return f"Hypothesis '{self.name}' fails: {self.detail}"


def follows_paper(scenario: Scenario) -> bool:
    """Whether trigger and channel are those that the paper's theorems are about."""
    return scenario.trigger.kind in _PAPER_LAWS and scenario.channel.ideal


def network_hypotheses(scenario: Scenario, cycle: float) -> list[CheckedHypothesis]:
    """Hypotheses on graph, weights, channel and trigger that need no constants.

    Parameters
    ----------
    scenario : Scenario
        What is checked.
    cycle : float
        Length [s] of the interval from t = 0 over which the union of the graphs is taken.
    """
    components = connected_components(scenario, cycle)
    period, kind, ideal = scenario.edge_weights.period, scenario.trigger.kind, scenario.channel.ideal
    is_papers = kind in _PAPER_LAWS
    is_bounded = error_envelope(scenario) is not None or (kind is TriggerKind.SAMPLED and ideal)
    joined = "joins all agents" if len(components) == 1 else f"falls into the parts {listed(components)} of the agents"
    return [
        _check(
            Hypothesis.CONNECTED_UNION,
            len(components) == 1,
            f"The union of the graphs over {cycle:.6g} s {joined}.{_weak_edges(scenario, cycle)}",
        ),
        _check(
            Hypothesis.PERIODIC_WEIGHTS,
            period is not None,
            "The weights are constant."
            if period == 0
            else f"The weights have the period {period:.6g} s."
            if period is not None
            else f"The weights have no period; constants hold for the run up to {scenario.stop_time:.6g} s only.",
        ),
        _check(
            Hypothesis.PAPER_TRIGGER,
            is_papers,
            f"The trigger is '{scenario.trigger.name}'"
            + ("." if is_papers else "; the paper's theorems are about the static and the dynamic one."),
        ),
        _check(
            Hypothesis.IDEAL_CHANNEL,
            ideal,
            "Broadcasts arrive at once."
            if ideal
            else "Broadcasts are delayed or lost, so neighbours hold different copies and the average can drift.",
        ),
        _check(
            Hypothesis.BOUNDED_ERRORS,
            is_bounded,
            "The trigger keeps every error below a function of time that is known in advance."
            if is_bounded
            else "No bound on the errors is known in advance.",
        ),
    ]


def bound_hypotheses(bounds: Bounds) -> list[CheckedHypothesis]:
    """Excitation of the tree and of the whole network, bounded errors, and how beta compares with each rate.

    Parameters
    ----------
    bounds : Bounds
        Of a scenario whose union of graphs is connected.
    """
    analysis = bounds.analysis
    constants, decay = analysis.tree_weights, slowest_decay(analysis.scenario)
    excited, all_excited = bounds.printed.rate > 0, bounds.improved_rate > 0
    found = [
        _check(
            Hypothesis.EXCITING_TREE,
            excited,
            f"The weights of the tree with the edges [{enumerated(analysis.tree.tree)}] have "
            f"mu1 = {constants.mu1:.6g}, mu2 = {constants.mu2:.6g} over every window of T = {constants.window:.6g} s"
            + ("." if excited else f": {idle_tree_edges(analysis)}"),
        ),
        _check(
            Hypothesis.PERSISTENT_EXCITATION,
            all_excited,
            f"The matrix N has mu1 = {analysis.disagreement.mu1:.6g} over every window of T = {analysis.window:.6g} s"
            + ("." if all_excited else f": {idle_window(analysis)}"),
        ),
    ]
    reason = _unbounded(bounds)
    if reason is not None:
        found.append(CheckedHypothesis(Hypothesis.BOUNDED_ERRORS, False, reason, "audit, section 11.7"))
    rates = {
        Hypothesis.BETA_BELOW_PRINTED: ("printed", bounds.printed.rate),
        Hypothesis.BETA_BELOW_VALID: ("valid", bounds.valid.rate),
        Hypothesis.BETA_BELOW_IMPROVED: ("improved", bounds.improved_rate),
        Hypothesis.BETA_BELOW_FLOQUET: ("Floquet", bounds.floquet_rate),
    }
    return found + [
        _check(hypothesis, decay < rate, f"beta is {decay:.6g}/s, the {form} rate {rate:.6g}/s.")
        for hypothesis, (form, rate) in rates.items()
        if rate is not None
    ]


def _check(hypothesis: Hypothesis, holds: bool, detail: str) -> CheckedHypothesis:
    return CheckedHypothesis(hypothesis, holds, detail, hypothesis.source)


def _weak_edges(scenario: Scenario, cycle: float) -> str:
    """A sentence on edges whose weight is positive and yet too small to be told from rounding; or nothing."""
    ever = np.zeros(len(scenario.network.edges), dtype=bool)
    for piece in scenario.edge_weights.pieces(0.0, cycle):
        ever |= piece.amplitudes > 0
    ever &= scenario.edge_weights.integral(0.0, cycle) > 0
    weak = sorted(set(np.flatnonzero(ever).tolist()) - set(active_edges(scenario, cycle)))
    if not weak:
        return ""
    names = enumerated(edge + 1 for edge in weak)
    carries = f"Edge {names} carries" if len(weak) == 1 else f"Edges {names} carry"
    return f" {carries} less than a share of 1e-12 of the largest integrated weight, which counts as none."


def _unbounded(bounds: Bounds) -> str | None:
    """Why sampled checks keep the errors below no known bound; None if they do, or if the trigger is another."""
    scenario = bounds.analysis.scenario
    trigger = scenario.trigger
    if trigger.kind is not TriggerKind.SAMPLED or not scenario.channel.ideal or bounds.envelope is not None:
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

"""The hypotheses of the convergence results, checked on a scenario, with a sentence about where each fails."""

from __future__ import annotations

from dataclasses import dataclass

from hybrid_model.consensus.analysis import Analysis, connected_parts
from hybrid_model.consensus.envelopes import envelope
from hybrid_model.consensus.scenario_data import Scenario
from hybrid_model.consensus.trigger_data import TriggerKind

__all__ = ["PAPER_LAWS", "Hypothesis", "network_hypotheses", "rate_hypotheses"]

PAPER_LAWS = (TriggerKind.STATIC, TriggerKind.DYNAMIC, TriggerKind.SELF_TRIGGERED)
"""Laws whose runs are those of the paper's static or dynamic trigger."""


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
    parts = connected_parts(scenario, cycle)
    period, kind = scenario.edge_weights.period, scenario.trigger.kind
    is_bounded = envelope(scenario) is not None or (kind is TriggerKind.SAMPLED and scenario.channel.ideal)
    joined = "joins all agents" if len(parts) == 1 else f"falls into the parts {_listing(parts)} of the agents"
    return [
        Hypothesis(
            "connected union",
            len(parts) == 1,
            f"The union of the graphs over {cycle:.6g} s {joined}.",
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


def rate_hypotheses(
    analysis: Analysis, printed_rate: float, valid_rate: float, improved_rate: float
) -> list[Hypothesis]:
    """Excitation of the tree, and how beta compares with each rate.

    Parameters
    ----------
    analysis : Analysis
        The scenario; its union of graphs is connected.
    printed_rate, valid_rate, improved_rate : float
        [1/s]; 0.0 if the excitation is not persistent. The improved one counts where there is no Floquet rate.
    """
    constants = analysis.tree_weights
    decay = analysis.scenario.trigger.decay
    excited = printed_rate > 0
    found = [
        Hypothesis(
            "exciting tree",
            excited,
            f"The weights of the tree with the edges {list(analysis.tree.tree)} have mu1 = {constants.mu1:.6g}, "
            f"mu2 = {constants.mu2:.6g} over every window of T = {constants.window:.6g} s"
            + ("." if excited else ": in some window an edge of the tree carries no weight."),
            "paper, theorem 2",
        )
    ]
    rates = {"printed": printed_rate, "valid": valid_rate}
    if analysis.spectrum is not None:
        rates["Floquet"] = analysis.spectrum.rate
    else:
        rates["improved"] = improved_rate
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


def _listing(parts: list[list[int]]) -> str:
    return " and ".join("{" + ", ".join(map(str, part)) + "}" for part in parts)

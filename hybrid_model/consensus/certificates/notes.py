"""The sentences beside the numbers of `certify`: failed hypotheses, what remains true, refuted printed numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hybrid_model.consensus.certificates.analysis import Analysis
from hybrid_model.consensus.certificates.bounds import Bounds, with_threshold
from hybrid_model.consensus.certificates.forms import BOUNDS, Evidence, Quantity
from hybrid_model.consensus.certificates.gaps import Gaps
from hybrid_model.consensus.certificates.hypotheses import CheckedHypothesis, Hypothesis, follows_paper
from hybrid_model.consensus.certificates.observation import Observation
from hybrid_model.consensus.certificates.rates import corollary_rate, corollary_rate_exact
from hybrid_model.consensus.certificates.sizes import trees_cost
from hybrid_model.consensus.certificates.tree_bound import MOST_TREES, ConvergenceBound, TreeRadius, tree_radii
from hybrid_model.consensus.certificates.verdicts import statement
from hybrid_model.consensus.excitation.joint import joint_excitation
from hybrid_model.consensus.messages import enumerated
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.consensus.scenario.trigger import TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching

__all__ = ["scenario_notes"]

_NEGLIGIBLE = 0.01


def scenario_notes(bounds: Bounds, hypotheses: Sequence[CheckedHypothesis], seen: Observation | None) -> Iterator[str]:
    """All notes on a scenario whose union of graphs is connected."""
    for checked in hypotheses:
        if not checked.holds:
            yield f"{checked.failure} {_remains(checked.name, bounds)}".strip()
    yield from _constants(bounds)
    yield from _accuracy(bounds)
    yield from _corollary(bounds.analysis)
    yield from _radius_notes(bounds)
    yield from _refuted(bounds, seen)
    if seen is not None:
        counts, states = enumerated(seen.events_per_agent), enumerated(f"{x:.12f}" for x in seen.x_end)
        total = sum(seen.events_per_agent)
        yield f"The run up to {seen.end:.6g} s has {total} events, per agent {counts}, and ends in x = ({states})."
    if seen is not None and seen.radius is not None and seen.initial_share is not None:
        largest = max(bounds.exact_radius or 0.0, seen.radius)
        if bounds.analysis.is_periodic and seen.initial_share > _NEGLIGIBLE * largest:
            yield (
                f"The run ends early: the share of the initial state in ||x_e|| is still up to "
                f"{seen.initial_share:.6g} in its last cycle; the observed radius leaves that share out."
            )


def _remains(failed: Hypothesis, bounds: Bounds) -> str:
    """What is still true when a hypothesis fails."""
    scenario, is_periodic = bounds.analysis.scenario, bounds.analysis.is_periodic
    # What follows from rates above beta is about a threshold c exp(-beta t) on broadcasts that arrive at once.
    is_papers = follows_paper(scenario)
    match failed:
        case Hypothesis.PAPER_TRIGGER if scenario.trigger.kind is TriggerKind.CONTINUOUS:
            return "It has no events, so there is no gap to bound."
        case Hypothesis.EXCITING_TREE:
            return "The tree-free, energy and exact forms need no tree."
        case Hypothesis.PERIODIC_WEIGHTS:
            return "There is no Floquet rate; the exact radius is that of the run up to the stop time."
        case Hypothesis.BOUNDED_ERRORS if scenario.trigger.kind in (TriggerKind.SAMPLED, TriggerKind.PERIODIC):
            return "Only the rate of the network without errors and the period, as a gap, are certified."
        case Hypothesis.BOUNDED_ERRORS:
            return "Only the rate of the network without errors is certified."
        case Hypothesis.BETA_BELOW_PRINTED if is_papers:
            return "The printed bound does not exist; the exact form needs no beta below alpha_v."
        case Hypothesis.BETA_BELOW_VALID if is_papers:
            return _without_valid_factor(bounds.valid)
        case Hypothesis.BETA_BELOW_IMPROVED if is_papers and is_periodic:
            return "The improved radius does not exist; the energy bound and the exact form go by the Floquet rate."
        case Hypothesis.BETA_BELOW_IMPROVED if is_papers:
            return "The energy bound does not exist; the exact radius and the gap hold for the run up to the stop time."
        case Hypothesis.BETA_BELOW_FLOQUET if is_papers:
            return _without_uniform_gap(bounds, scenario.stop_time)
    return ""


def _without_valid_factor(bound: ConvergenceBound) -> str:
    if bound.kappa1 is None or bound.kappa2 is None:
        return ""
    rho, kappa1, kappa2 = bound.rho, bound.rho * bound.kappa1, bound.rho * bound.kappa2
    if bound.decay == bound.rate:
        shape = f"({rho * bound.transient:.6g} + {kappa2:.6g} (1 + t/{bound.window:.6g}))"
    else:
        shape = f"{kappa1:.6g}"
    return f"No valid factor of exp(-beta t) exists; still ||x_e(t)|| <= {shape} exp(-{bound.rate:.6g} t)."


def _without_uniform_gap(bounds: Bounds, end: float) -> str:
    gap = Gaps(bounds).until(end)
    still = "" if gap is None else f"; no two broadcasts of an agent up to {end:.6g} s are closer than {gap:.6g} s"
    return (
        "The threshold falls faster than disagreement can, so gaps shrink without a uniform bound. Consensus is "
        f"still reached, at the Floquet rate, and no Zeno behaviour occurs{still}."
    )


def _constants(bounds: Bounds) -> Iterator[str]:
    analysis = bounds.analysis
    window = analysis.window
    tree, m, n = analysis.tree_weights, analysis.tree_coordinates, analysis.disagreement
    yield (
        f"Excitation over every window of T = {window:.6g} s, tree [{enumerated(analysis.tree.tree)}]: "
        f"W_tau mu1 = {tree.mu1:.7g}, mu2 = {tree.mu2:.7g}; M mu1 = {m.mu1:.7g}, mu2 = {m.mu2:.7g}, "
        f"sup int ||M|| = {m.mu2_bar:.7g}; N mu1 = {n.mu1:.7g}, mu2 = {n.mu2:.7g}, sup int ||N|| = {n.mu2_bar:.7g}, "
        f"||int N||_F = {n.frobenius:.7g}."
    )
    scenario = analysis.scenario
    error = ""
    if bounds.envelope is not None:
        total = 2 * sum(c for c, _ in bounds.envelope) * math.sqrt(scenario.network.agents - 1)
        error = f" and C = 2 c sqrt(p) = {total:.7g}"
    yield (
        f"With this tree rho = {analysis.tree.rho:.7g}{error}; "
        f"||x_e(0)|| = {edge_norm(scenario, np.asarray(scenario.network.initial)):.7g}."
    )
    if analysis.spectrum is not None and not analysis.spectrum.is_scaled:
        multipliers = enumerated(f"{abs(value):.6g}" for value in analysis.spectrum.multipliers)
        yield f"Moduli of the Floquet multipliers over {analysis.spectrum.period:.6g} s: {multipliers}."


def _accuracy(bounds: Bounds) -> Iterator[str]:
    """How near the exact numbers are to what they stand for."""
    analysis = bounds.analysis
    if analysis.spectrum is not None and analysis.spectrum.is_scaled:
        yield (
            f"Over the long cycle of {analysis.spectrum.period:.6g} s all Floquet multipliers are below 1e-5; the "
            "rate is that of a product which is scaled on the way."
        )
    rate, worst = bounds.floquet_rate, bounds.exact_worst
    if rate is not None and bounds.slowest and bounds.slowest[0][1] < rate:
        near = (
            f"beta = {bounds.slowest[0][1]:.6g}/s is close to the Floquet rate {rate:.6g}/s, measured by the cycle of"
        )
        if bounds.is_beyond_reach(bounds.slowest[0][1]):
            yield (
                f"The exact radius and the improved gap are not computed: {near} {analysis.cycle:.6g} s, so errors of "
                "too many earlier cycles count."
            )
        if bounds.energy_radius is None:
            yield (
                f"The energy bound does not exist: {near} {analysis.cycle:.6g} s, and over no number of cycles that "
                "was tried does disagreement fall faster than the threshold."
            )
    if bounds.slowest and bounds.is_left_out(bounds.slowest[0][1]):
        yield (
            f"The exact radius is left out: for {analysis.scenario.network.agents} agents it would take "
            f"{analysis.worst_case_cost(bounds.slowest[0][1])}. The improved gap goes by the energy bound in its place."
        )
    if analysis.is_periodic and not analysis.has_overshoot:
        yield "The factor of the Floquet rate is left out: it would take too long for so many agents."
    if analysis.is_periodic and not analysis.has_exact_contraction:
        yield "The energy bound goes by gamma* in place of the exact contraction, which would take too long."
    if worst is None or not bounds.slowest:
        return
    fewer = ""
    if worst.resolution > analysis.resolution * (1 + 1e-12):
        fewer = f", in place of {analysis.resolution:.6g}: the cycle of {analysis.cycle:.6g} s would take too many"
    yield (
        f"The exact radius is reached from below: on cells of k ||int N|| <= {worst.resolution:.6g}{fewer}. It lacks a "
        f"share of the order of {worst.resolution**2:.1g}; the improved gap allows for {worst.cover - 1:.1g}."
    )


def _corollary(analysis: Analysis) -> Iterator[str]:
    """The repaired corollary on switching topologies."""
    if isinstance(analysis.scenario.switching, NoSwitching) or analysis.is_constant:
        return
    joint, gain = joint_excitation(analysis.scenario), analysis.scenario.network.gain
    yield (
        f"Corollary 1, repaired: {len(joint.intervals)} jointly connected intervals of at most {joint.longest:.6g} s, "
        f"least weight on a spanning tree of each w_min = {joint.weakest.weight:.6g}, window {joint.window:.6g} s: "
        f"mu1 of N is at least {joint.mu1_of_paths:.6g} (exactly {joint.exact.mu1:.6g}), the rate at least "
        f"{corollary_rate(joint, gain):.6g}/s (with the exact constants {corollary_rate_exact(joint, gain):.6g}/s)."
    )


def _radius_notes(bounds: Bounds) -> Iterator[str]:
    scenario = bounds.analysis.scenario
    found: list[TreeRadius] = []
    if bounds.envelope and scenario.trigger.threshold > 0:
        cost = trees_cost(scenario, MOST_TREES)
        if bounds.analysis.affords(cost):
            found = tree_radii(scenario, bounds.analysis.window)
        else:
            yield f"The bounds along all spanning trees are left out: {cost}."
    if len(found) > 1:
        least, most = min(found, key=lambda t: t.kappa2), max(found, key=lambda t: t.kappa2)
        best = min(found, key=lambda t: t.radius)
        yield (
            f"Over the {len(found)} exciting spanning trees, with beta = 0: kappa_2^m = {least.kappa2:.6g} (tree "
            f"[{enumerated(least.tree)}]), kappa_2^M = {most.kappa2:.6g} (tree [{enumerated(most.tree)}]); every "
            f"tree bounds the same x_e, so the least rho kappa_2 = {best.radius:.6g} (tree "
            f"[{enumerated(best.tree)}]) is a bound."
        )
    if bounds.envelope and scenario.trigger.threshold > 0 and all(decay > 0 for _, decay in bounds.envelope):
        held = with_threshold(scenario, scenario.trigger.threshold, 0.0)
        constant = Evidence(Bounds(bounds.analysis.alike(held)))
        numbers = {row.form: row.value(constant) for row in BOUNDS if row.quantity is Quantity.RADIUS and row.in_json}
        listing = ", ".join(f"{form} {value:.6g}" for form, value in numbers.items() if value is not None)
        yield (
            "The threshold decays, so x_e goes to 0 and the radii are factors of exp(-beta t). "
            f"With the threshold held at c = {scenario.trigger.threshold:.6g} (beta = 0) the radii are: {listing}."
        )


def _refuted(bounds: Bounds, seen: Observation | None) -> Iterator[str]:
    """Printed numbers that this very scenario contradicts, and those whose proof or statement fails in general."""
    printed, valid = bounds.printed, bounds.valid
    if printed.rate > valid.rate * (1 + 1e-9) > 0:
        yield (
            f"The printed rate {printed.rate:.6g}/s uses mu2 of W_tau where the proof needs mu2 of M; with that it is "
            f"{valid.rate:.6g}/s ({statement('b').remark})."
        )
    if bounds.floquet_rate is not None and printed.rate > bounds.floquet_rate * (1 + 1e-9):
        yield f"The printed rate {printed.rate:.6g}/s is false here: the Floquet rate is {bounds.floquet_rate:.6g}/s."
    scenario = bounds.analysis.scenario
    if not follows_paper(scenario):
        return
    gaps = Gaps(bounds)
    gap = gaps.printed
    if gap is not None and printed.kappa1 is not None and printed.kappa1 < 0:
        limit = scenario.trigger.threshold / (gaps.printed_speed * (printed.kappa2 or 1.0))
        yield (
            f"The printed minimum gap {gap:.6g} s is not one: kappa_1 = {printed.kappa1:.6g} is negative, so its "
            f"formula is not the least value of its own inequality, which tends to {limit:.6g} s; "
            "hybrid_model.consensus.certificates.counterexamples.minimum_gap() shows a run that violates the formula "
            f"({statement('e3').remark})."
        )
        if seen is not None and seen.min_gap is not None and gap > seen.min_gap:
            yield f"This run violates the printed minimum gap: two broadcasts are {seen.min_gap:.6g} s apart."
    exact = bounds.exact_radius
    if bounds.printed_radius is not None and exact is not None and bounds.printed_radius < exact * (1 - 1e-6):
        yield (
            f"The printed radius {bounds.printed_radius:.6g} does not hold for all errors within the threshold, some "
            f"reach {exact:.6g}; whether those of a run do is another question."
        )

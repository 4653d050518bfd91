"""`certify`: every bound of a scenario in every form, with its hypotheses, unit and source, beside what a run shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hybrid_model import HybridArc, Stop
from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.components import component_scenarios, connected_components
from hybrid_model.consensus.certificates.forms import FORMS, Certified, certified_values
from hybrid_model.consensus.certificates.hypotheses import Hypothesis, bound_hypotheses, network_hypotheses
from hybrid_model.consensus.certificates.notes import scenario_notes
from hybrid_model.consensus.certificates.observation import observe
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["Certificates", "certify"]

_JSON_FORMS = {
    "rate": ("printed", "valid", "improved", "floquet"),
    "radius": ("printed", "valid", "energy", "exact", "observed"),
    "min_gap": ("printed", "valid", "improved", "observed"),
}


@dataclass(frozen=True, eq=False)
class Certificates:
    """All bounds of a scenario.

    Attributes
    ----------
    scenario : Scenario
        What was certified.
    values : tuple of Certified
        All bounds in all forms.
    hypotheses : tuple of Hypothesis
        All that were checked.
    excitation : dict
        ``mu1``, ``mu2`` of the tree's weights and the window ``T`` [s]; None where unknown.
    notes : tuple of str
        Sentences: which hypothesis fails where, what remains true, which printed number is refuted.
    tree : tuple of int
        Edges, from 1, of the spanning tree of the tree-wise forms; empty without one.
    """

    scenario: Scenario
    values: tuple[Certified, ...]
    hypotheses: tuple[Hypothesis, ...]
    excitation: dict[str, float | None]
    notes: tuple[str, ...]
    tree: tuple[int, ...] = ()

    def value(self, quantity: str, form: str) -> float | None:
        """The value of one bound; KeyError if there is no such form."""
        for certified in self.values:
            if (certified.quantity, certified.form) == (quantity, form):
                return certified.value
        raise KeyError(f"there is no {form} {quantity}.")

    def as_dict(self) -> dict[str, Any]:
        """The object that ``certify --json`` prints."""
        table = {quantity: {f: self.value(quantity, f) for f in forms} for quantity, forms in _JSON_FORMS.items()}
        return {**table, "pe": dict(self.excitation), "notes": list(self.notes)}


def certify(
    scenario: Scenario,
    arc: HybridArc | None = None,
    *,
    tree: TreePartition | None = None,
    window: float | None = None,
    resolution: float = 0.01,
) -> Certificates:
    """Certify a scenario.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching, trigger.
    arc : HybridArc, optional
        A run of its closed loop, for the observed values.
    tree : TreePartition, optional
        Spanning tree of the tree-wise forms; by default the first in edge order whose edges all carry weight.
    window : float, optional
        T [s]; by default the period, a short time for constant weights, the best one for weights without a period.
    resolution : float
        Of the exact worst case, see `hybrid_model.consensus.exact.worst_case.ReachableSets`.
    """
    period = scenario.edge_weights.period
    cycle = scenario.stop_time if period is None else period or 1.0
    general = network_hypotheses(scenario, cycle)
    if len(connected_components(scenario, cycle)) > 1:
        return _in_parts(scenario, arc, general, cycle, resolution)
    analysis = analyse(scenario, tree, window, resolution)
    bounds = Bounds(analysis)
    # Where no radius exists, there is nothing to compare an observed one with.
    decay = None if bounds.exact_radius is None else min((beta for _, beta in bounds.slowest), default=0.0)
    seen = None if arc is None else observe(analysis, arc, decay, bounds.passing_radii)
    values = certified_values(bounds, seen)
    further = bound_hypotheses(bounds)
    # What the bounds show takes the place of what was known without them.
    known = {hypothesis.name for hypothesis in further}
    hypotheses = (*(hypothesis for hypothesis in general if hypothesis.name not in known), *further)
    constants = analysis.tree_weights
    return Certificates(
        scenario,
        values,
        hypotheses,
        {"mu1": constants.mu1, "mu2": constants.mu2, "T": constants.window},
        (*scenario_notes(bounds, hypotheses, seen), *_early_end(arc)),
        analysis.tree.tree,
    )


def _in_parts(
    scenario: Scenario, arc: HybridArc | None, hypotheses: list[Hypothesis], cycle: float, resolution: float
) -> Certificates:
    """No consensus of all: what holds for each part by itself."""
    broken = hypotheses[0]
    left = "There is no consensus of all agents; each part keeps its own mean."
    notes = [f"Hypothesis '{broken.name}' fails: {broken.detail} {left}"]
    gaps: dict[str, list[float | None]] = {"valid": [], "improved": []}
    touched = {agent for edge in _positive_edges(scenario, cycle) for agent in edge}
    for part, alone in component_scenarios(scenario, cycle):
        if alone is None and part[0] in touched:
            notes.append(f"Agent {part[0]} by itself: its edges count as absent, and nothing is certified about it.")
            for found in gaps.values():
                found.append(None)
            continue
        if alone is None:
            notes.append(f"Agent {part[0]} never moves and never broadcasts.")
            continue
        inner = certify(alone, resolution=resolution)
        for form, found in gaps.items():
            found.append(inner.value("min_gap", form))
        rate, radius = inner.value("rate", "floquet"), inner.value("radius", "exact")
        gap = inner.value("min_gap", "improved")
        who = f"Agents {', '.join(map(str, part))} by themselves:"
        notes.append(
            f"{who} Floquet rate {_text(rate, '1/s')}, exact radius over their own edges "
            f"{_text(radius, 'units of x')}, minimum gap {_text(gap, 's')}."
        )
        own = {hypothesis.name for hypothesis in hypotheses if not hypothesis.holds}
        notes += [
            f"{who} hypothesis '{h.name}' fails: {h.detail}"
            for h in inner.hypotheses
            if not h.holds and h.name not in own
        ]
    least: dict[str, float | None] = {}
    for form, found in gaps.items():
        known = [gap for gap in found if gap is not None]
        least[form] = min(known) if known and len(known) == len(found) else None
    observed = None if arc is None else run_report(scenario, arc).min_gap
    values = []
    for quantity, forms in FORMS.items():
        for form in forms:
            value = {"observed": observed, **least}.get(form) if quantity == "min_gap" else None
            unit = {"rate": "1/s", "radius": "unit of x", "min_gap": "s", "transient": "1"}[quantity]
            values.append(Certified(quantity, form, value, unit, "", ("connected union",)))
    notes += [f"Hypothesis '{h.name}' fails: {h.detail}" for h in hypotheses[1:] if not h.holds]
    notes += _early_end(arc)
    empty: dict[str, float | None] = {"mu1": 0.0, "mu2": None, "T": cycle}
    return Certificates(scenario, tuple(values), tuple(hypotheses), empty, tuple(notes))


def _early_end(arc: HybridArc | None) -> list[str]:
    """A sentence on a run that did not reach its stop time; what was observed is of that part only."""
    if arc is None or arc.stop is Stop.HORIZON:
        return []
    return [f"The run ended before the stop time, so what is observed is of its beginning only: {arc.message}"]


def _positive_edges(scenario: Scenario, cycle: float) -> list[tuple[int, int]]:
    """Edges that carry some weight, however little."""
    doses = scenario.edge_weights.integral(0.0, cycle)
    return [edge for edge, dose in zip(scenario.network.edges, doses, strict=True) if dose > 0]


def _text(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:.6g} {unit}"

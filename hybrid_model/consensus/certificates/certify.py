"""`certify`: every bound of a scenario in every form, with hypotheses and source (paper, section 5), beside a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hybrid_model import HybridArc, NetworkRun, Stop
from hybrid_model.consensus.certificates.analysis import PATIENCE, Analysis, analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.components import component_scenarios, connected_components, union_time
from hybrid_model.consensus.certificates.forms import BOUNDS, Certified, Form, Progress, Quantity, certified_values
from hybrid_model.consensus.certificates.hypotheses import (
    CheckedHypothesis,
    Hypothesis,
    bound_hypotheses,
    network_hypotheses,
)
from hybrid_model.consensus.certificates.notes import scenario_notes
from hybrid_model.consensus.certificates.observation import observe
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.runs.report import report_of
from hybrid_model.consensus.scenario.definition import Scenario, require_scenario
from hybrid_model.declare.calls import explained

__all__ = ["Certificates", "certify"]


@dataclass(frozen=True, eq=False)
class Certificates:
    """All bounds of a scenario.

    Attributes
    ----------
    scenario : Scenario
        What was certified.
    values : tuple of Certified
        All bounds in all forms.
    hypotheses : tuple of CheckedHypothesis
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
    hypotheses: tuple[CheckedHypothesis, ...]
    excitation: dict[str, float | None]
    notes: tuple[str, ...]
    tree: tuple[int, ...] = ()

    def value(self, quantity: str, form: str) -> float | None:
        """The value of one bound; KeyError if there is no such form."""
        known: dict[tuple[str, str], float | None] = {(each.quantity, each.form): each.value for each in self.values}
        if (quantity, form) not in known:
            raise KeyError(f"there is no {form} {quantity}.")
        return known[quantity, form]

    def as_dict(self) -> dict[str, Any]:
        """The object that ``certify --json`` prints."""
        table: dict[str, dict[str, float | None]] = {}
        for row in BOUNDS:
            if row.in_json:
                table.setdefault(row.quantity, {})[row.form] = self.value(row.quantity, row.form)
        return {**table, "pe": dict(self.excitation), "notes": list(self.notes)}


@explained(ScenarioError)
def certify(
    scenario: Scenario,
    arc: HybridArc | NetworkRun | None = None,
    *,
    tree: TreePartition | None = None,
    window: float | None = None,
    resolution: float = 0.01,
    patience: float = PATIENCE,
    progress: Progress | None = None,
    like: Analysis | None = None,
) -> Certificates:
    """Certify a scenario.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching, trigger.
    arc : HybridArc or NetworkRun, optional
        A run of its closed loop or of its agents as a network, for the observed values.
    tree : TreePartition, optional
        Spanning tree of the tree-wise forms; by default the first in edge order whose edges all carry weight.
    window : float, optional
        T [s]; by default the period, a short time for constant weights, the best one for weights without a period.
    resolution : float
        Of the exact worst case, see `hybrid_model.consensus.exact.worst_case.ReachableSets`.
    patience : float
        CPU time [s] that each quantity may take which grows faster than the cube of the number of agents, by an
        estimate from sizes; what would take longer is left out in networks of 16 agents or more, with a note. What does
        not fit into half of the memory is left out in any network.
    progress : callable, optional
        Called with the number of bounds that are computed, and of all.
    like : Analysis, optional
        Of the same network with this or another trigger, or with other initial states: what it knows is not computed
        again. Tree, window, resolution and patience are its own then.
    """
    require_scenario("certify", scenario)
    cycle = union_time(scenario)
    general = network_hypotheses(scenario, cycle)
    if len(connected_components(scenario, cycle)) > 1:
        return _in_components(scenario, arc, general, cycle, resolution, patience)
    if like is None:
        like = analyse(scenario, tree, window, resolution, patience)
    analysis = like if like.scenario is scenario else like.alike(scenario)
    bounds = Bounds(analysis)
    # Where no radius exists, there is nothing to compare an observed one with.
    decay: float | None = min((beta for _, beta in bounds.slowest), default=0.0)
    if bounds.exact_radius is None and not any(bounds.is_left_out(beta) for _, beta in bounds.slowest):
        decay = None
    seen = None if arc is None else observe(analysis, arc, decay, bounds.passing_radii)
    values = certified_values(bounds, seen, progress)
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


def _in_components(
    scenario: Scenario,
    arc: HybridArc | NetworkRun | None,
    hypotheses: list[CheckedHypothesis],
    cycle: float,
    resolution: float,
    patience: float,
) -> Certificates:
    """No consensus of all: what holds for each connected component by itself."""
    joined, *others = hypotheses
    notes = [f"{joined.failure} There is no consensus of all agents; each part keeps its own mean."]
    failed = {hypothesis.name for hypothesis in hypotheses if not hypothesis.holds}
    gaps: dict[str, list[float | None]] = {Form.VALID: [], Form.IMPROVED: []}
    touched = {agent for edge in _positive_edges(scenario, cycle) for agent in edge}
    for agents, alone in component_scenarios(scenario, cycle):
        if alone is not None:
            inner = certify(alone, resolution=resolution, patience=patience)
            notes += _component_notes(agents, inner, failed)
            for form, found in gaps.items():
                found.append(inner.value(Quantity.MIN_GAP, form))
        elif agents[0] in touched:
            notes.append(f"Agent {agents[0]} by itself: its edges count as absent, and nothing is certified about it.")
            for found in gaps.values():
                found.append(None)
        else:
            notes.append(f"Agent {agents[0]} never moves and never broadcasts.")
    known = {form: _least(found) for form, found in gaps.items()}
    known[Form.OBSERVED] = None if arc is None else report_of(scenario, arc).min_gap
    values = tuple(
        Certified(
            row.quantity,
            row.form,
            known.get(row.form) if row.quantity is Quantity.MIN_GAP else None,
            row.quantity.unit,
            "",
            (Hypothesis.CONNECTED_UNION,),
        )
        for row in BOUNDS
    )
    notes += [hypothesis.failure for hypothesis in others if not hypothesis.holds]
    empty: dict[str, float | None] = {"mu1": 0.0, "mu2": None, "T": cycle}
    return Certificates(scenario, values, tuple(hypotheses), empty, (*notes, *_early_end(arc)))


def _component_notes(agents: list[int], inner: Certificates, known: set[Hypothesis]) -> Iterator[str]:
    """The numbers of a component, and the hypotheses that fail for it and are not `known` to fail for all."""
    rate, radius = inner.value(Quantity.RATE, Form.FLOQUET), inner.value(Quantity.RADIUS, Form.EXACT)
    gap = inner.value(Quantity.MIN_GAP, Form.IMPROVED)
    who = f"Agents {', '.join(map(str, agents))} by themselves:"
    yield (
        f"{who} Floquet rate {_text(rate, '1/s')}, exact radius over their own edges "
        f"{_text(radius, 'units of x')}, minimum gap {_text(gap, 's')}."
    )
    for each in inner.hypotheses:
        if not each.holds and each.name not in known:
            yield f"{who} hypothesis '{each.name}' fails: {each.detail}"


def _least(gaps: list[float | None]) -> float | None:
    """The least gap if all are known."""
    known = [gap for gap in gaps if gap is not None]
    return min(known) if known and len(known) == len(gaps) else None


def _early_end(arc: HybridArc | NetworkRun | None) -> list[str]:
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

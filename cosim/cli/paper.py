"""`hybrid-fmu paper`: the paper's simulation section in three executions, compared, with figures."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hybrid_model as hm
from cosim.cli.exits import exit_of
from cosim.cli.outputs import results_folder
from cosim.cli.progress import Work
from cosim.consensus import fmu_system, in_process_system, network_report
from cosim.masters import run_event_exact, run_fixed_step
from cosim.result import CosimResult
from fmu.describe.variables import Fmi
from fmu.export import export_fmu
from hybrid_model.consensus.certificates.analysis import Analysis, analyse
from hybrid_model.consensus.certificates.certify import Certificates, certify
from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.figures.run import save_paper_figures
from hybrid_model.consensus.figures.style import require_formats
from hybrid_model.consensus.laws.closed_loop import agent_name, closed_loop, scenario_agents
from hybrid_model.consensus.runs.report import RunReport, edge_norm, run_report
from hybrid_model.consensus.scenario.definition import Scenario, replace_trigger
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.declare.variables import FloatArray

PRESET = "paper-a"
FIXED_STEPS = (0.1, 0.01, 0.001)
"""Communication steps in s of the comparison: what people use."""
COMPARE_INTERVAL = 0.5
"""In s: states of the executions are compared at multiples of this time."""
_EXPORT, _EXACT, _FIXED, _BOUNDS, _FIGURES = 1.0, 2.0, 0.01, 4.0, 8.0
"""About how long stages take: parts of the whole; a fixed step takes `_FIXED` over its length."""
_AGENTS = 4
_WORK = 2 * (1.0 + _AGENTS * _EXPORT + _EXACT + sum(_FIXED / step for step in FIXED_STEPS) + _BOUNDS) + _FIGURES


@dataclass(frozen=True)
class Trial:
    """One way to run a scenario, and how far it is from the run of all agents as one automaton.

    `event_time_difference` is None if the numbers of events differ.
    """

    name: str
    events: list[int]
    edge_norm_end: float
    event_time_difference: float | None
    state_difference: float


@dataclass(frozen=True)
class Comparison:
    """All executions of one scenario."""

    scenario: Scenario
    arc: hm.HybridArc
    report: RunReport
    fmus: list[str]
    exact: list[Trial]
    fixed: dict[float, Trial]
    bounds: dict[BoundForm, ConvergenceBound]
    certificates: Certificates


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    formats = options.figure_format or ["png", "pdf"]
    require_formats(formats)
    dynamic = load_scenario(PRESET)
    scenarios = {"static": replace_trigger(dynamic, "static"), "dynamic": dynamic}
    # Both have one network: what is known of it is computed once.
    analysis = analyse(scenarios["static"])
    with Work(_WORK) as work, results_folder(options.out, "paper") as out:
        comparisons = {kind: _compare(kind, scenario, analysis, out, work) for kind, scenario in scenarios.items()}
        work.begin("drawing the figures", _FIGURES)
        for kind, comparison in comparisons.items():
            bounds = list(comparison.bounds.values())
            save_paper_figures(kind, comparison.scenario, comparison.arc, bounds, out, comparison.certificates, formats)
        document = json.dumps(_summary(comparisons), indent=2)
        (out / "summary.json").write_text(document + "\n", encoding="utf-8")
    if options.json:
        print(document)
    else:
        print(_table(comparisons))
        print(f"\nFigures, FMUs and summary.json are in {options.out}.")
    return max(exit_of(comparison.report.stop) for comparison in comparisons.values())


def _compare(kind: str, scenario: Scenario, analysis: Analysis, out: Path, work: Work) -> Comparison:
    work.begin(f"{kind}: running as one automaton")
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    report = run_report(scenario, arc)
    fmus = _export(kind, scenario, out, work)
    work.begin(f"{kind}: co-simulating, event-exact", _EXACT)
    # One system for all its runs: each FMU is unpacked and loaded once.
    systems = {"automata in one process": in_process_system(scenario), "FMUs through fmpy": fmu_system(scenario, fmus)}
    exact = [
        _exact_trial(
            name, scenario, arc, report, run_event_exact(system, scenario.stop_time, output_interval=COMPARE_INTERVAL)
        )
        for name, system in systems.items()
    ]

    def watch(result: CosimResult) -> None:
        work.part(result.times[-1] / scenario.stop_time)

    fixed = {}
    for step in FIXED_STEPS:
        work.begin(f"{kind}: co-simulating, fixed step {step:g} s", _FIXED / step)
        counters = [f"{name}.events" for name in fmus]
        result = run_fixed_step(systems["FMUs through fmpy"], scenario.stop_time, step, record=counters, watch=watch)
        fixed[step] = _fixed_trial(step, scenario, report, result)
    bounds = {form: convergence_bound(scenario, form) for form in BoundForm}
    work.begin(f"{kind}: computing the bounds", _BOUNDS)
    names = [str(path.relative_to(out)) for path in fmus.values()]
    return Comparison(scenario, arc, report, names, exact, fixed, bounds, certify(scenario, arc, like=analysis))


def _export(kind: str, scenario: Scenario, out: Path, work: Work) -> dict[str, Path]:
    folder = out / "fmus" / kind
    folder.mkdir(parents=True, exist_ok=True)
    fmus = {}
    for name, automaton in scenario_agents(scenario).items():
        work.begin(f"{kind}: exporting {name}", _EXPORT)
        fmus[name] = export_fmu(automaton, folder / f"{name}.fmu", stop_time=scenario.stop_time)
    return fmus


def _exact_trial(name: str, scenario: Scenario, arc: hm.HybridArc, report: RunReport, result: CosimResult) -> Trial:
    other = network_report(scenario, result)
    names = [f"{agent_name(i)}.x" for i in range(1, scenario.network.agents + 1)]
    states = max(float(np.max(np.abs(arc.at(x, result.times) - result.signals[x]))) for x in names)
    times = _time_difference(report.event_times, other.event_times)
    return Trial(name, other.events_per_agent, other.edge_norm_end, times, states)


def _time_difference(expected: Sequence[FloatArray], found: Sequence[FloatArray]) -> float | None:
    """Largest difference between event times in s; None if the numbers of events differ."""
    if [len(times) for times in expected] != [len(times) for times in found]:
        return None
    pairs = zip(expected, found, strict=True)
    return max((float(np.max(np.abs(a - b), initial=0.0)) for a, b in pairs), default=0.0)


def _fixed_trial(step: float, scenario: Scenario, report: RunReport, result: CosimResult) -> Trial:
    names = [agent_name(i) for i in range(1, scenario.network.agents + 1)]
    x_end = np.array([result.final[f"{name}.x"] for name in names])
    # With event mode off nobody is told when an event was: its time is the communication point that first counts it.
    counts = [np.array(result.signals[f"{name}.events"]) for name in names]
    seen = [np.repeat(result.times[1:], np.diff(count).astype(int)) for count in counts]
    difference = float(np.max(np.abs(x_end - report.x_end)))
    return Trial(
        f"FMUs, fixed step {step:g} s",
        [len(times) for times in seen],
        edge_norm(scenario, x_end),
        _time_difference(report.event_times, seen),
        difference,
    )


def _summary(comparisons: Mapping[str, Comparison]) -> dict[str, Any]:
    return {
        "scenario": PRESET,
        "runs": {kind: comparison.report.as_dict() for kind, comparison in comparisons.items()},
        "cosim": {kind: _cosim_summary(comparison) for kind, comparison in comparisons.items()},
        "certificates": {kind: _certificates(comparison) for kind, comparison in comparisons.items()},
    }


def _cosim_summary(comparison: Comparison) -> dict[str, Any]:
    in_process, fmus = comparison.exact
    return {
        "fmi": Fmi.V3_0.value,
        "fmus": comparison.fmus,
        **_trial_summary(fmus),
        "in_process": _trial_summary(in_process),
        "fixed_step": [
            {
                "step": step,
                "events_per_agent": trial.events,
                "events_total": sum(trial.events),
                "edge_norm_end": trial.edge_norm_end,
                "max_event_time_difference": trial.event_time_difference,
                "max_final_state_difference": trial.state_difference,
            }
            for step, trial in comparison.fixed.items()
        ],
    }


def _trial_summary(trial: Trial) -> dict[str, Any]:
    return {
        "max_event_time_difference": trial.event_time_difference,
        "max_state_difference": trial.state_difference,
        "events_total": sum(trial.events),
    }


def _certificates(comparison: Comparison) -> dict[str, Any]:
    along_tree = {
        form.value: {
            "window": bound.window,
            "rate": bound.rate,
            "overshoot": bound.overshoot,
            "kappa1": bound.kappa1,
            "kappa2": bound.kappa2,
            "radius": bound.radius,
            "notes": list(bound.notes),
        }
        for form, bound in comparison.bounds.items()
    }
    return {**along_tree, **comparison.certificates.as_dict()}


def _table(comparisons: Mapping[str, Comparison]) -> str:
    lines = [
        f"{'trigger':<8} {'execution':<28} {'events':>6}  {'per agent':<15} {'|x_e(T)|':>10}  "
        f"{'event times':>11}  {'states':>8}",
        f"{'':<8} {'':<28} {'':>6}  {'':<15} {'':>10}  {'differ by':>11}  {'by':>8}",
    ]
    for kind, comparison in comparisons.items():
        report = comparison.report
        whole = Trial("one automaton", report.events_per_agent, report.edge_norm_end, 0.0, 0.0)
        for trial in (whole, *comparison.exact, *comparison.fixed.values()):
            lines.append(_row(kind, trial, reference=trial is whole))
            kind = ""
    return "\n".join(lines)


def _row(kind: str, trial: Trial, *, reference: bool) -> str:
    if reference:
        differences = f"{'reference':>11}  {'':>8}"
    else:
        times = "others" if trial.event_time_difference is None else f"{trial.event_time_difference:.1e} s"
        differences = f"{times:>11}  {trial.state_difference:>8.1e}"
    agents = ", ".join(map(str, trial.events))
    return (
        f"{kind:<8} {trial.name:<28} {sum(trial.events):>6}  {agents:<15} {trial.edge_norm_end:>10.6f}  {differences}"
    )

"""How much fixed steps cost: the error of a scenario's agents over the communication step, as a table and a figure."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from cosim.cli.progress import Work
from cosim.consensus import fmu_system
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.result import CosimResult
from fmu.export import export_fmu
from hybrid_model.consensus.laws.closed_loop import scenario_agents
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.declare.variables import FloatArray

STEPS = (0.5, 0.25, 0.1, 0.05, 0.025, 0.01, 0.005, 0.0025, 0.001)
"""In s; each divides the time between two comparisons."""
COMPARE_INTERVAL = 0.5
"""In s: states are compared at multiples of it."""
VERSIONS: Mapping[str, Callable[[int], str]] = {
    "FMI 3.0": lambda k: "3.0",
    "FMI 2.0": lambda k: "2.0",
    "mixed": lambda k: ("3.0", "2.0")[k % 2],
}
"""Name -> version of the standard for the agent of each number, from 0."""
TABLE, FIGURE = "fixed-steps.csv", "fixed-steps.png"
SMALLEST = 1e-16
"""Errors of zero are drawn here."""


def study(scenario: Scenario, out: Path, steps: Sequence[float] = STEPS, work: Work | None = None) -> list[Path]:
    """Run a scenario's agents with fixed steps and with error control; write how far they are from the exact run.

    Parameters
    ----------
    scenario : Scenario
    out : Path
        Folder for the FMUs, the table and the figure.
    steps : sequence of float
        Communication steps in s.
    work : Work, optional
        Told how far it is.

    Returns
    -------
    list of Path
        The table and the figure.
    """
    work = work or Work()
    out.mkdir(parents=True, exist_ok=True)
    fmus = {version: _export(scenario, version, out, work) for version in ("3.0", "2.0")}
    names = list(fmus["3.0"])
    recorded = [f"{name}.x" for name in names]
    work.begin("event-exact", 0.0)
    exact = run_event_exact(fmu_system(scenario, fmus["3.0"]), scenario.stop_time, output_interval=COMPARE_INTERVAL)
    wanted = _states(exact, recorded)
    rows: list[tuple[str, str, float | None, float]] = []
    for kind, version_of in VERSIONS.items():
        chosen = {name: fmus[version_of(k)][name] for k, name in enumerate(names)}
        for step in steps:
            work.begin(f"{kind}: steps of {step:g} s", 1.0 / step / len(VERSIONS) / sum(1.0 / s for s in steps))
            result = run_fixed_step(
                fmu_system(scenario, chosen),
                scenario.stop_time,
                step,
                record=recorded,
                output_interval=COMPARE_INTERVAL,
            )
            rows.append((kind, "fixed-step", step, _distance(result, recorded, wanted)))
        if kind != "FMI 3.0":
            work.begin(f"{kind}: error-controlled", 0.0)
            result = run_error_controlled(
                fmu_system(scenario, chosen),
                scenario.stop_time,
                output_interval=COMPARE_INTERVAL,
                record_events=False,
            )
            rows.append((kind, "error-controlled", None, _distance(result, recorded, wanted)))
    _write(out / TABLE, rows)
    _draw(out / FIGURE, scenario.name, rows)
    return [out / TABLE, out / FIGURE]


def _export(scenario: Scenario, version: str, out: Path, work: Work) -> dict[str, Path]:
    fmus = {}
    for name, automaton in scenario_agents(scenario).items():
        work.begin(f"exporting {name} for FMI {version}", 0.0)
        fmus[name] = export_fmu(automaton, out / f"{name}-fmi{version[0]}.fmu", fmi=version, kinds=("cs",))
    return fmus


def _states(result: CosimResult, recorded: Sequence[str]) -> FloatArray:
    return np.array([result.signals[name] for name in recorded])


def _distance(result: CosimResult, recorded: Sequence[str], wanted: FloatArray) -> float:
    return float(np.max(np.abs(_states(result, recorded) - wanted)))


def _write(path: Path, rows: Sequence[tuple[str, str, float | None, float]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["agents", "master", "step", "largest error of a state"])
        writer.writerows(rows)


def _draw(path: Path, title: str, rows: Sequence[tuple[str, str, float | None, float]]) -> None:
    import matplotlib.pyplot as plt

    from hybrid_model.plots.style import COLORS, JOURNAL

    with plt.rc_context(JOURNAL):
        figure, ax = plt.subplots(figsize=(4.6, 3.2))
        # Runs that coincide are seen through each other.
        for kind, color, marker, size in zip(VERSIONS, COLORS, "osx", (9.0, 5.5, 3.5), strict=False):
            points = [(step, error) for k, _, step, error in rows if k == kind and step is not None]
            ax.loglog(
                [step for step, _ in points],
                [max(error, SMALLEST) for _, error in points],
                f"{marker}-",
                markersize=size,
                color=color,
                label=f"{kind}, fixed steps",
            )
            for error in (error for k, _, step, error in rows if k == kind and step is None):
                ax.axhline(max(error, SMALLEST), color=color, linestyle="--", label=f"{kind}, error-controlled")
        ax.set_xlabel("communication step (s)")
        ax.set_ylabel("largest error of a state")
        ax.set_title(f"{title}: distance from the event-exact run")
        ax.legend(loc="center right")
        figure.savefig(path, dpi=150)
        plt.close(figure)

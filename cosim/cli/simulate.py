"""`hybrid-fmu simulate`: one run of a scenario."""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import hybrid_model as hm
from cosim.cli.exits import exit_of, write_csv
from cosim.cli.outputs import results_folder
from cosim.cli.progress import Work
from cosim.errors import UsageError
from hybrid_model.consensus.laws.agent_network import agent_network
from hybrid_model.consensus.laws.closed_loop import agent_name, closed_loop
from hybrid_model.consensus.runs.report import RunReport, report_of_network, run_report
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.record.column_files import write_columns

AUTOMATON_AGENTS = 8
"""Up to this many agents `auto` runs the closed loop as one automaton; beyond, event by event over the network."""

MOST_AT_EVENTS = 5_000_000
"""Agents times events: beyond, the trajectory is on its grid only."""
MOST_SHOWN = 50
"""Agents whose numbers are in the text; run.json has all."""
MOST_POINTS = 1e7
"""Of a trajectory; one that is longer fills the memory."""


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    scenario = load_scenario(options.scenario)
    if options.stop_time is not None:
        scenario = dataclasses.replace(scenario, stop_time=options.stop_time)
    _require_points(scenario.stop_time, options.output_interval)
    one = options.engine == "automaton" or (options.engine == "auto" and scenario.network.agents <= AUTOMATON_AGENTS)
    if one and options.events:
        raise UsageError("--events goes with --engine network: one automaton keeps its run in memory.")
    with Work() as work:
        work.begin(f"running {scenario.name}")
        if one:
            report, times, signals = _as_one(scenario, options.output_interval, _wanted(options))
        else:
            report, times, signals = _as_network(scenario, options, work)
        if options.animation:
            _film(scenario, options.animation, work)
    document = json.dumps({"scenario": scenario.name, **report.as_dict(), "message": report.message}, indent=2)
    if options.out:
        with results_folder(options.out, "simulate") as folder:
            (folder / "run.json").write_text(document + "\n", encoding="utf-8")
            write_csv(folder / "trajectory.csv", times, signals)
    if options.output_file:
        table = {"time": np.array(times), **{name: np.array(values) for name, values in signals.items()}}
        about = {"scenario": scenario.name, "stop": report.stop, "message": report.message}
        write_columns(options.output_file, table, {"time": "s"}, about)
    print(document if options.json else _text(scenario, report))
    return exit_of(report.stop)


def _film(scenario: Scenario, path: Path, work: Work) -> None:
    # Of what a run alone does not need.
    from hybrid_model.consensus.figures.animation import require_film, save_animation

    require_film(path)
    work.begin("drawing the film", 10.0)
    save_animation(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time), path, progress=work)


def _wanted(options: argparse.Namespace) -> bool:
    return bool(options.out or options.output_file)


def _require_points(stop_time: float, interval: float) -> None:
    if stop_time / interval > MOST_POINTS:
        raise UsageError(
            f"--output-interval {interval:g} makes more than {MOST_POINTS:.0g} points up to {stop_time:g} s; "
            "choose a longer one."
        )


def _as_one(scenario: Scenario, interval: float, wanted: bool) -> tuple[RunReport, Any, dict[str, Any]]:
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    end = float(arc.t[-1])
    times = np.minimum(np.arange(int(np.ceil(end / interval)) + 1) * interval, end)
    jumps = np.unique([jump.t for jump in arc.jumps])
    times = np.union1d(times, jumps)
    names = [f"{agent_name(i)}.{item}" for i in range(1, scenario.network.agents + 1) for item in ("x", "broadcast")]
    # Both rows of a jump: where something has one, its value before comes first.
    rows, before = _both_sides(times, np.isin(times, jumps))
    signals = {
        name: np.where(before, arc.at(name, rows, before=True), arc.at(name, rows)).tolist()
        for name in (names if wanted else ())
    }
    return run_report(scenario, arc), rows.tolist(), signals


def _both_sides(times: Any, jumps: Any) -> tuple[Any, Any]:
    """Return the times with those of jumps twice, and which rows are before a jump."""
    counts = 1 + jumps
    rows = np.repeat(times, counts)
    before = np.zeros(rows.size, dtype=bool)
    before[(np.cumsum(counts) - counts)[jumps]] = True
    return rows, before


def _as_network(scenario: Scenario, options: argparse.Namespace, work: Work) -> tuple[RunReport, Any, dict[str, Any]]:
    interval, end = options.output_interval, scenario.stop_time

    def told(t: float, events: int) -> None:
        work.part(t / end, f"t = {t:.6g} of {end:.6g} s, {events} events")

    run = hm.simulate_network(agent_network(scenario), end, events_to=options.events, progress=told)
    times, jumps = np.minimum(np.arange(int(np.ceil(run.t / interval)) + 1) * interval, run.t), np.unique(run.events.t)
    if scenario.network.agents * len(jumps) > MOST_AT_EVENTS:
        jumps = jumps[:0]
    times = np.union1d(times, jumps)
    rows, before = _both_sides(times, np.isin(times, jumps))
    signals = {}
    for name, arc in run.arcs.items() if _wanted(options) else ():
        # The others end at their last event where one agent ends the run.
        reached = np.minimum(rows, arc.t[-1])
        for item in ("x", "broadcast"):
            values = np.where(before, arc.at(item, reached, before=True), arc.at(item, reached))
            signals[f"{name}.{item}"] = values.tolist()
    return report_of_network(scenario, run), rows.tolist(), signals


def _text(scenario: Scenario, report: RunReport) -> str:
    agents = _listed(map(str, report.events_per_agent))
    gap = "none" if report.min_gap is None else f"{report.min_gap:.6g} s"
    return "\n".join(
        [
            f"{scenario.name}: {report.message.removeprefix(f'{scenario.name}: ')}",
            f"  events          {sum(report.events_per_agent)} (per agent {agents})",
            f"  shortest gap    {gap}",
            f"  final states    {_listed(f'{x:.9g}' for x in report.x_end)}",
            f"  |x_e| at end    {report.edge_norm_end:.6g}",
            f"  drift of mean   {report.mean_drift:.2g}",
        ]
    )


def _listed(texts: Iterable[str]) -> str:
    """Return texts in a row, the first ones of many."""
    every = list(texts)
    more = f", and {len(every) - MOST_SHOWN} more" if len(every) > MOST_SHOWN else ""
    return ", ".join(every[:MOST_SHOWN]) + more

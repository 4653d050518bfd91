"""What the interactive page shows: one run of a small network, and what is certified of it."""

from __future__ import annotations

import copy
import io
import math
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.consensus.certificates.analysis import Analysis, analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.runs.report import RunReport, edge_norm, run_report
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import read_scenario, scenario_entries
from hybrid_model.declare.variables import FloatArray

PAPER = "paper's"
GRAPHS: Mapping[str, list[list[int]]] = {
    PAPER: [[1, 2], [2, 3], [3, 4], [4, 1]],
    "ring": [[1, 2], [2, 3], [3, 4], [4, 1]],
    "path": [[1, 2], [2, 3], [3, 4]],
    "star": [[1, 2], [1, 3], [1, 4]],
    "complete": [[1, 2], [1, 3], [1, 4], [2, 3], [2, 4], [3, 4]],
}
"""Edges by name; the paper's switch between two trees and have its weights, others weights of 1."""
_known: dict[object, tuple[Analysis, float | None, float | None]] = {}
"""Networks that were analysed, the latest last, each with Floquet's rate and factor."""
_MOST = 200
MOST_JUMPS = 5000
"""After so many a run ends: a threshold that decays faster than the states converge brings ever more."""


@dataclass(frozen=True)
class Live:
    """A run and what is certified of it; bounds are None where a hypothesis fails.

    Attributes
    ----------
    scenario, arc, report
        What ran, its run and its broadcasts.
    rate, factor : float or None
        Floquet's rate of convergence in 1/s, and its factor.
    radius : float or None
        Ultimate radius by energy, times the threshold's decay (docs/paper-audit.md, section 5.3).
    """

    scenario: Scenario
    arc: hm.HybridArc
    report: RunReport
    rate: float | None
    factor: float | None
    radius: float | None

    @property
    def end(self) -> float:
        """End of the run in s."""
        return float(self.arc.t[-1])

    @property
    def periodic(self) -> int | None:
        """Broadcasts of agents that all send with the shortest time between two of this run; None without one."""
        gap = self.report.min_gap
        return None if not gap else len(self.report.events_per_agent) * int(self.end / gap)

    def bound(self, t: FloatArray) -> FloatArray | None:
        """Return the bound on ``||x_e(t)||`` from the start on, shape (n,); None if there is none."""
        if self.rate is None or self.factor is None or self.radius is None:
            return None
        start = edge_norm(self.scenario, np.array(self.scenario.network.initial))
        left = self.factor * float(start) * np.exp(-self.rate * t)
        return left + self.radius * np.exp(-self.scenario.trigger.decay * t)

    def text(self) -> str:
        """Return the numbers in words."""
        events, gap, periodic = sum(self.report.events_per_agent), self.report.min_gap, self.periodic
        told = f"{events} broadcasts ({', '.join(map(str, self.report.events_per_agent))})"
        if gap and periodic:
            saved = f"{1 - events / periodic:.1%} saved"
            told += f"; shortest gap {gap:.4g} s: sent periodically with it, {periodic}, so {saved}"
        bounds = (
            f"Rate {_number(self.rate)} 1/s (Floquet), ultimate radius {_number(self.radius)} (energy), "
            f"edge norm at the end {self.report.edge_norm_end:.4g}"
        )
        early = (
            ""
            if self.arc.stop is hm.Stop.HORIZON
            else f"The run ends at {self.end:.4g} s: {len(self.arc.jumps)} jumps. "
        )
        return f"{early}{told}. {bounds}."


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.4g}"


def scenario_of(graph: str, threshold: float, decay: float, gain: float, dwell: int) -> Scenario:
    """Return the paper's scenario with other numbers, or four agents on another graph.

    Parameters
    ----------
    graph : str
        Out of `GRAPHS`.
    threshold, decay : float
        c in the unit of the states, and beta in 1/s; a decay of 0 is the static trigger.
    gain : float
        k.
    dwell : int
        How long each topology of the paper stays, in quarters of its weights' period, pi / 2 s: others have no period
        in common with the weights, and then bounds take seconds.
    """
    entries = copy.deepcopy(scenario_entries("paper-a")[0])
    entries["network"] |= {"edges": GRAPHS[graph], "gain": gain}
    entries["trigger"] = {"kind": "dynamic", "threshold": threshold, "decay": decay}
    if decay == 0.0:
        entries["trigger"] = {"kind": "static", "threshold": threshold}
    if graph == PAPER:
        entries["switching"]["dwell"] = dwell * math.pi / 2.0
    else:
        entries.pop("switching")
        entries["network"].pop("underlying")
        entries["weights"] = {"kind": "constant", "value": 1.0}
    return read_scenario(entries)


def live(scenario: Scenario) -> Live:
    """Run a scenario on the engine in C, and certify what is certified quickly."""
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time, zeno=hm.ZenoGuard(max_jumps=MOST_JUMPS))
    # What is known of a network is not computed again for another threshold, nor when a slider comes back.
    key = (scenario.network, scenario.weights, scenario.switching)
    if key not in _known:
        first = Bounds(analyse(scenario))
        _known[key] = first.analysis, first.floquet_rate, first.floquet_overshoot
        if len(_known) > _MOST:
            del _known[next(iter(_known))]
    analysis, rate, factor = _known[key]
    exists = rate is not None and scenario.trigger.decay < rate
    radius = Bounds(analysis.alike(scenario)).energy_radius if exists else None
    return Live(scenario, arc, run_report(scenario, arc), rate, factor, radius)


def fmus(scenario: Scenario) -> bytes:
    """Return a ZIP archive with the agents as FMUs (FMI 3.0)."""
    written = io.BytesIO()
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(written, "w") as archive:
        for name, automaton in scenario_agents(scenario).items():
            path = export_fmu(automaton, Path(folder) / f"{name}.fmu", stop_time=scenario.stop_time)
            archive.write(path, path.name)
    return written.getvalue()

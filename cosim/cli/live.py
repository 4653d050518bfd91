"""What the interactive page shows: one run of a small network, what is certified of it, and a picture of both."""

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
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.consensus.certificates.analysis import Analysis, analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.figures.style import MARKS, agent_color, agent_look
from hybrid_model.consensus.laws.closed_loop import agent_name, closed_loop, scenario_agents
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
POINTS = 400
_known: list[tuple[object, Analysis, float | None, float | None]] = []
"""The network that was analysed last, with Floquet's rate and factor."""


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
    def periodic(self) -> int | None:
        """Broadcasts of agents that all send with the shortest time between two of this run; None without one."""
        gap = self.report.min_gap
        return None if not gap else len(self.report.events_per_agent) * int(self.scenario.stop_time / gap)

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
            f"|x_e(T)| = {self.report.edge_norm_end:.4g}"
        )
        return f"{told}. {bounds}."


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
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    # What is known of a network is not computed again for another threshold.
    key = (scenario.network, scenario.weights, scenario.switching)
    if not _known or _known[0][0] != key:
        first = Bounds(analyse(scenario))
        _known[:] = [(key, first.analysis, first.floquet_rate, first.floquet_overshoot)]
    _, analysis, rate, factor = _known[0]
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


class Picture:
    """States, broadcasts, an agent's error against its threshold, and the edge norm with its bound.

    The figure is made once; a change of the run moves its lines, which takes a third of the time.
    """

    def __init__(self) -> None:
        self._figure = Figure(figsize=(10.0, 5.6), dpi=72)
        self._canvas = FigureCanvasAgg(self._figure)
        places = [(0.06, 0.57), (0.56, 0.57), (0.06, 0.08), (0.56, 0.08)]
        self._axes: list[Axes] = [self._figure.add_axes((x, y, 0.42, 0.37)) for x, y in places]
        states, raster, error, norm = self._axes
        agents = range(1, 5)
        self._states = [states.plot([], [], **agent_look(i), label=f"$x_{i}$")[0] for i in agents]
        self._dots = [
            states.plot([], [], linestyle="none", marker=MARKS[i - 1], markersize=4, color=agent_color(i))[0]
            for i in agents
        ]
        self._rows = [
            raster.plot([], [], linestyle="none", marker="|", markersize=16, color=agent_color(i))[0] for i in agents
        ]
        (self._error,) = error.plot([], [])
        (self._level,) = error.plot([], [], "k--")
        (self._norm,) = norm.semilogy([], [], "k", label="norm of edge states")
        (self._bound,) = norm.semilogy([], [], "k-.", label="bound (Floquet, energy)")
        for ax, title in zip(self._axes, ("states", "broadcasts", "", "edge norm and bound"), strict=True):
            ax.set_title(title, loc="left", fontsize=10)
            ax.tick_params(labelsize=8)
        raster.set(ylim=(4.5, 0.5), yticks=[1, 2, 3, 4], yticklabels=[f"agent {i}" for i in agents])
        states.legend(loc="upper right", ncols=4, fontsize=8, frameon=False)
        norm.legend(loc="upper right", fontsize=8, frameon=False)

    def draw(self, shown: Live, agent: int) -> bytes:
        """Return the picture of a run as PNG; the error is that of one agent, counted from 1."""
        arc, end = shown.arc, shown.scenario.stop_time
        t = np.linspace(0.0, end, POINTS)
        x = np.array([arc.at(f"{agent_name(i)}.x", t) for i in range(1, 5)])
        for i, times in enumerate(shown.report.event_times):
            self._states[i].set_data(t, x[i])
            self._dots[i].set_data(times, arc.at(f"{agent_name(i + 1)}.x", times) if len(times) else [])
            self._rows[i].set_data(times, np.full(len(times), i + 1))
        error = np.abs(arc.at(f"{agent_name(agent)}.broadcast", t) - x[agent - 1])
        level = np.asarray(shown.scenario.trigger.level(t))
        self._error.set_data(t, error)
        self._error.set_color(agent_color(agent))
        self._level.set_data(t, level)
        norm, bound = edge_norm(shown.scenario, x), shown.bound(t)
        self._norm.set_data(t, norm)
        self._bound.set_data(t if bound is not None else [], bound if bound is not None else [])
        states, _, errors, norms = self._axes
        errors.set_title(f"error of agent {agent} against its threshold", loc="left", fontsize=10)
        states.set_ylim(float(x.min()) - 0.1, float(x.max()) + 0.4)
        errors.set_ylim(0.0, 1.1 * max(float(level.max()), float(error.max())))
        top = float(max(norm.max(), 0.0 if bound is None else bound.max()))
        norms.set_ylim(max(float(norm.min()), 1e-6 * top) / 2.0, 3.0 * top)
        for ax in self._axes:
            ax.set_xlim(0.0, end)
        written = io.BytesIO()
        self._figure.savefig(written, format="png", pil_kwargs={"compress_level": 1})
        return written.getvalue()

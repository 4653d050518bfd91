"""Figures of a scenario's run: states, edge norm with its bounds, error against threshold, broadcasts."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound
from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger
from hybrid_model.plots import COLORS, JOURNAL, curve, new_axes, plot_raster
from hybrid_model.record.arc import HybridArc

COLUMN = (3.4, 2.5)
"""Width and height in inches of a figure in one column of a journal."""
MARKER: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.2}
"""A broadcast in a figure over time."""


def plot_states(scenario: Scenario, arc: HybridArc, ax: Axes | None = None) -> Axes:
    """Draw the agents' states, with a dot at each broadcast (paper, figures 3 and 5).

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    n = scenario.network.agents
    for i in range(1, n + 1):
        name, color = agent_name(i), _color(i)
        # With more agents than colours a legend could not tell them apart.
        ax.plot(*curve(arc, f"{name}.x"), color=color, label=f"$x_{{{i}}}$" if n <= len(COLORS) else None)
        times = arc.event_times(f"{name}.trigger.broadcast")
        if times.size:  # an empty line counts as a point in the corner when figures are cropped
            ax.plot(times, arc.at(f"{name}.x", times), color=color, clip_on=False, **MARKER)
    mean = float(np.mean(scenario.network.initial))
    ax.axhline(mean, color="0.5", linewidth=0.6, linestyle=(0, (4, 3)), zorder=0, label="mean")
    ax.set_ylabel("states $x_i$")
    return _over_time(ax, scenario, [Line2D([], [], color="0.3", label="broadcast", **MARKER)])


def plot_edge_norm(
    scenario: Scenario, arc: HybridArc, bounds: Sequence[ConvergenceBound] = (), ax: Axes | None = None
) -> Axes:
    """Draw the norm of the edge states with its bounds, on a logarithmic axis (paper, figures 4 and 6).

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    bounds : sequence of ConvergenceBound
        The legend says which of them do not hold for the scenario; their notes say why.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    times, first = curve(arc, f"{agent_name(1)}.x")
    others = [curve(arc, f"{agent_name(i)}.x")[1] for i in range(2, scenario.network.agents + 1)]
    ax.semilogy(times, edge_norm(scenario, np.array([first, *others])), color="k", label=r"$\|x_e(t)\|$")
    styles = {BoundForm.PRINTED: ("#d55e00", (0, (5, 2))), BoundForm.VALID: ("#0072b2", "solid")}
    grid = np.linspace(0.0, scenario.stop_time, 300)
    missing = []
    for bound in bounds:
        color, style = styles[bound.form]
        if bound.kappa2 is None:
            missing.append(Line2D([], [], linestyle="none", label=f"no {bound.form.value} bound"))
        else:
            ax.semilogy(grid, bound.at(grid), color=color, linestyle=style, label=f"{bound.form.value} bound")
    ax.set_ylabel(r"norm of edge states $\|x_e\|$")
    return _over_time(ax, scenario, missing)


def plot_error_against_threshold(scenario: Scenario, arc: HybridArc, agent: int, ax: Axes | None = None) -> Axes:
    """Draw one agent's error ``|xhat - x|`` and the threshold it may not pass, with a dot at each broadcast.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    agent : int
        Number of the agent, counted from 1.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If there is no such agent.
    """
    if not 1 <= agent <= scenario.network.agents:
        raise ValueError(
            f"there is no agent {agent} in {scenario.name}: its agents are 1 to {scenario.network.agents}."
        )
    ax = new_axes(ax)
    name, color = agent_name(agent), _color(agent)
    times, x = curve(arc, f"{name}.x")
    _, broadcast = curve(arc, f"{name}.broadcast")
    error = rf"$|\hat{{x}}_{{{agent}}} - x_{{{agent}}}|$"
    ax.plot(times, np.abs(broadcast - x), color=color, label=error)
    grid = np.linspace(0.0, scenario.stop_time, 300)
    ax.plot(grid, scenario.trigger.level(grid), color="k", linestyle=(0, (5, 2)), label=_threshold(scenario.trigger))
    events = arc.event_times(f"{name}.trigger.broadcast")
    if events.size:
        reached = np.abs(arc.at(f"{name}.broadcast", events, before=True) - arc.at(f"{name}.x", events))
        ax.plot(events, reached, color=color, label="broadcast", clip_on=False, **MARKER)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel(f"error of agent {agent}")
    return _over_time(ax, scenario)


def _threshold(trigger: Trigger) -> str:
    decaying = r"\,e^{-\beta t}" if trigger.decay > 0 else ""
    return f"threshold $c_0 + c_1{decaying}$" if trigger.offset > 0 else f"threshold $c{decaying}$"


def plot_broadcasts(scenario: Scenario, event_times: Sequence[npt.ArrayLike], ax: Axes | None = None) -> Axes:
    """Draw who broadcasts when: one row an agent, with the number of its broadcasts at the right.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    event_times : sequence of array_like
        Times in s of each agent's broadcasts, as in `RunReport.event_times`; of a co-simulation as well.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If there is not one row of times for each agent.
    """
    if len(event_times) != scenario.network.agents:
        raise ValueError(
            f"{len(event_times)} rows of broadcast times for the {scenario.network.agents} agents of {scenario.name}: "
            "give one row an agent."
        )
    rows = {f"agent {i}": np.asarray(times, dtype=float) for i, times in enumerate(event_times, start=1)}
    ax = plot_raster(rows, ax=ax)
    for i, (collection, times) in enumerate(zip(ax.collections, rows.values(), strict=True), start=1):
        collection.set_color(_color(i))
        ax.text(1.02, i - 1, f"{len(times)}", transform=ax.get_yaxis_transform(), va="center", fontsize="small")
    ax.text(1.06, 1.0, "broadcasts", transform=ax.transAxes, ha="right", va="bottom", fontsize="small")
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    return _over_time(ax, scenario)


def _color(agent: int) -> str:
    return COLORS[(agent - 1) % len(COLORS)]


def _over_time(ax: Axes, scenario: Scenario, words: Sequence[Line2D] = ()) -> Axes:
    """Finish axes over the run: room between the axis and the fast start, and a legend that hides no curve.

    `words` are further entries of the legend, of nothing that is drawn.
    """
    ax.set_xlabel("time $t$ (s)")
    ax.set_xlim(0.0, scenario.stop_time)
    ax.spines["left"].set_position(("outward", 4.0))
    handles = [*ax.get_legend_handles_labels()[0], *words]
    if handles:
        ax.legend(
            handles=handles,
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.3,
            ncols=len(handles) if len(handles) < 4 else (len(handles) + 1) // 2,
            columnspacing=1.2,
            handlelength=1.4,
        )
    return ax


def save_paper_figures(
    kind: str, scenario: Scenario, arc: HybridArc, bounds: Sequence[ConvergenceBound], folder: Path
) -> list[Path]:
    """Write the two figures of one trigger as PNG and PDF.

    Parameters
    ----------
    kind : str
        Name of the trigger, for the file names.
    scenario, arc, bounds
        As in `plot_edge_norm`.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path
        The files written.
    """
    figures = {
        f"{kind}_states": in_column(lambda ax: plot_states(scenario, arc, ax)),
        f"{kind}_edge_norm": in_column(lambda ax: plot_edge_norm(scenario, arc, bounds, ax)),
    }
    return save_figures(figures, folder)


def in_column(plot: Callable[[Axes], object], columns: float = 1.0) -> Callable[[], Figure]:
    """What draws a figure so many columns wide with one pair of axes, on which `plot` draws."""

    def draw() -> Figure:
        figure, ax = plt.subplots(figsize=(columns * COLUMN[0], COLUMN[1]))
        plot(ax)
        return figure

    return draw


def save_figures(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> list[Path]:
    """Write figures in a journal's style as PNG and PDF.

    Parameters
    ----------
    figures : mapping
        Name of the file -> what draws the figure.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # The font's own time stamp is none of the reader's business; the subsetter warns about it for every figure.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    written = []
    with plt.rc_context(JOURNAL):
        for name, draw in figures.items():
            figure = draw()
            for suffix, metadata in ((".png", {"Software": None}), (".pdf", {"CreationDate": None})):
                written.append(folder / f"{name}{suffix}")
                figure.savefig(written[-1], metadata=metadata)
            plt.close(figure)
    return written

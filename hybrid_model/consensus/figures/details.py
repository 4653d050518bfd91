"""Figures of one run in more detail: every agent's error, broadcasts over the weights, gaps against their bounds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from hybrid_model.consensus.figures.run import plot_broadcasts, plot_error_against_threshold
from hybrid_model.consensus.figures.style import COLUMN, DASHES, MARKER, VIOLATED, height_of, over_time
from hybrid_model.consensus.laws.closed_loop import agent_name, edges_of
from hybrid_model.consensus.runs.communication import gap_statistics
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.plots import COLORS, new_axes, plot_inter_event_times
from hybrid_model.plots.events import LEGEND_ROWS
from hybrid_model.record.arc import HybridArc

__all__ = [
    "plot_all_errors",
    "plot_broadcasts_and_weights",
    "plot_gaps_against_bounds",
]

SHADE = "#d9d9d9"
MOST_AXES = 12
"""Agents that have axes of their own."""


def plot_all_errors(scenario: Scenario, arc: HybridArc, columns: int = 2) -> Figure:
    """Draw the error of every agent against the threshold, one pair of axes an agent, all with the same limits.

    Of more than `MOST_AXES` agents it is an image, a row an agent: which part of the threshold the error is.

    Parameters
    ----------
    scenario : Scenario
        What ran; its trigger has a threshold that is a function of time.
    arc : HybridArc
        Its run.
    columns : int
        Of the grid.

    Returns
    -------
    Figure
    """
    n = scenario.network.agents
    if n > MOST_AXES:
        return _error_image(scenario, arc)
    rows = math.ceil(n / columns)
    figure, grid = plt.subplots(
        rows,
        columns,
        figsize=(COLUMN[0] * columns, 0.3 + 1.5 * rows),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for agent in range(1, n + 1):
        ax = grid.flat[agent - 1]
        plot_error_against_threshold(scenario, arc, agent, ax)
        ax.set_title(f"agent {agent}", loc="left", fontsize="medium")
        ax.set_ylabel(r"$|\hat{x}_i - x_i|$" if (agent - 1) % columns == 0 else "")
        ax.get_legend().remove()
        if agent + columns <= n:
            ax.set_xlabel("")
        else:
            ax.tick_params(labelbottom=True)
    for ax in grid.flat[n:]:
        ax.remove()
    threshold = next(line for line in grid.flat[0].lines if str(line.get_label()).startswith("threshold"))
    broadcast = Line2D([], [], color="0.3", label="broadcast", **MARKER)
    figure.legend(handles=[threshold, broadcast], loc="outside upper right", ncols=2)
    return figure


def _error_image(scenario: Scenario, arc: HybridArc) -> Figure:
    n = scenario.network.agents
    grid = np.linspace(0.0, float(arc.t[-1]), 801)
    # Largest in each cell, so that no short peak is lost.
    fine = np.linspace(0.0, float(arc.t[-1]), 4 * 800 + 1)
    level = scenario.trigger.level(fine)
    parts = [
        np.abs(arc.at(f"{agent_name(i)}.broadcast", fine) - arc.at(f"{agent_name(i)}.x", fine)) / level
        for i in range(1, n + 1)
    ]
    cells = np.array(parts)[:, :-1].reshape(n, 800, 4).max(axis=2)
    figure, ax = plt.subplots(figsize=(1.5 * COLUMN[0], height_of(n)), layout="constrained")
    image = ax.pcolormesh(grid, np.arange(n + 1) + 0.5, cells, cmap="cividis", vmin=0.0, vmax=1.0, rasterized=True)
    ax.set_ylim(n + 0.5, 0.5)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=12))
    ax.set_ylabel("agent")
    over_time(ax, scenario)
    figure.colorbar(image, ax=ax, label=r"$|\hat{x}_i - x_i|$ over the threshold", aspect=30)
    return figure


def plot_broadcasts_and_weights(
    scenario: Scenario, event_times: Sequence[npt.ArrayLike], ax: Axes | None = None
) -> Axes:
    """Draw who broadcasts when, over the times in which some edge of the agent carries weight, shaded.

    Outside the shade the agent's state stands still: with a constant threshold no broadcast can fall there.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    event_times : sequence of array_like
        Times [s] of each agent's broadcasts.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If there is not one row of times for each agent.
    """
    ax = plot_broadcasts(scenario, event_times, ax)
    pieces = scenario.edge_weights.pieces(0.0, scenario.stop_time)
    for agent in range(1, scenario.network.agents + 1):
        edges = edges_of(scenario, agent)
        spans = [(p.start, p.end - p.start) for p in pieces if np.any(p.amplitudes[edges] > 0)]
        ax.broken_barh(spans, (agent - 1.45, 0.9), facecolor=SHADE, edgecolor="none", zorder=0)
    ax.legend(
        handles=[Patch(facecolor=SHADE, label="some edge of the agent carries weight")],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.3,
        handlelength=1.2,
    )
    return ax


def plot_gaps_against_bounds(
    scenario: Scenario,
    event_times: Sequence[npt.ArrayLike],
    bounds: Mapping[str, float | None],
    ax: Axes | None = None,
) -> Axes:
    """Draw the time since the agent's last broadcast at every broadcast, and the bounds that it should not fall below.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    event_times : sequence of array_like
        Times [s] of each agent's broadcasts.
    bounds : mapping
        Name -> lower bound [s]; those that are None are named in the legend as missing. One that observed gaps fall
        below is called violated.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    rows = {agent_name(i): np.asarray(times, dtype=float) for i, times in enumerate(event_times, start=1)}
    plot_inter_event_times(rows, ax=ax, markersize=3)
    few = len(rows) <= LEGEND_ROWS
    for line, k in zip(
        [line for line in ax.lines if line.get_transform() == ax.transData], range(len(rows)), strict=False
    ):
        line.set(label=f"agent {k + 1}" if few else "_", color=COLORS[k % len(COLORS)], clip_on=False)
    if not few:
        ax.plot([], [], color="0.3", marker="o", markersize=3, linestyle="none", label=f"{len(rows)} agents")
    smallest = gap_statistics(event_times).min
    lowest = smallest if smallest is not None else 1.0
    for (name, bound), style in zip(bounds.items(), itertools.cycle(DASHES), strict=False):
        if bound is None or not 0 < bound < math.inf:
            ax.plot([], [], linestyle="none", label=f"no {name} bound")
            continue
        violated = smallest is not None and smallest < bound
        label = f"{name} bound" + (", violated" if violated else "")
        ax.axhline(bound, color=VIOLATED if violated else "0.25", linestyle=style, linewidth=0.9, label=label)
        lowest = min(lowest, bound)
    top = ax.get_ylim()[1]
    ax.set_ylim(lowest / 2, max([top, *(2 * b for b in bounds.values() if b is not None and b < math.inf)]))
    over_time(ax, scenario)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, handlelength=1.8)
    return ax

"""The paper's figures: states, and the norm of the edge states with its bounds, for a run of a scenario."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from hybrid_model.arc import HybridArc
from hybrid_model.consensus.certificates import BoundForm, ConvergenceBound
from hybrid_model.consensus.network import agent_name
from hybrid_model.consensus.report import edge_norm
from hybrid_model.consensus.scenario_data import Scenario
from hybrid_model.plots import JOURNAL, curve, new_axes

COLUMN = (3.4, 2.5)
"""Width and height in inches of a figure in one column of a journal."""
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#999999")
"""Colours that remain apart for colour-blind readers."""


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
    for i in range(1, scenario.network.agents + 1):
        name = agent_name(i)
        color = COLORS[(i - 1) % len(COLORS)]
        ax.plot(*curve(arc, f"{name}.x"), color=color, label=f"$x_{{{i}}}$")
        times = arc.event_times(f"{name}.trigger.broadcast")
        ax.plot(times, arc.at(f"{name}.x", times), linestyle="none", marker="o", markersize=2.2, color=color)
    ax.axhline(float(np.mean(scenario.network.initial)), color="0.6", linewidth=0.6, linestyle=(0, (4, 3)), zorder=0)
    ax.set_xlabel("time $t$ (s)")
    ax.set_ylabel("states $x_i$")
    ax.set_xlim(0.0, scenario.stop_time)
    ax.legend(ncols=min(4, scenario.network.agents), loc="upper right")
    return ax


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
        Those that say nothing about the scenario are left out.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    times, first = curve(arc, f"{agent_name(1)}.x")
    others = [curve(arc, f"{agent_name(i)}.x")[1] for i in range(2, scenario.network.agents + 1)]
    ax.semilogy(times, edge_norm(scenario, np.array([first, *others])), color="k", label=r"$\|x_e(t)\|$")
    styles = {BoundForm.PRINTED: ("#d55e00", (0, (5, 2))), BoundForm.VALID: ("#0072b2", "solid")}
    grid = np.linspace(0.0, scenario.stop_time, 300)
    for bound in bounds:
        if bound.kappa2 is not None:
            color, style = styles[bound.form]
            ax.semilogy(grid, bound.at(grid), color=color, linestyle=style, label=f"bound, {bound.form.value}")
    ax.set_xlabel("time $t$ (s)")
    ax.set_ylabel(r"norm of the edge states")
    ax.set_xlim(0.0, scenario.stop_time)
    ax.legend(loc="center right")
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
    folder.mkdir(parents=True, exist_ok=True)
    # The font's own time stamp is none of the reader's business; the subsetter warns about it for every figure.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    written = []
    with plt.rc_context(JOURNAL):
        for name, draw in (("states", plot_states), ("edge_norm", lambda s, a, ax: plot_edge_norm(s, a, bounds, ax))):
            figure, ax = plt.subplots(figsize=COLUMN)
            draw(scenario, arc, ax=ax)
            for suffix, metadata in ((".png", {"Software": None}), (".pdf", {"CreationDate": None})):
                written.append(folder / f"{kind}_{name}{suffix}")
                figure.savefig(written[-1], metadata=metadata)
            plt.close(figure)
    return written

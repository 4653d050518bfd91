"""Plots of runs on hybrid time: every function draws into the axes given, or into new ones, and returns them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.typing import RcKeyType

from hybrid_model.arc import HybridArc
from hybrid_model.variables import FloatArray

JOURNAL: dict[RcKeyType, Any] = {
    # STIX for text and formulas, so that both have one weight; it comes with matplotlib.
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,
    # No creation date and no random identifiers: the same run gives the same file.
    "svg.hashsalt": "hybrid-fmu",
}
"""Settings for ``matplotlib.rc_context``: a figure of one column of a journal."""
POINTS = 400
"""Points of a curve over a whole run, beside those at jumps and at the solver's steps."""


def new_axes(ax: Axes | None) -> Axes:
    """Return `ax`, or new axes if there are none."""
    return plt.subplots()[1] if ax is None else ax


def curve(
    arc: HybridArc, name: str, t_start: float | None = None, t_end: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return times and values of a variable for drawing: a fine grid, the solver's steps, both sides of every jump.

    Parameters
    ----------
    arc : HybridArc
        The run.
    name : str
        A scalar variable, or an array variable for its elements in columns.
    t_start, t_end : float, optional
        Part of the run in s.

    Returns
    -------
    t : ndarray, shape (n,)
    values : ndarray, shape (n, ...)
    """
    start = arc.t[0] if t_start is None else t_start
    end = arc.t[-1] if t_end is None else t_end
    jumps = np.unique([jump.t for jump in arc.jumps if start <= jump.t <= end])
    steps = arc.t[(start <= arc.t) & (arc.t <= end)]
    grid = np.setdiff1d(np.concatenate([np.linspace(start, end, POINTS), steps]), jumps)
    times = np.concatenate([grid, jumps, jumps])
    values = np.concatenate([arc.at(name, grid), arc.at(name, jumps, before=True), arc.at(name, jumps)])
    # A stable sort keeps the value before a jump in front of the one after it.
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def plot_flow(
    arc: HybridArc, names: Sequence[str], ax: Axes | None = None, labels: Mapping[str, str] | None = None
) -> Axes:
    """Draw variables over time; a jump is a vertical line between its two values.

    Parameters
    ----------
    arc : HybridArc
        The run.
    names : sequence of str
        Scalar variables.
    ax : Axes, optional
        Where to draw.
    labels : mapping, optional
        Variable -> text for the legend.
    """
    ax = new_axes(ax)
    for name in names:
        ax.plot(*curve(arc, name), label=(labels or {}).get(name, name))
    ax.set_xlabel("time $t$ (s)")
    ax.set_xlim(arc.t[0], arc.t[-1])
    return ax


def mark_jumps(arc: HybridArc, name: str, jump: str, ax: Axes, color: str = "k") -> Axes:
    """Mark the points of a variable at which a jump happens.

    Parameters
    ----------
    arc : HybridArc
        The run.
    name : str
        A scalar variable.
    jump : str
        Name of the jump.
    ax : Axes
        Where to draw.
    color : str
        Colour of the markers.
    """
    times = arc.event_times(jump)
    ax.plot(times, arc.at(name, times), linestyle="none", marker="o", markersize=2.5, color=color)
    return ax


def plot_raster(events: Mapping[str, npt.ArrayLike], ax: Axes | None = None) -> Axes:
    """Draw the times of events, one row a name, the first on top.

    Parameters
    ----------
    events : mapping
        Name -> times in s.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    names = list(events)
    ax.eventplot(
        [np.asarray(events[name]) for name in names], lineoffsets=range(len(names)), linelengths=0.7, colors="k"
    )
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlabel("time $t$ (s)")
    return ax

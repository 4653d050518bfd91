"""Variables over time as bare curves, for figures with markers of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from hybrid_model.declare.variables import FloatArray
from hybrid_model.plots.style import TIME, new_axes
from hybrid_model.record.arc import HybridArc

POINTS = 400
"""Points of a curve over a whole run, beside those at jumps and at the solver's steps."""


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
    t : ndarray, shape (n,), in s
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
    ax.set_xlabel(TIME)
    if arc.t[-1] > arc.t[0]:
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

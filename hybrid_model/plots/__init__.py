"""Plots of runs on hybrid time. They import `declare` and `record`.

Every function draws into the axes given as ``ax``, or into a new figure, and returns the axes. Flows are solid, jumps
dashed; an open marker is the value before a jump, a filled one the value after it. Functions draw with the colours and
settings that are in force; ``matplotlib.rc_context(JOURNAL)`` gives those of a journal.
"""

from hybrid_model.plots.curves import POINTS, curve, mark_jumps, plot_flow
from hybrid_model.plots.events import plot_inter_event_times, plot_raster
from hybrid_model.plots.projections import (
    plot_hybrid_arc,
    plot_over_jumps,
    plot_over_time,
    plot_phase,
    plot_time_domain,
)
from hybrid_model.plots.style import COLORS, JOURNAL, new_axes
from hybrid_model.plots.thresholds import plot_margin, plot_threshold

__all__ = [
    "COLORS",
    "JOURNAL",
    "POINTS",
    "curve",
    "mark_jumps",
    "new_axes",
    "plot_flow",
    "plot_hybrid_arc",
    "plot_inter_event_times",
    "plot_margin",
    "plot_over_jumps",
    "plot_over_time",
    "plot_phase",
    "plot_raster",
    "plot_threshold",
    "plot_time_domain",
]

"""When jumps happen: a raster with a row for each name, and the times between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import EventCollection

from hybrid_model.declare.variables import FloatArray, unknown_name
from hybrid_model.errors import DeclarationError
from hybrid_model.plots.style import TIME, legend, new_axes, short_names
from hybrid_model.record.arc import HybridArc

Events = HybridArc | Mapping[str, npt.ArrayLike]
"""A run, or times in s by name, such as those of a co-simulation."""
ROWS = 40
"""So many rows of a raster have room for their names; of more rows some are named."""
MARKERS = "os^D<>pX"
ONE_INSTANT = "at one instant"
LEGEND_ROWS = 10
"""With more names than these a legend could not tell them apart."""


def plot_raster(events: Events, *names: str, ax: Axes | None = None, **line_options: Any) -> Axes:
    """Draw the times of events, one row a name, the first on top.

    Parameters
    ----------
    events : HybridArc or mapping
        A run, whose jumps are drawn, or name -> times in s.
    *names : str
        Jumps, or keys of the mapping. Default: all; of a run those that are not internal.
    ax : Axes, optional
        Where to draw.
    **line_options
        As in ``Axes.eventplot``.

    Raises
    ------
    DeclarationError
        For an unknown name.
    """
    times = event_times(events, names)
    ax = new_axes(ax)
    rows = range(len(times))
    options: dict[str, Any] = {"linelengths": 0.7, "linewidths": 1.0, "colors": "k"} | line_options
    # Without rows eventplot has no limits to set.
    drawn: list[EventCollection] = []
    if times:
        drawn = list(np.atleast_1d(ax.eventplot(list(times.values()), lineoffsets=rows, **options)))  # type: ignore
    _show_whole_run(ax, events)
    for collection in drawn:
        _keep_apart(ax, collection)
    labels, common = short_names(list(times))
    step = max(1, math.ceil(len(times) / ROWS))
    ax.set_yticks(rows[::step], labels[::step])
    ax.set_ylim(max(len(times), 1) - 0.5, -0.5)
    ax.set_xlabel(TIME)
    ax.set_ylabel(common)
    return ax


def _keep_apart(ax: Axes, row: EventCollection) -> None:
    """Draw events that lie closer than their lines are wide in halves of the row in turn: two stay two."""
    times = np.sort(row.get_positions())
    figure = ax.get_figure(root=True)
    assert figure is not None
    low, high = ax.get_xlim()
    points = 72.0 * figure.get_size_inches()[0] * ax.get_position().width
    near = np.diff(times) < 2.0 * float(np.max(row.get_linewidth())) / points * (high - low)
    if not near.any():
        return
    touching = np.concatenate([near, [False]]) | np.concatenate([[False], near])
    # The place of an event in its cluster.
    place = np.zeros(times.size, dtype=int)
    for k in range(1, times.size):
        place[k] = place[k - 1] + 1 if near[k - 1] else 0
    middle, length = row.get_lineoffset(), float(np.max(row.get_linelength()))
    top, bottom = middle + length / 2.0, middle - length / 2.0
    gap = 0.06 * length
    low_end = np.where(touching & (place % 2 == 0), middle + gap, bottom)
    high_end = np.where(touching & (place % 2 == 1), middle - gap, top)
    row.set_segments([[(t, a), (t, b)] for t, a, b in zip(times, low_end, high_end, strict=True)])


def plot_inter_event_times(
    events: Events, *names: str, ax: Axes | None = None, bound: float | None = None, **line_options: Any
) -> Axes:
    """Draw the time since the last event of the same name, at every event, on a logarithmic axis.

    Events at one instant are no point of such an axis: they are triangles at its lower end.

    Parameters
    ----------
    events, *names, ax
        As in `plot_raster`.
    bound : float, optional
        A lower bound in s, drawn as a dashed line.
    **line_options
        As in ``Axes.plot``.

    Raises
    ------
    DeclarationError
        For an unknown name, or a bound that is not positive.
    """
    if bound is not None and not (math.isfinite(bound) and bound > 0.0):
        raise DeclarationError(
            f"the bound on inter-event times is {bound!r} s, but a logarithmic axis shows positive numbers only: "
            "give a positive one, or none."
        )
    times = event_times(events, names)
    ax = new_axes(ax)
    ax.set_yscale("log")
    labels, _ = short_names(list(times))
    few = len(times) <= LEGEND_ROWS
    for k, (label, row) in enumerate(zip(labels, times.values(), strict=True)):
        own = {"label": label, "marker": MARKERS[k % len(MARKERS)]} if few else {"label": "_", "color": "k"}
        _draw_gaps(ax, row, {"marker": "o", "markersize": 4, "linestyle": "none"} | own | line_options)
    _show_whole_run(ax, events)
    if bound is not None:
        _make_room(ax, bound, bound)
        ax.axhline(bound, color="0.4", linestyle=(0, (5, 2)), linewidth=1.0, zorder=1.5, label="lower bound")
    ax.set_xlabel(TIME)
    ax.set_ylabel("inter-event time (s)")
    legend(ax)
    return ax


def _draw_gaps(ax: Axes, times: FloatArray, options: dict[str, Any]) -> None:
    gaps = np.diff(times)
    apart = gaps > 0.0
    (line,) = ax.plot(times[1:][apart], gaps[apart], **options)
    if apart.any():
        _make_room(ax, gaps[apart].min(), gaps[apart].max())
    together = times[1:][~apart]
    if together.size:
        first = ONE_INSTANT not in ax.get_legend_handles_labels()[1]
        bottom: dict[str, Any] = {"marker": "v", "linestyle": "none", "color": line.get_color(), "clip_on": False}
        label = ONE_INSTANT if first else f"_{ONE_INSTANT}"
        ax.plot(together, np.zeros(together.size), transform=ax.get_xaxis_transform(), label=label, **bottom)


def _make_room(ax: Axes, low: float, high: float) -> None:
    # A factor of three: gaps that are equal up to rounding must not fill the axis with their last digits.
    ax.update_datalim([(0.0, low / 3.0), (0.0, high * 3.0)], updatex=False)
    ax.autoscale_view()


def _show_whole_run(ax: Axes, events: Events) -> None:
    # That nothing happens at the end of a run is part of the picture.
    if isinstance(events, HybridArc):
        ax.update_datalim([(events.t[0], 1.0), (events.t[-1], 1.0)], updatey=False)
        ax.autoscale_view()


def event_times(events: Events, names: tuple[str, ...]) -> dict[str, FloatArray]:
    """Return the times in s of events by name, see `plot_raster`."""
    if isinstance(events, HybridArc):
        chosen = names or tuple(info.name for info in events.automaton.jumps if not info.internal)
        return {name: events.event_times(name) for name in chosen}
    if not isinstance(events, Mapping):
        raise DeclarationError(f'{events!r} is neither a run nor a mapping: give an arc, or {{"name": times}}.')
    for name in names:
        if name not in events:
            raise DeclarationError(unknown_name("the mapping of events", name, events))
    return {name: np.asarray(events[name], dtype=np.float64) for name in names or events}

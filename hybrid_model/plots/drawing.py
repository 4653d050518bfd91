"""How a hybrid arc is drawn in any coordinates: solid flows, dashed jumps, open and filled markers at their sides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hybrid_model.declare.variables import FloatArray
from hybrid_model.plots.trace import Scalar, Trace, jump_mask

MARKED_JUMPS = 60
"""Jumps are marked by default up to this number; markers of more of them would hide the curve."""
VISIBLE = 1e-6
"""Changes below this part of the largest value are rounding, as of a located state, and no drawing shows them."""
DASHES: dict[str, Any] = {"linestyle": (0, (2.5, 1.5)), "marker": "", "label": "_jumps"}
BEFORE: dict[str, Any] = {"linestyle": "none", "marker": "o", "label": "_before"}
AFTER: dict[str, Any] = {"linestyle": "none", "marker": "o", "label": "_after"}


def draw_arc(
    ax: Axes,
    trace: Trace,
    coordinates: Sequence[FloatArray],
    marked: npt.NDArray[np.bool_],
    line_options: dict[str, Any],
) -> Line2D:
    """Draw a run in the given coordinates.

    Parameters
    ----------
    ax : Axes
        Of as many dimensions as there are coordinates.
    trace : Trace
        The run.
    coordinates : sequence of ndarray, shape (n,)
        Values on the trace's grid.
    marked : ndarray of bool, shape (jumps,)
        The jumps that get markers.
    line_options : dict
        Of the flows; jumps and markers take colour, width and transparency from them.

    Returns
    -------
    Line2D
        The flows: one line with a gap at every jump.
    """
    points = [np.where(np.isfinite(values), values, np.nan) for values in coordinates]
    (flows,) = ax.plot(*(np.insert(values, trace.first[1:], np.nan) for values in points), **line_options)
    color, width, alpha = flows.get_color(), flows.get_linewidth(), flows.get_alpha()
    before = [values[trace.last[:-1]] for values in points]
    after = [values[trace.first[1:]] for values in points]
    moved = np.any([a != b for a, b in zip(before, after, strict=True)], axis=0)
    leaps = [
        np.stack([b[moved], a[moved], np.full(moved.sum(), np.nan)], axis=1).ravel()
        for b, a in zip(before, after, strict=True)
    ]
    same: dict[str, Any] = {"color": color, "alpha": alpha, "zorder": flows.get_zorder()}
    ax.plot(*leaps, linewidth=0.7 * width, **DASHES, **same)
    size: dict[str, Any] = {
        "markersize": 2.0 + 1.5 * width,
        "markeredgewidth": 0.7 * width,
        "color": color,
        "alpha": alpha,
    }
    above: dict[str, Any] = {"zorder": flows.get_zorder() + 0.1}
    ax.plot(*(b[marked] for b in before), markerfacecolor=ax.get_facecolor(), **BEFORE, **size, **above)
    ax.plot(*(a[marked] for a in after), **AFTER, **size, **above)
    return flows


def marked_jumps(
    trace: Trace, scalar: Scalar | None, values: FloatArray, jumps: Sequence[str] | None
) -> npt.NDArray[np.bool_]:
    """Return which jumps are marked on the curve of a scalar, shape (jumps,).

    Parameters
    ----------
    trace : Trace
        The run.
    scalar : Scalar or None
        What is drawn; None for what is no variable of the automaton.
    values : ndarray, shape (n,)
        Its values on the trace's grid.
    jumps : sequence of str, optional
        Names of the jumps to mark. Default: those of the part of a composition that the variable belongs to, without
        internal ones, and those that change the values visibly; none if these are more than `MARKED_JUMPS`.

    Raises
    ------
    DeclarationError
        For a jump that the automaton does not have.
    """
    if jumps is not None:
        return jump_mask(trace.arc, [jumps] if isinstance(jumps, str) else jumps)
    marked = _visibly_changed(values[trace.last[:-1]], values[trace.first[1:]], values)
    if scalar is not None:
        scope = scalar.variable.name.rpartition(".")[0]
        events = [info.name for info in trace.arc.automaton.jumps if not info.internal]
        marked |= jump_mask(trace.arc, [name for name in events if not scope or name.startswith(f"{scope}.")])
    return marked if marked.sum() <= MARKED_JUMPS else np.zeros_like(marked)


def _visibly_changed(before: FloatArray, after: FloatArray, values: FloatArray) -> npt.NDArray[np.bool_]:
    size = np.max(np.abs(values[np.isfinite(values)]), initial=0.0)
    with np.errstate(invalid="ignore"):
        same: npt.NDArray[np.bool_] = np.abs(after - before) <= VISIBLE * size
    same |= (before == after) | (np.isnan(before) & np.isnan(after))
    return ~same

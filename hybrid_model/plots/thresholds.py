"""What makes a run jump: margins of jumps, and errors against their thresholds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import FloatArray, Value, Values
from hybrid_model.plots.drawing import draw_arc, marked_jumps
from hybrid_model.plots.style import TIME, add_label, legend, new_axes
from hybrid_model.plots.trace import Trace, find_scalar, jump_mask
from hybrid_model.record.arc import HybridArc

Quantity = str | Callable[[Values], Value]
"""A scalar variable by name, or a function of all values: ``lambda s: abs(s.broadcast - s.x)``."""


def plot_margin(arc: HybridArc, *names: str, ax: Axes | None = None, **line_options: Any) -> Axes:
    """Draw the margins of jumps over time; a jump is due where its margin rises to zero.

    The margin of a jump on time is minus the time that is left until it.

    Parameters
    ----------
    arc : HybridArc
        The run.
    *names : str
        Jumps; each is marked on its own margin. Default: all jumps on state.
    ax : Axes, optional
        Where to draw.
    **line_options
        Of the lines, as in ``Axes.plot``.

    Raises
    ------
    DeclarationError
        For an unknown jump.
    """
    infos = arc.automaton.jumps
    chosen = names or tuple(info.name for info in infos if info.trigger is Trigger.STATE)
    jump_mask(arc, chosen)
    trace = Trace(arc)
    margins: dict[str, FloatArray] = {}
    for trigger in Trigger:
        own = [info.name for info in infos if info.trigger is trigger]
        if set(own) & set(chosen):
            rows = trace.function(_margins_of(arc, trigger))
            margins |= dict(zip(own, rows.T, strict=True))
    ax = new_axes(ax)
    for name in chosen:
        draw_arc(ax, trace, [trace.t, margins[name]], jump_mask(arc, [name]), {"label": name} | line_options)
    ax.axhline(0.0, color="0.5", linewidth=0.6, zorder=0)
    ax.set_xlabel(TIME)
    ax.set_ylabel(f"margin of {chosen[0]}" if len(chosen) == 1 else "margins")
    legend(ax)
    return ax


def plot_threshold(
    arc: HybridArc,
    error: Quantity,
    threshold: Quantity | float,
    *,
    ax: Axes | None = None,
    jumps: Sequence[str] | None = None,
    **line_options: Any,
) -> Axes:
    """Draw an error and the threshold that makes it jump, over time.

    Parameters
    ----------
    arc : HybridArc
        The run.
    error : str or callable
        A scalar variable, or a function of all values.
    threshold : str or callable or float
        Likewise, or a number.
    ax : Axes, optional
        Where to draw.
    jumps : sequence of str, optional
        Names of the jumps to mark. Default: of a variable as in `plot_over_time`, of a function those that change its
        values visibly; none if these are more than 60.
    **line_options
        Of the error's line, as in ``Axes.plot``.

    Raises
    ------
    DeclarationError
        For an unknown variable or jump, or an array without an element.
    """
    trace = Trace(arc)
    label, values = _quantity(trace, error, "error")
    level_label, level = _quantity(trace, threshold, "threshold")
    marked = marked_jumps(trace, find_scalar(arc, error) if isinstance(error, str) else None, values, jumps)
    ax = new_axes(ax)
    draw_arc(ax, trace, [trace.t, values], marked, {"label": label} | line_options)
    ax.plot(trace.t, level, color="k", linestyle=(0, (6, 2)), linewidth=1.0, label=level_label)
    ax.set_xlabel(TIME)
    ax.set_ylabel(add_label(ax.get_ylabel(), label))
    legend(ax)
    return ax


def _margins_of(arc: HybridArc, trigger: Trigger) -> Callable[[Values], list[Value]]:
    if trigger is Trigger.STATE:
        return arc.automaton.jump_margins
    return lambda s: [s.t - time for time in arc.automaton.event_times(s)]


def _quantity(trace: Trace, quantity: Quantity | float, otherwise: str) -> tuple[str, FloatArray]:
    if isinstance(quantity, str):
        scalar = find_scalar(trace.arc, quantity)
        return scalar.label, trace.scalar(scalar)
    if callable(quantity):
        return otherwise, trace.function(quantity)
    return otherwise, np.full(trace.t.size, float(quantity))

"""A run over t, over j, in the phase plane, and in three dimensions over (t, j)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from hybrid_model.declare.variables import FloatArray
from hybrid_model.plots.drawing import draw_arc, marked_jumps
from hybrid_model.plots.style import JUMPS, TIME, add_label, equal_scales, legend, new_axes, short_names, with_unit
from hybrid_model.plots.trace import Scalar, Trace, find_scalar, find_scalars, jump_mask
from hybrid_model.record.arc import HybridArc

COMPARABLE = 10.0
"""Ranges of two numbers without unit that differ by more than this factor are given scales of their own."""


def plot_over_time(
    arc: HybridArc, *names: str, ax: Axes | None = None, jumps: Sequence[str] | None = None, **line_options: Any
) -> Axes:
    """Draw variables over time t.

    Parameters
    ----------
    arc : HybridArc
        The run.
    *names : str
        Variables or elements, ``"h"``, ``"x[2]"``; an array stands for its elements. Default: the continuous states.
    ax : Axes, optional
        Where to draw.
    jumps : sequence of str, optional
        Names of the jumps to mark. Default: those of the part of a composition that the variable belongs to, without
        internal ones, and those that change the variable; none if these are more than 60.
    **line_options
        Of the lines, as in ``Axes.plot``.

    Raises
    ------
    DeclarationError
        For an unknown variable or jump.
    """
    return _plot_over(arc, names, ax, jumps, line_options, over_jumps=False)


def plot_over_jumps(
    arc: HybridArc, *names: str, ax: Axes | None = None, jumps: Sequence[str] | None = None, **line_options: Any
) -> Axes:
    """Draw variables over the number of jumps j: a flow is a vertical line, a jump leads from j to j + 1.

    Parameters
    ----------
    arc, *names, ax, jumps, **line_options
        As in `plot_over_time`.

    Raises
    ------
    DeclarationError
        For an unknown variable or jump.
    """
    return _plot_over(arc, names, ax, jumps, line_options, over_jumps=True)


def plot_phase(
    arc: HybridArc,
    horizontal: str,
    vertical: str,
    *,
    ax: Axes | None = None,
    jumps: Sequence[str] | None = None,
    **line_options: Any,
) -> Axes:
    """Draw one variable over another, with a triangle at the start and a square at the end.

    Variables of one unit have one scale, so that a circle is round; numbers without a unit have it if their ranges are
    comparable.

    Parameters
    ----------
    arc : HybridArc
        The run.
    horizontal, vertical : str
        Scalar variables or elements of arrays.
    ax, jumps, **line_options
        As in `plot_over_time`.

    Raises
    ------
    DeclarationError
        For an unknown variable or jump, or an array without an element.
    """
    x, y = find_scalar(arc, horizontal), find_scalar(arc, vertical)
    trace = Trace(arc)
    points = [trace.scalar(x), trace.scalar(y)]
    marked = np.logical_or(*(marked_jumps(trace, s, v, jumps) for s, v in zip((x, y), points, strict=True)))
    ax = new_axes(ax)
    flows = draw_arc(ax, trace, points, marked, line_options)
    present = ax.get_legend_handles_labels()[1]
    for at, marker, text in ((0, "^", "start"), (-1, "s", "end")):
        ends: dict[str, Any] = {
            "color": flows.get_color(),
            "markersize": 6,
            "linestyle": "none",
            "zorder": flows.get_zorder() + 0.2,
        }
        ax.plot(*(v[[at]] for v in points), marker=marker, label=f"_{text}" if text in present else text, **ends)
    ax.set_xlabel(add_label(ax.get_xlabel(), x.label))
    ax.set_ylabel(add_label(ax.get_ylabel(), y.label))
    if _comparable(x, y, points):
        equal_scales(ax)
    legend(ax)
    return ax


def _comparable(x: Scalar, y: Scalar, points: Sequence[FloatArray]) -> bool:
    """Whether two scalars are of one kind, by their unit, or without one by their ranges."""
    if x.variable.unit or y.variable.unit or x.variable is y.variable:
        return x.variable.unit == y.variable.unit
    finite = [values[np.isfinite(values)] for values in points]
    short, long = sorted(float(np.ptp(values)) if values.size else 0.0 for values in finite)
    return long <= COMPARABLE * short


def plot_hybrid_arc(
    arc: HybridArc, name: str, *, ax: Axes | None = None, jumps: Sequence[str] | None = None, **line_options: Any
) -> Axes:
    """Draw a variable in three dimensions over hybrid time (t, j).

    Parameters
    ----------
    arc : HybridArc
        The run.
    name : str
        A scalar variable or an element of an array.
    ax : Axes3D, optional
        Where to draw; ``plt.subplots(subplot_kw={"projection": "3d"})`` makes such axes.
    jumps, **line_options
        As in `plot_over_time`.

    Raises
    ------
    DeclarationError
        For an unknown variable or jump, an array without an element, or axes of two dimensions.
    """
    scalar = find_scalar(arc, name)
    trace = Trace(arc)
    values = trace.scalar(scalar)
    marked = marked_jumps(trace, scalar, values, jumps)
    ax = new_axes(ax, solid=True)
    draw_arc(ax, trace, [trace.t, trace.j.astype(float), values], marked, {"label": scalar.name} | line_options)
    ax.set_xlabel(TIME)
    ax.set_ylabel(JUMPS)
    ax.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    # The axes are short in projection: more numbers would run into each other.
    ax.xaxis.set_major_locator(MaxNLocator(5))
    solid = cast(Any, ax)  # matplotlib ships no types of its three-dimensional axes
    solid.set_zlabel(add_label(solid.get_zlabel(), scalar.label))
    legend(ax)
    return ax


def plot_time_domain(
    arc: HybridArc, *, ax: Axes | None = None, jumps: Sequence[str] | None = None, **line_options: Any
) -> Axes:
    """Draw the hybrid time domain of a run: j over t.

    Parameters
    ----------
    arc : HybridArc
        The run.
    ax, **line_options
        As in `plot_over_time`.
    jumps : sequence of str, optional
        Names of the jumps to mark. Default: none, the steps show them.

    Raises
    ------
    DeclarationError
        For an unknown jump.
    """
    marked = jump_mask(arc, jumps or ())
    ax = new_axes(ax)
    trace = Trace(arc)
    draw_arc(ax, trace, [trace.t, trace.j.astype(float)], marked, line_options)
    ax.set_xlabel(TIME)
    ax.set_ylabel(JUMPS)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def _plot_over(
    arc: HybridArc,
    names: Sequence[str],
    ax: Axes | None,
    jumps: Sequence[str] | None,
    line_options: dict[str, Any],
    *,
    over_jumps: bool,
) -> Axes:
    scalars = find_scalars(arc, names)
    trace = Trace(arc)
    values = [trace.scalar(scalar) for scalar in scalars]
    marks = [marked_jumps(trace, s, v, jumps) for s, v in zip(scalars, values, strict=True)]
    ax = new_axes(ax)
    horizontal = trace.j.astype(float) if over_jumps else trace.t
    labels, axis = _labels(scalars)
    for label, drawn, marked in zip(labels, values, marks, strict=True):
        draw_arc(ax, trace, [horizontal, drawn], marked, {"label": label} | line_options)
    ax.set_xlabel(JUMPS if over_jumps else TIME)
    if over_jumps:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_ylabel(add_label(ax.get_ylabel(), axis))
    legend(ax)
    return ax


def _labels(scalars: Sequence[Scalar]) -> tuple[list[str], str]:
    """Return the names of curves in one pair of axes, and the label of their axis."""
    if len({scalar.variable.unit for scalar in scalars}) > 1:
        return [scalar.label for scalar in scalars], ""
    names = [scalar.name for scalar in scalars]
    variables = {scalar.variable.name for scalar in scalars}
    labels, common = short_names(names)
    if not common and len(names) > 3:
        common = variables.pop() if len(variables) == 1 else "values"
    return labels, with_unit(common or ", ".join(names), scalars[0].variable.unit if scalars else "")

"""Figures of many certificates: radius, rate and gap against beta or c, and how conservative each bound is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from hybrid_model.plots import COLORS, new_axes

__all__ = ["LABELS", "plot_against_parameter", "plot_conservatism", "plot_radius_against", "plot_rate_against"]

LABELS = {
    "beta": r"decay of the threshold $\beta$ (1/s)",
    "c": "threshold $c$",
    "rate": "rate (1/s)",
    "radius": r"ultimate radius of $\|x_e\|$",
    "min_gap": "smallest time between broadcasts (s)",
    "transient": "transient factor",
}
"""Texts of axes by the names that certificates use."""

_LARGEST = 1e100
"""A bound that is larger has overflown, or is about to; an axis that shows it shows nothing else."""

STYLES: dict[str, dict[str, Any]] = {
    "printed": {"color": COLORS[1], "linestyle": (0, (5, 2)), "marker": "x"},
    "valid": {"color": COLORS[0], "linestyle": "solid", "marker": "s"},
    "improved": {"color": COLORS[4], "linestyle": "solid", "marker": "^"},
    "energy": {"color": COLORS[2], "linestyle": "solid", "marker": "D"},
    "exact": {"color": COLORS[6], "linestyle": "solid", "marker": "o"},
    "floquet": {"color": COLORS[6], "linestyle": "solid", "marker": "o"},
    "observed": {"color": COLORS[3], "linestyle": (0, (1, 1.2)), "marker": "v"},
}
"""The look of each form of a bound, the same in all figures."""


def plot_against_parameter(
    parameter: npt.ArrayLike,
    values: Mapping[str, Sequence[float | None]],
    *,
    xlabel: str,
    ylabel: str,
    ax: Axes | None = None,
) -> Axes:
    """Draw one quantity in several forms against a parameter, on a logarithmic axis.

    Parameters
    ----------
    parameter : array_like, shape (m,)
        beta or c.
    values : mapping
        Form -> m numbers; None, or what a logarithm cannot show, where the form does not exist leaves a gap.
    xlabel, ylabel : str
        Texts of the axes; names in `LABELS` stand for those.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If a form has another number of values than the parameter.
    """
    ax = new_axes(ax)
    x = np.asarray(parameter, dtype=float)
    for form, row in values.items():
        if len(row) != len(x):
            raise ValueError(f"'{form}' has {len(row)} values for {len(x)} of the parameter; give one for each.")
        y = np.array([value if _drawable(value) else math.nan for value in row], dtype=float)
        style, name = STYLES.get(form, {"marker": "."}), _written(form)
        missing = not np.isfinite(y).any()
        # The finest marks on few points only: curves that fall together must both be seen.
        ax.plot(x, y, markersize=2.6, markevery=max(1, len(x) // 10), label=f"no {name}" if missing else name, **style)
    ax.set_yscale("log")
    ax.set_xlabel(LABELS.get(xlabel, xlabel))
    ax.set_ylabel(LABELS.get(ylabel, ylabel))
    ax.margins(x=0.02)
    _legend_above(ax)
    return ax


def plot_radius_against(
    name: str, parameter: npt.ArrayLike, values: Mapping[str, Sequence[float | None]], ax: Axes | None = None
) -> Axes:
    """Draw the ultimate radius in several forms against ``"beta"`` or ``"c"``; see `plot_against_parameter`."""
    return plot_against_parameter(parameter, values, xlabel=name, ylabel="radius", ax=ax)


def plot_rate_against(
    name: str, parameter: npt.ArrayLike, values: Mapping[str, Sequence[float | None]], ax: Axes | None = None
) -> Axes:
    """Draw the rate in several forms against ``"beta"`` or ``"c"``, see `plot_against_parameter`.

    Against beta, the line ``rate = beta`` parts thresholds that fall more slowly than disagreement, above it, from
    those that fall faster.
    """
    ax = plot_against_parameter(parameter, values, xlabel=name, ylabel="rate", ax=ax)
    if name == "beta":
        low, high = ax.get_ylim()
        x = np.asarray(parameter, dtype=float)
        x = np.linspace(float(x.min()), float(x.max()), 200)
        x = x[(x >= low) & (x <= high)]
        if x.size:
            ax.plot(x, x, color="0.6", linewidth=0.7, zorder=0, label=r"$\beta$")
            ax.set_ylim(low, high)
            _legend_above(ax)
    return ax


def plot_conservatism(
    certified: Mapping[str, Mapping[str, float | None]],
    reference: Mapping[str, float | None],
    ax: Axes | None = None,
) -> Axes:
    """Draw by which factor each bound is weaker than what is exact or observed; left of 1 it is violated.

    What is observed is no bound: it is drawn in grey, on the side on which it lies.

    Parameters
    ----------
    certified : mapping
        Quantity -> form -> value; upper bounds of a radius, lower bounds of a rate or a gap. Quantities other than
        ``"radius"`` and ``"transient"`` are taken as lower bounds.
    reference : mapping
        Quantity -> exact or observed value that the bounds are divided by, or that is divided by them.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If a quantity has no positive reference.
    """
    ax = new_axes(ax)
    names: list[str] = []
    factors = [1.0]
    for quantity, forms in certified.items():
        against = reference.get(quantity)
        if against is None or not _drawable(against):
            raise ValueError(f"the {quantity} has the reference {against}; give the exact or observed value, above 0.")
        for form, value in forms.items():
            row = len(names)
            names.append(f"{quantity.replace('min_gap', 'gap')}, {_written(form)}")
            if value is None or not _drawable(value):
                ax.text(1.12, row, "none", va="center", fontsize="small", color="0.4")
                continue
            factor = value / against if quantity in ("radius", "transient") else against / value
            # Exact forms agree with their reference up to rounding and the search for the supremum.
            violated = factor < 1 - 1e-6 and form != "observed"
            color = "0.5" if form == "observed" else COLORS[1] if violated else COLORS[0]
            ax.plot([1.0, factor], [row, row], color=color, linewidth=1.0)
            ax.plot([factor], [row], marker="o", markersize=4, color=color)
            factors.append(factor)
            # Right of both ends of the stem, where nothing else is.
            ax.annotate(
                _number(factor) + (", violated" if violated else ""),
                (max(factor, 1.0), row),
                (6, 0),
                textcoords="offset points",
                ha="left",
                va="center",
                fontsize="small",
            )
    ax.axvline(1.0, color="0.3", linewidth=0.8, zorder=0)
    ax.set_xscale("log")
    # Room for the numbers beside the dots.
    span = max(factors) / min(factors)
    ax.set_xlim(min(factors) / (1.5 * span**0.05), max(factors) * 4.0 * span**0.3)
    ax.xaxis.set_major_locator(LogLocator(numticks=7))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("conservatism (factor to the reference)")
    return ax


def _number(value: float) -> str:
    """Three digits; as a power of ten where there would be more than four before the point or zeros behind it."""
    if 1e-2 <= value < 1e4:
        return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$"


def _drawable(value: float | None) -> bool:
    return value is not None and 0 < value < _LARGEST


def _written(form: str) -> str:
    return form.replace("floquet", "Floquet")


def _legend_above(ax: Axes) -> None:
    count = len(ax.get_legend_handles_labels()[0])
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.3,
        ncols=count if count < 4 else (count + 1) // 2,
        columnspacing=1.2,
        handlelength=1.6,
    )

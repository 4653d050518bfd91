"""Figures of many certificates: a quantity in several forms against beta or c."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeGuard

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from hybrid_model.consensus.certificates.forms import Form, Quantity
from hybrid_model.consensus.figures.style import FORMS, legend_above
from hybrid_model.plots import new_axes

__all__ = ["is_drawable", "plot_against_parameter", "plot_radius_against", "plot_rate_against"]

_PARAMETERS = {"beta": r"decay of the threshold $\beta$ (1/s)", "c": "threshold $c$"}
"""Texts of axes by the names of parameters."""

_LARGEST = 1e100
"""A bound that is larger has overflown, or is about to; an axis that shows it shows nothing else."""


def plot_against_parameter(
    parameter: npt.ArrayLike,
    values: Mapping[str, Sequence[float | None]],
    *,
    name: str,
    quantity: Quantity,
    ax: Axes | None = None,
) -> Axes:
    """Draw one quantity in several forms against a parameter, on a logarithmic axis.

    Parameters
    ----------
    parameter : array_like, shape (m,)
        beta or c.
    values : mapping
        Form -> m numbers; None, or what a logarithm cannot show, where the form does not exist leaves a gap.
    name : str
        Of the parameter: ``"beta"`` or ``"c"``.
    quantity : Quantity
        What is drawn.
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
        y = np.array([value if is_drawable(value) else math.nan for value in row], dtype=float)
        label = Form(form).label if np.isfinite(y).any() else f"no {Form(form).label}"
        # The finest marks on few points only: curves that fall together must both be seen.
        ax.plot(x, y, markersize=2.6, markevery=max(1, len(x) // 10), label=label, **FORMS[form])
    ax.set_yscale("log")
    ax.set_xlabel(_PARAMETERS[name])
    ax.set_ylabel(quantity.axis)
    ax.margins(x=0.02)
    legend_above(ax, handlelength=1.6)
    return ax


def plot_radius_against(
    name: str, parameter: npt.ArrayLike, values: Mapping[str, Sequence[float | None]], ax: Axes | None = None
) -> Axes:
    """Draw the ultimate radius in several forms against ``"beta"`` or ``"c"``; see `plot_against_parameter`."""
    return plot_against_parameter(parameter, values, name=name, quantity=Quantity.RADIUS, ax=ax)


def plot_rate_against(
    name: str, parameter: npt.ArrayLike, values: Mapping[str, Sequence[float | None]], ax: Axes | None = None
) -> Axes:
    """Draw the rate in several forms against ``"beta"`` or ``"c"``, see `plot_against_parameter`.

    Against beta, the line ``rate = beta`` parts thresholds that fall more slowly than disagreement, above it, from
    those that fall faster.
    """
    ax = plot_against_parameter(parameter, values, name=name, quantity=Quantity.RATE, ax=ax)
    if name == "beta":
        low, high = ax.get_ylim()
        x = np.asarray(parameter, dtype=float)
        x = np.linspace(float(x.min()), float(x.max()), 200)
        x = x[(x >= low) & (x <= high)]
        if x.size:
            ax.plot(x, x, color="0.6", linewidth=0.7, zorder=0, label=r"$\beta$")
            ax.set_ylim(low, high)
            legend_above(ax, handlelength=1.6)
    return ax


def is_drawable(value: float | None) -> TypeGuard[float]:
    """Whether a logarithmic axis can show a value."""
    return value is not None and 0 < value < _LARGEST
